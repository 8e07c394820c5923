"""Discrepancy of whole steps, and the effects of a file's numbers on their law.

A file with other numbers has other laws, and so has an engine with a typical mistake. These are
evaluated again at the same states; the engine does not run again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from physics_crosscheck.harness.checks.law_comparison import (
    Evaluated,
    LawComparison,
    LawDefect,
    LawEngine,
    TreeLaw,
    applied,
)
from physics_crosscheck.harness.checks.law_states import KeptSteps
from physics_crosscheck.harness.checks.task import TreeTask
from physics_crosscheck.harness.documents.elements import Number
from physics_crosscheck.harness.engines.protocol import EngineError, ModelSpec, WholeModel
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.mjcf.numbers import CompiledNumbers
from physics_crosscheck.harness.modelfiles.numbers import NUDGE, ModelFile
from physics_crosscheck.harness.modelfiles.readers import robot_numbers
from physics_crosscheck.harness.modelfiles.urdf.laws import convex_numbers, impulse_numbers
from physics_crosscheck.harness.modelfiles.urdf.read import UrdfNumbers
from physics_crosscheck.harness.numerics.judgement import LimitVerdict
from physics_crosscheck.harness.records.cause import CauseId
from physics_crosscheck.reference.laws.mistakes import (
    LawMistake,
    changed_step,
    hard_mistakes,
    same_rule,
    single_changes,
    soft_mistakes,
)
from physics_crosscheck.reference.laws.near_rigid import NearRigidModel
from physics_crosscheck.reference.laws.step import LawModel, LawSolution
from physics_crosscheck.reference.mechanism.laws import ImpulseRules
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.tree import TreeError
from .diagnose import REFINED, Ranking, diagnose, largest_remaining
from .fit import Faults, Fit, Hypothesis, NumberProblem, Resolved, left_linear, refine
from .hypotheses import rank
from .robot_problem import ROUNDING_CHANGE, number_hypothesis
from .trial import REFUSED

NUMBERS_FITTED = 16
"""Single numbers to fit."""


class LawNumbers(Protocol):
    """The numbers of a file, and its laws for other values."""

    @property
    def numerals(self) -> tuple[Number, ...]:
        """All numbers, in order."""

    @property
    def law_numbers(self) -> tuple[int, ...]:
        """Indices of the numbers that may affect the laws."""

    @property
    def law_choices(self) -> Mapping[int, tuple[int, ...]]:
        """Indices of the numbers that select a law, with the other values."""

    def laws(self, values: Mapping[int, float]) -> TreeLaw | None:
        """Return the laws with other values of some numbers, by index, or None."""

    def texts(self, values: Mapping[int, float]) -> Mapping[Path, bytes]:
        """Return the files, by path, with other values of some numbers."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LawProblem(NumberProblem):
    """Discrepancy of whole steps, with the laws of the file.

    Attributes:
        numbers: of the file whose laws these are.
        engine, spec: what the engine loads.
        comparison: the laws in the engine.
        evaluated: the states.
        compared: engine - laws there, scaled.
        with_mistakes: whether hypotheses are not only numbers.
    """

    numbers: LawNumbers
    engine: str
    spec: ModelSpec
    comparison: LawComparison
    evaluated: Sequence[Evaluated]
    compared: LawDefect
    with_mistakes: bool = True

    @property
    def numerals(self) -> Sequence[Number]:
        """Numbers of the file."""
        return self.numbers.numerals

    def judge(self, resolution: float) -> LimitVerdict:
        """Judge the discrepancy."""
        return self.comparison.judge(self.compared, resolution)

    def in_engine(self, spec: ModelSpec) -> LawProblem:
        """Return the problem at the same states of a file that the engine loads.

        Raises:
            TreeError, EngineError: if its joints are others, or for a file that it refuses.
        """
        model = engines()[self.engine].load_whole(spec)
        if model is None:
            raise EngineError(f"{spec.path}: the engine has no law")
        return self.of_model(model)

    def mistaken(self, name: str) -> LawProblem:
        """Return the problem of an engine with a known answer that makes a typical mistake.

        Without a name, it makes none.
        """
        laws = self.comparison.laws
        for mistake in self.mistakes:
            laws = mistake.change(laws) if mistake.name == name else laws
        return self.of_model(LawEngine(self.comparison.under(laws)))

    def of_model(self, model: WholeModel) -> LawProblem:
        """Return the problem at the same states of another loaded model.

        The effects of numbers are shared, since these depend on the laws alone.

        Raises:
            TreeError: if its joints are others.
        """
        comparison = self.comparison.of_engine(model)
        evaluated = comparison.evaluate([sample.state for sample in self.evaluated])
        compared = comparison.compare(evaluated)
        same = len(evaluated) == len(self.evaluated)
        return replace(
            self,
            comparison=comparison,
            evaluated=evaluated,
            compared=compared.relative_to(self.compared.scale) if same else compared,
            _rows=self._rows if same else {},
        )

    def parts(self, size: int) -> list[LawProblem]:
        """Return the problems of a few states each."""
        places = [slice(first, first + size) for first in range(0, len(self.evaluated), size)]
        return [
            replace(
                self,
                evaluated=self.evaluated[place],
                compared=self.compared.at_states(place),
                _rows={},
            )
            for place in places
        ]

    @cached_property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """Each number of the laws, each other choice, and each typical mistake."""
        numerals = self.numerals
        rows = [number_hypothesis(numerals[i], i, 1.0) for i in self.numbers.law_numbers]
        if not self.with_mistakes:
            return tuple(rows)
        for i, values in self.numbers.law_choices.items():
            units = [value - numerals[i].value for value in values]
            rows += [number_hypothesis(numerals[i], i, unit, switch=True) for unit in units]
        for mistake in self.mistakes:
            cause = CauseId(kind="law", subject=(mistake.name,))
            rows.append(Hypothesis(id=cause, value=0.0, size=1.0, rank=rank("law"), switch=True))
        return tuple(rows)

    @cached_property
    def mistakes(self) -> tuple[LawMistake[Any], ...]:
        """Typical mistakes that the laws have a place for."""
        laws = self.comparison.laws
        if isinstance(laws, LawModel):
            return tuple(soft_mistakes(laws))
        return tuple(hard_mistakes(laws))

    def defect(self, faults: Faults) -> Array:
        """Return engine - laws after repair of these faults, scaled and flat, (N,)."""
        whole = self.compared.defect
        if not any(faults.values()):
            return whole.ravel()
        laws = self._changed(faults)
        if laws is None:
            return np.full(whole.size, REFUSED)
        remaining: Array = (whole - self._solved(laws)).ravel()
        return remaining

    def _slopes_at(self, faults: Faults, indices: Sequence[int]) -> Sequence[Array | None]:
        """Return slopes by differences over a small change of each number."""
        before, rows = self.defect(faults), list[Array | None]()
        for index in indices:
            step = NUDGE * self.hypotheses[index].size
            after = self.defect({**faults, index: faults.get(index, 0.0) + step})
            is_refused = max(np.max(after), np.max(before)) >= REFUSED
            rows.append(None if is_refused else (before - after) / step)
        return rows

    def _effect(self, index: int) -> Array | None:
        hypothesis = self.hypotheses[index]
        if hypothesis.switch:
            remaining = self.defect({index: 1.0})
            change: Array = self.defect({}) - remaining
            return None if np.max(remaining) >= REFUSED else change
        for step in (NUDGE * hypothesis.size, -NUDGE * hypothesis.size):
            laws = self._changed({index: step})
            if laws is not None:
                change = self._linear(laws).ravel()
                acts = float(np.max(np.abs(change), initial=0.0)) > ROUNDING_CHANGE
                return change / step if acts else np.zeros_like(change)
        return None

    def element_effects(
        self, index: int, elements: Sequence[int] | None = None
    ) -> dict[int, Array]:
        """Return the changes of all components by a number of several elements, such as a default.

        Args:
            index: of the number.
            elements: indices of those that take its new value, one at a time; all by default.

        Returns:
            By the element, per unit, (N,) each; nothing if there are fewer than two.
        """
        step = NUDGE * self.hypotheses[index].size
        laws, model = self._changed({index: step}), self.comparison.laws
        if not isinstance(laws, LawModel) or not isinstance(model, LawModel):
            return {}
        rows = list(single_changes(model.laws, laws.laws))
        chosen = range(len(rows)) if elements is None else elements
        if len(rows) < 2:
            return {}
        return {k: self._linear(model.under(rows[k])).ravel() / step for k in chosen}

    def _changed(self, faults: Faults) -> TreeLaw | None:
        """Return the laws with faults; None if they have other coordinates, states or shapes."""
        values = self.values(faults)
        laws = self.numbers.laws(values) if values else self.comparison.laws
        laws = None if laws is None else applied(laws, self.comparison.model)
        for hypothesis in (self.hypotheses[index] for index, fault in faults.items() if fault):
            if laws is not None and hypothesis.id.kind == "law":
                (name,) = hypothesis.id.subject
                laws = next(one for one in self.mistakes if one.name == name).change(laws)
        return laws if laws is not None and self._fits(laws) else None

    def _fits(self, laws: TreeLaw) -> bool:
        mine, other = self.comparison.laws, laws
        same = len(mine.laws.surfaces) == len(other.laws.surfaces)
        return same and mine.tree.tree.nv == other.tree.tree.nv

    def _linear(self, laws: TreeLaw) -> Array:
        """Return the change of all components by other laws, to first order if that is quicker."""
        comparison = self.comparison
        model = comparison.laws
        if not isinstance(laws, LawModel) or not isinstance(model, LawModel):
            return self._solved(laws)
        # At unchanged accelerations, a small change removes the whole force of a near-rigid row.
        near_rigid = isinstance(laws, NearRigidModel)
        if near_rigid or laws.tree is not model.tree or not same_rule(model.laws, laws.laws):
            return self._solved(laws)
        rows = list[Array]()
        for sample, expected in zip(self.evaluated, self._expected, strict=True):
            assert isinstance(sample.solution, LawSolution)
            acceleration, law = changed_step(model, laws, sample.solution)
            same = law is sample.solution.law
            rows.append(expected if same else comparison.predict(law, acceleration, sample.engine))
        return self._change(rows)

    def _solved(self, laws: TreeLaw) -> Array:
        return self._change(self.comparison.expected_by(laws, self.evaluated))

    def _change(self, rows: Sequence[Array] | Array) -> Array:
        """Return components by other laws, (C,) at each state, minus those by the file's laws."""
        change: Array = (np.array(rows) - self._expected) / self.compared.scale
        return change

    @cached_property
    def _expected(self) -> Array:
        return np.array([self.comparison.expected(sample) for sample in self.evaluated])


