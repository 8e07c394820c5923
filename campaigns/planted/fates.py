"""Faults in numbers of a robot file, judged by the equations of the original file."""

from __future__ import annotations

import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from types import MappingProxyType

import numpy as np

from physics_crosscheck.harness.checks.case import judge
from physics_crosscheck.harness.checks.prepare import PreparedTree, prepare_tree
from physics_crosscheck.harness.checks.task import TreeTask, model_task
from physics_crosscheck.harness.diagnosis.fit import Fit
from physics_crosscheck.harness.diagnosis.robot_problem import RobotProblem
from physics_crosscheck.harness.diagnosis.robot_task import problem_of, ranked
from physics_crosscheck.harness.documents.elements import Number
from physics_crosscheck.harness.engines.protocol import EngineError
from physics_crosscheck.harness.modelfiles.numbers import SMALL, ModelFile, copy_with_texts
from physics_crosscheck.harness.modelfiles.readers import robot_numbers
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.reference.solving.flows import Flow
from physics_crosscheck.reference.solving.integrate import ReferenceError

RESOLUTION = 1e-9

STATES = 32
"""Number of states, of the forty that a run takes."""

ROUNDING = 1e-13
"""Largest change of the ends, relative to their movement, that counts as rounding."""

FIT_TOLERANCE = 0.01
"""Accepted error of a fitted value as a share of the fault, plus five standard errors."""


class FaultFate(StrEnum):
    """The result of a fault."""

    INVISIBLE = "no motion depends on it"
    FAINT = "below the resolution"
    MISSED = "not caught"
    REFUSED = "the engine refuses the file"
    NAMED = "named"
    TIED = "tied with the first"
    CAUGHT = "caught, not named"

    @property
    def is_visible(self) -> bool:
        """True if a motion shows the fault above the resolution."""
        return self not in (FaultFate.INVISIBLE, FaultFate.FAINT, FaultFate.REFUSED)


@dataclass(frozen=True, kw_only=True)
class RobotFault:
    """A fault and its result.

    Attributes:
        file, line, address: of the number.
        share: size of the fault relative to the number.
        fate: the result.
        effect: largest change of an end, relative to its movement.
        explanation: the first explanation with its residual, or the reason for the result.
        seconds: processor time.
    """

    file: str
    line: int
    address: str
    share: float
    fate: FaultFate
    effect: float
    explanation: str = ""
    seconds: float = 0.0

    def __str__(self) -> str:
        where = f"{self.file}:{self.line} {self.address} off by {self.share:g}"
        return f"{where}: {self.fate}, effect {self.effect:.1e}; {self.explanation}"


@dataclass(frozen=True, kw_only=True)
class FaultBaseline:
    """An unchanged robot file, some of its states, and the effects of its numbers.

    Attributes:
        prepared: the file, read and solved.
        numbers: of the file.
        flow: motions from its states.
        engine: that runs the changed copies.
        problem: the diagnosis problem of the file, with the effects of its numbers; None if each
            diagnosis computes them for the changed copy.
    """

    prepared: PreparedTree
    numbers: ModelFile
    flow: Flow
    engine: str
    problem: RobotProblem | None

    @staticmethod
    def from_file(
        file: Path,
        engine: str,
        *,
        floating: bool = False,
        edited: bool = False,
        use_equations: bool = True,
        settings: Mapping[str, object] = MappingProxyType({}),
    ) -> FaultBaseline:
        """Read and solve a file.

        Args:
            file: of the robot.
            engine: that runs the changed copies.
            floating: whether the root link of a URDF moves freely.
            edited: whether diagnoses suspect the changed copy, and read it each time. Otherwise
                they suspect the engine, and compute the effect of each number once.
            use_equations: whether the equations name the numbers.
            settings: added to the engine settings of the robot.
        """
        prepared = prepare_tree(file, floating=floating)
        samples = prepared.samples.pick(slice(STATES))
        numbers = robot_numbers(file, prepared.settings)
        tree = numbers.tree({})
        assert tree is not None  # it was prepared
        prepared = replace(prepared, samples=samples, settings={**prepared.settings, **settings})
        task = model_task(prepared, engine, resolution=RESOLUTION)
        problem = (
            problem_of(task, numbers, is_reference=True) if use_equations and not edited else None
        )
        if problem is not None:
            problem.slopes({})
        return FaultBaseline(
            prepared=prepared,
            numbers=numbers,
            flow=Flow(tree, samples.start, samples.start_inputs, samples.length),
            engine=engine,
            problem=problem,
        )

    def effect(self, index: int, value: float) -> float:
        """Return the largest change of an end over its movement; infinite if it can't be solved."""
        samples = self.prepared.samples
        scale = np.max(np.abs(samples.end - samples.start), axis=0)
        tree = self.numbers.tree({index: value})
        if tree is None or tree.dof != self.flow.tree.dof:
            return np.inf
        try:
            moved = np.abs(self.flow.moved(tree)).max(axis=0)
        except ReferenceError:
            return np.inf
        return float(np.max(moved / np.where(scale > 0, scale, scale.max())))


