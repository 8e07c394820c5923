"""One number of a robot's file made wrong, the file run beside the equations of the right one."""

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
from physics_crosscheck.harness.engines.protocol import EngineError
from physics_crosscheck.harness.modelfiles.copies import copy_with_texts
from physics_crosscheck.harness.modelfiles.numbers import SMALL, Number
from physics_crosscheck.harness.modelfiles.readers import Numbers, robot_numbers
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.reference.solving.flows import Flow
from physics_crosscheck.reference.solving.integrate import ReferenceError

RESOLUTION = 1e-9

STATES = 32
"""Of the forty that a run takes."""

ROUNDING = 1e-13
"""A change of the ends by less, relative to their movement, is that of rounding."""

RIGHT = 0.01
"""How near a fitted value must be to the right one, as a share of the fault, beside its error."""


class Fate(StrEnum):
    """What came of a fault."""

    INVISIBLE = "no motion depends on it"
    FAINT = "below the resolution"
    MISSED = "not caught"
    REFUSED = "the engine refuses the file"
    NAMED = "named"
    TIED = "tied with the first"
    CAUGHT = "caught, not named"

    @property
    def seen(self) -> bool:
        """Whether it counts among what can be seen."""
        return self not in (Fate.INVISIBLE, Fate.FAINT, Fate.REFUSED)


@dataclass(frozen=True, kw_only=True)
class Planted:
    """A fault and its fate.

    Attributes:
        file, line, address: of the number.
        share: of its size by which it is wrong.
        effect: largest change of an end, relative to its movement.
        said: what the first explanation is, with its remainder.
        seconds: processor time that it took.
    """

    file: str
    line: int
    address: str
    share: float
    fate: Fate
    effect: float
    said: str = ""
    seconds: float = 0.0

    def __str__(self) -> str:
        where = f"{self.file}:{self.line} {self.address} off by {self.share:g}"
        return f"{where}: {self.fate}, effect {self.effect:.1e}; {self.said}"


@dataclass(frozen=True, kw_only=True)
class Ground:
    """A robot's file as it is, and some states of it.

    Attributes:
        prepared: the file, read and solved.
        numbers: of it.
        flow: of its states.
        engine: that runs the changed copies.
        known: what its numbers do to the states of a diagnosis; None where each diagnosis works
            that out anew, of the changed copy.
    """

    prepared: PreparedTree
    numbers: Numbers
    flow: Flow
    engine: str
    known: RobotProblem | None

    @staticmethod
    def of(
        file: Path,
        engine: str,
        *,
        floating: bool = False,
        edited: bool = False,
        known: bool = True,
        settings: Mapping[str, object] = MappingProxyType({}),
    ) -> Ground:
        """Of a file.

        Args:
            file: of the robot.
            engine: that runs the changed copies.
            floating: whether the root link of a URDF moves freely.
            edited: whether the changed copy is what is suspected; else that the engine takes the
                file, as it is, otherwise than it says. The second works out once what each number
                does.
            known: whether numbers are to be named by the equations.
            settings: of the engine, beside those of the robot.
        """
        prepared = prepare_tree(file, floating=floating)
        drawn = prepared.samples
        some = drawn.pick(slice(STATES))
        numbers = robot_numbers(file, prepared.settings)
        tree = numbers.tree({})
        assert tree is not None  # it was prepared
        prepared = replace(prepared, samples=some, settings={**prepared.settings, **settings})
        task = model_task(prepared, engine, resolution=RESOLUTION)
        problem = problem_of(task, numbers, is_reference=True) if known and not edited else None
        if problem is not None:
            problem.slopes({})
        return Ground(
            prepared=prepared,
            numbers=numbers,
            flow=Flow(tree, some.start, some.start_inputs, some.length),
            engine=engine,
            known=problem,
        )

    def effect(self, index: int, value: float) -> float:
        """Largest change of an end, relative to how far it moves at most; infinite without one."""
        drawn = self.prepared.samples
        scale = np.max(np.abs(drawn.end - drawn.start), axis=0)
        tree = self.numbers.tree({index: value})
        if tree is None or tree.dof != self.flow.tree.dof:
            return np.inf
        try:
            moved = np.abs(self.flow.moved(tree)).max(axis=0)
        except ReferenceError:
            return np.inf
        return float(np.max(moved / np.where(scale > 0, scale, scale.max())))