MINOR = 0.5
"""Largest change of a number, as a share of its size, that needs no mistake as an explanation."""


def diagnose_laws(problem: LawProblem) -> Ranking:
    """Rank numbers of the laws, and mistakes in them, by the discrepancy that they leave.

    Mistakes take longer, and are tried unless a small fault of a number explains the discrepancy.
    A large fault makes rows act, or stop acting, at some states. If nothing explains them all, fits
    start again from the values that explain single states.
    """
    numbers = replace(problem, with_mistakes=False)
    uncertainty = problem.compared.uncertainty.ravel()
    ranking = diagnose(numbers, uncertainty, NUMBERS_FITTED)
    if (
        ranking.is_single
        and abs(ranking.fits[0].faults[0]) <= MINOR * ranking.fits[0].hypotheses[0].size
    ):
        return ranking
    ranking = diagnose(problem, uncertainty, NUMBERS_FITTED)
    if not ranking.fits or ranking.is_single:
        return ranking
    better = _restarted(numbers, uncertainty)
    return replace(ranking, fits=(*better, *ranking.fits), explained=True) if better else ranking


def _restarted(problem: LawProblem, uncertainty: Array) -> list[Fit]:
    """Return the fits of numbers, from values that explain single states, that leave little."""
    defect = problem.compared.defect.ravel()
    size = float(np.linalg.norm(defect))
    whole = Resolved(problem, np.ones(len(defect), dtype=bool), uncertainty, size)
    slopes = problem.slopes({})
    remaining = [left_linear(defect, [h], row[None]) if row.any() else np.inf
                 for h, row in zip(problem.hypotheses, slopes, strict=True)]  # fmt: skip
    fits = []
    for i in np.argsort(remaining)[:REFINED].tolist():
        sizes = {
            fault: float(np.linalg.norm(problem.defect({i: fault})))
            for fault in _faults(problem, slopes[i])
        }
        if sizes:
            start = {i: min(sizes, key=sizes.__getitem__)}
            near = slopes.copy()
            near[i] = problem.slopes(start, [i])[0]
            fits.append(refine(whole, start, near))
    accepted = largest_remaining(whole.floor)
    return sorted((fit for fit in fits if fit.remaining <= accepted), key=lambda f: f.remaining)