def judge_by_equations(baseline: FaultBaseline, index: int, share: float) -> RobotFault:
    """Change a number by a share of its size, and judge the copy by the original's equations."""

    def judge_copy(
        copy: Path, number: Number, value: float, effect: float
    ) -> tuple[FaultFate, str]:
        task = model_task(baseline.prepared, baseline.engine, resolution=RESOLUTION)
        return _fate(baseline, task.with_file(copy), number, value, effect)

    return judge_fault(baseline, index, share, judge_copy)


JudgeCopy = Callable[[Path, Number, float, float], tuple[FaultFate, str]]
"""A function of a changed copy, its number, the wrong value and its effect.

It returns the result and its explanation.
"""


def judge_fault(
    baseline: FaultBaseline, index: int, share: float, judge_copy: JudgeCopy
) -> RobotFault:
    """Change a number in a copy of the file, and judge the copy if any motion depends on it."""
    began = time.process_time()
    number = baseline.numbers.numerals[index]
    value = wrong_value(number, share)
    effect = baseline.effect(index, value)
    fate, explanation = FaultFate.INVISIBLE, ""
    if effect > ROUNDING:
        with tempfile.TemporaryDirectory(prefix="crosscheck-") as folder:
            texts = baseline.numbers.texts({index: value})
            copy = copy_with_texts(baseline.prepared.place, texts, Path(folder))
            fate, explanation = judge_copy(copy, number, value, effect)
    return RobotFault(
        file=number.file.name,
        line=number.line or 0,
        address=number.address,
        share=share,
        fate=fate,
        effect=effect,
        explanation=explanation,
        seconds=time.process_time() - began,
    )


def wrong_value(number: Number, share: float) -> float:
    """Return a number plus a share of its size, or of its neighbours' size if it is zero."""
    size = abs(number.value) if abs(number.value) > SMALL else number.scale
    return number.value + share * size


def _fate(
    baseline: FaultBaseline, task: TreeTask, number: Number, value: float, effect: float
) -> tuple[FaultFate, str]:
    try:
        verdict = judge(task)
    except EngineError as error:
        return FaultFate.REFUSED, str(error)
    # A larger effect shows for any error within the uncertainty; so does a map residual.
    has_residual = verdict.map_residual > RESOLUTION + 2 * verdict.map_uncertainty
    if effect <= RESOLUTION + 2 * verdict.largest_uncertainty and not has_residual:
        return FaultFate.FAINT, ""
    if verdict.outcome is not Outcome.DIFFERS:
        return FaultFate.MISSED, f"{verdict.outcome} {verdict.reason}"
    edited = baseline.problem is None
    ranking = ranked(task, is_reference=not edited, known_problem=baseline.problem)
    target, size = number.value if edited else value, abs(value - number.value)
    if not ranking.fits:
        return FaultFate.CAUGHT, "nothing fits"
    first = ranking.fits[0]
    explanation = f"{' and '.join(map(str, first.causes))}, residual {first.remaining:.1e}"
    if not ranking.explained:
        return FaultFate.CAUGHT, f"unexplained; {explanation}"
    if _names(first, number):
        return (FaultFate.NAMED if _fits(first, target, size) else FaultFate.CAUGHT), explanation
    naming = [fit for fit in ranking.fits if _names(fit, number)]
    tied = any(cause.subject == (number.address,) for cause in first.tied_with)
    if tied and all(_fits(fit, target, size) for fit in naming[:1]):
        return FaultFate.TIED, explanation
    return FaultFate.CAUGHT, explanation


def _names(fit: Fit, number: Number) -> bool:
    return len(fit.members) == 1 and fit.causes[0].subject == (number.address,)


def _fits(fit: Fit, target: float, fault: float) -> bool:
    """Return whether the fitted value is the target, for a fault of a given size."""
    return abs(fit.estimates[0] - target) <= FIT_TOLERANCE * fault + 5 * fit.standard_errors[0]


def table(faults: Sequence[RobotFault]) -> list[str]:
    """Return the counts of results by size of the fault, and the share of visible ones named."""
    lines = []
    for share in sorted({fault.share for fault in faults}):
        counts = Counter(fault.fate for fault in faults if fault.share == share)
        results = ", ".join(f"{counts[fate]} {fate}" for fate in FaultFate if counts[fate])
        lines.append(f"off by {share:g}: {results}")
    visible = [fault for fault in faults if fault.fate.is_visible]
    named = sum(fault.fate in (FaultFate.NAMED, FaultFate.TIED) for fault in visible)
    part = f", {named / len(visible):.1%}" if visible else ""
    lines.append(f"of {len(visible)} visible faults, {named} are caught and named{part}")
    return lines