def plant(ground: Ground, index: int, share: float) -> Planted:
    """One fault, and what comes of it."""

    def judged(copy: Path, one: Number, value: float, effect: float) -> tuple[Fate, str]:
        task = model_task(ground.prepared, ground.engine, resolution=RESOLUTION).with_file(copy)
        return _fate(ground, task, one, value, effect)

    return planted(ground, index, share, judged)


Judged = Callable[[Path, Number, float, float], tuple[Fate, str]]
"""What comes of a copy with one number at another value, and what is said: by the effect of it."""


def planted(ground: Ground, index: int, share: float, judged: Judged) -> Planted:
    """One number made wrong in a copy of the file, where that moves anything, and judged."""
    began = time.process_time()
    one = ground.numbers.numerals[index]
    value = wrong(one, share)
    effect = ground.effect(index, value)
    fate, said = Fate.INVISIBLE, ""
    if effect > ROUNDING:
        with tempfile.TemporaryDirectory(prefix="crosscheck-") as folder:
            copy = copy_with_texts(
                ground.prepared.place, ground.numbers.texts({index: value}), Path(folder)
            )
            fate, said = judged(copy, one, value, effect)
    return Planted(
        file=one.file.name,
        line=one.line,
        address=one.address,
        share=share,
        fate=fate,
        effect=effect,
        said=said,
        seconds=time.process_time() - began,
    )


def wrong(one: Number, share: float) -> float:
    """A number off by a share of its size, or of that of its neighbours where it is zero."""
    return one.value + share * (abs(one.value) if abs(one.value) > SMALL else one.scale)


def _fate(
    ground: Ground, task: TreeTask, one: Number, value: float, effect: float
) -> tuple[Fate, str]:
    try:
        verdict = judge(task)
    except EngineError as error:
        return Fate.REFUSED, str(error)
    # What is larger shows, whichever way the engine's ends are uncertain; so does what follows.
    follows = verdict.map_residual > RESOLUTION + 2 * verdict.map_uncertainty
    if effect <= RESOLUTION + 2 * verdict.largest_uncertainty and not follows:
        return Fate.FAINT, ""
    if verdict.outcome is not Outcome.DIFFERS:
        return Fate.MISSED, f"{verdict.outcome} {verdict.reason}"
    edited = ground.known is None
    ranking = ranked(task, is_reference=not edited, known_problem=ground.known)
    aim = one.value if edited else value, abs(value - one.value)
    if not ranking.fits:
        return Fate.CAUGHT, "nothing fits"
    first = ranking.fits[0]
    said = f"{' and '.join(map(str, first.causes))} leaves {first.remaining:.1e}"
    if not ranking.explained:
        return Fate.CAUGHT, f"unexplained; {said}"
    if _is(first, one):
        return (Fate.NAMED if _right(first, *aim) else Fate.CAUGHT), said
    told = [fit for fit in ranking.fits if _is(fit, one)]
    tied = any(cause.subject == (one.address,) for cause in first.tied_with)
    if tied and all(_right(fit, *aim) for fit in told[:1]):
        return Fate.TIED, said
    return Fate.CAUGHT, said


def _is(fit: Fit, one: Number) -> bool:
    return len(fit.members) == 1 and fit.causes[0].subject == (one.address,)


def _right(fit: Fit, aim: float, fault: float) -> bool:
    """Whether a fitted value is the right one."""
    return abs(fit.estimates[0] - aim) <= RIGHT * fault + 5 * fit.standard_errors[0]


def table(found: Sequence[Planted]) -> list[str]:
    """How many had which fate, by share, and the share of those seen that are named."""
    lines = []
    for share in sorted({one.share for one in found}):
        counts = Counter(one.fate for one in found if one.share == share)
        said = ", ".join(f"{counts[fate]} {fate}" for fate in Fate if counts[fate])
        lines.append(f"off by {share:g}: {said}")
    seen = [one for one in found if one.fate.seen]
    good = sum(one.fate in (Fate.NAMED, Fate.TIED) for one in seen)
    part = f", {good / len(seen):.1%}" if seen else ""
    lines.append(f"of {len(seen)} that can be seen, {good} are caught and named{part}")
    return lines