STARTS, MULTIPLES = 6, (1.0, 2.0, 4.0)
"""States whose faults are tried, and multiples of these: a row that stops acting hides the rest."""


def _faults(problem: LawProblem, slope: Array) -> tuple[float, ...]:
    """Return the faults that explain the states where a number acts most, one by one.

    `slope` is that of all components, (N,).
    """
    defects = problem.compared.defect
    slopes = slope.reshape(defects.shape)
    power = np.sum(slopes**2, axis=1)
    states = [k for k in np.argsort(-power).tolist() if power[k] > 0][:STARTS]
    single = (float(slopes[k] @ defects[k] / power[k]) for k in states)
    return tuple(multiple * fault for fault in single for multiple in MULTIPLES)


def law_problem(task: TreeTask, numbers: ModelFile | None = None) -> LawProblem | None:
    """Compare whole steps of a file with its law; None without one, or if nothing is comparable.

    Args:
        task: the file in an engine.
        numbers: of the file, if they are read.

    Raises:
        RobotError: if no installed engine compiles the file.
    """
    numbers = numbers or robot_numbers(task.target.place, task.spec.settings)
    if not isinstance(numbers, CompiledNumbers | UrdfNumbers):
        return None
    steps = task.target.steps if task.spec.path == task.target.place else KeptSteps()
    try:
        model = steps.model(task.engine, task.spec)
        if model is None:
            return None
        of_laws: LawNumbers | None = None
        if isinstance(numbers, CompiledNumbers):
            of_laws = numbers
        elif isinstance(model.rules, ImpulseRules):
            of_laws = impulse_numbers(numbers, model.rules)
        elif model.rules is not None:
            of_laws = convex_numbers(numbers, model.rules)
        laws = None if of_laws is None else of_laws.laws({})
        if of_laws is None or laws is None:
            return None
        return _problem(task, of_laws, LawComparison(laws, model), steps)
    except (TreeError, EngineError):
        return None


def _problem(
    task: TreeTask, numbers: LawNumbers, comparison: LawComparison, steps: KeptSteps
) -> LawProblem | None:
    """Compare a file with its law, at drawn or evaluated states; None if none is comparable."""
    evaluated = steps.evaluated(comparison)
    if not evaluated:
        return None
    compared = comparison.compare(evaluated)
    kept = compared.resolved(task.resolution)
    return LawProblem(
        numbers=numbers,
        engine=task.engine,
        spec=task.spec,
        comparison=comparison,
        evaluated=[sample for sample, keeps in zip(evaluated, kept, strict=True) if keeps],
        compared=compared.at_states(kept),
    )
