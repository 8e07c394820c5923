"""Discrepancy of whole steps, and the effects of a file's numbers on their law.

A file with other numbers has other laws. These are evaluated again at the same states; the engine
does not run again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.checks.task import TreeTask
from physics_crosscheck.harness.checks.whole_step import (
    Evaluated,
    LawComparison,
    LawDefect,
    drawn_states,
    load_comparison,
)
from physics_crosscheck.harness.diagnosis.diagnose import NAMED, REFINED, Ranking, diagnose
from physics_crosscheck.harness.diagnosis.fit import (
    Faults,
    Hypothesis,
    Resolved,
    left_linear,
    refine,
)
from physics_crosscheck.harness.diagnosis.hypotheses import rank
from physics_crosscheck.harness.diagnosis.robot_problem import (
    NEAR_ZERO_FAULT,
    ROUNDING_CHANGE,
    source_line,
)
from physics_crosscheck.harness.diagnosis.trial import REFUSED
from physics_crosscheck.harness.engines.protocol import EngineError
from physics_crosscheck.harness.modelfiles.mjcf.numbers import CompiledNumbers
from physics_crosscheck.harness.modelfiles.numbers import NUDGE
from physics_crosscheck.harness.modelfiles.readers import Numbers, robot_numbers
from physics_crosscheck.harness.numerics.judgement import LimitVerdict
from physics_crosscheck.harness.records.cause import CauseId
from physics_crosscheck.reference.laws.sensitivity import changed_step, same_rule
from physics_crosscheck.reference.laws.step import LawModel, LawSolution
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.tree import TreeError

NUMBERS_FITTED = 16
"""Single numbers to fit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LawProblem:
    """Discrepancy of whole steps, with the laws of the file.

    Attributes:
        numbers: of the file whose laws these are.
        comparison: the laws in the engine.
        evaluated: the states.
        compared: engine - laws there, scaled.
    """

    numbers: CompiledNumbers
    comparison: LawComparison
    evaluated: Sequence[Evaluated[LawSolution]]
    compared: LawDefect
    _rows: dict[int, Array | None] = field(default_factory=dict, init=False, repr=False)

    def judge(self, resolution: float) -> LimitVerdict:
        """Judge the discrepancy."""
        return self.comparison.judge(self.compared, resolution)

    def in_engine(self, engine: str, loaded: Path) -> LawProblem:
        """Return the problem at the same states of a file that an engine loads.

        The effects of numbers are shared, since these depend on the laws alone.

        Raises:
            TreeError, EngineError: if its joints are others, or for a file that it refuses.
        """
        comparison = load_comparison(self.comparison.laws, engine, loaded)
        if comparison is None:
            raise EngineError(f"{loaded}: the engine has no law")
        evaluated = comparison.evaluate([sample.state for sample in self.evaluated])
        compared = comparison.compare(evaluated)
        other = replace(self, comparison=comparison, evaluated=evaluated, compared=compared)
        other._rows.update(self._rows)
        return other

    @cached_property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """Each number of the laws, misread."""
        return tuple(self._suspect(i) for i in self.numbers.law_numbers)

    def _suspect(self, index: int) -> Hypothesis:
        number = self.numbers.numerals[index]
        return Hypothesis(
            id=CauseId(kind="taken", subject=(number.address,)),
            value=number.value,
            size=number.scale,
            rank=rank("literal"),
            where=(source_line(number),),
        )

    def defect(self, faults: Faults) -> Array:
        """Return engine - laws after repair of these faults, scaled and flat, (N,)."""
        values = self._values(faults)
        whole = self.compared.defect
        if not values:
            return whole.ravel()
        laws = self.numbers.laws(values)
        if laws is None or not self._fits(laws):
            return np.full(whole.size, REFUSED)
        change = self._solved(laws)
        remaining: Array = (whole - change).ravel()
        return remaining

    def slopes(self, faults: Faults, indices: Sequence[int] | None = None) -> Array:
        """Return the defect per unit of each fault, near these faults, (len(indices), N)."""
        indices = range(len(self.hypotheses)) if indices is None else indices
        near = all(abs(by) <= NEAR_ZERO_FAULT * self.hypotheses[i].size for i, by in faults.items())
        rows = [
            self.effect(index) if near else self._slope_near(faults, index) for index in indices
        ]
        nothing = np.zeros(self.compared.defect.size)
        return np.array([nothing if row is None else row for row in rows])

    def _slope_near(self, faults: Faults, index: int) -> Array | None:
        """Return the slope at faults, (N,): other rows may act there."""
        before = self.defect(faults)
        step = NUDGE * self.hypotheses[index].size
        after = self.defect({**faults, index: faults.get(index, 0.0) + step})
        if np.max(after) >= REFUSED or np.max(before) >= REFUSED:
            return None
        slope: Array = (before - after) / step
        return slope

    def effect(self, index: int) -> Array | None:
        """Return the change of all components by a number, per unit, (N,); None if it is unknown.

        Source: differences over a small change of the number.
        """
        if index not in self._rows:
            self._rows[index] = self._slope(index)
        return self._rows[index]

    def _slope(self, index: int) -> Array | None:
        number = self.numbers.numerals[self.numbers.law_numbers[index]]
        for step in (NUDGE * number.scale, -NUDGE * number.scale):
            laws = self.numbers.laws({self.numbers.law_numbers[index]: number.value + step})
            if laws is not None and self._fits(laws):
                change = self._linear(laws).ravel()
                acts = float(np.max(np.abs(change), initial=0.0)) > ROUNDING_CHANGE
                return change / step if acts else np.zeros_like(change)
        return None

    def _values(self, faults: Faults) -> Mapping[int, float]:
        numbers = self.numbers
        return {
            numbers.law_numbers[index]: float(self.hypotheses[index].value + fault)
            for index, fault in faults.items()
            if fault
        }

    def _fits(self, laws: LawModel) -> bool:
        """Return whether laws have the same coordinates, states and shapes."""
        mine, other = self.comparison.laws, laws
        same = len(mine.laws.surfaces) == len(other.laws.surfaces)
        return same and mine.tree.tree.nv == other.tree.tree.nv

    def _linear(self, laws: LawModel) -> Array:
        """Return the change of all components by other laws to first order, (S, C)."""
        model = self.comparison.laws
        if laws.tree is not model.tree or not same_rule(model.laws, laws.laws):
            return self._solved(laws)
        rows = []
        for sample in self.evaluated:
            acceleration, law = changed_step(model, laws, sample.solution)
            rows.append(self.comparison.predict(law, acceleration, sample.engine))
        return self._change(rows)

    def _solved(self, laws: LawModel) -> Array:
        """Return the change of all components by other laws, (S, C)."""
        other = self.comparison.under(laws)
        states = [sample.state for sample in self.evaluated]
        rows = []
        for sample, posture in zip(self.evaluated, other.postures(states), strict=True):
            solved = sample.solution
            again = laws.solve(
                posture, solved.controls, solved.states, solved.contacts, solved.acceleration
            )
            rows.append(other.predict(again.law, again.acceleration, sample.engine))
        return self._change(rows)

    def _change(self, rows: Sequence[Array]) -> Array:
        """Return components by other laws, (C,) at each state, minus those by the file's laws."""
        change: Array = (np.array(rows) - self._expected) / self.compared.scale
        return change

    @cached_property
    def _expected(self) -> Array:
        """Components by the file's laws, (S, C)."""
        return np.array([self.comparison.expected(sample) for sample in self.evaluated])


def diagnose_laws(problem: LawProblem) -> Ranking:
    """Rank the numbers of the laws by the discrepancy that they leave.

    A large fault makes rows act, or stop acting, at some states. If no single number explains them
    all, fits start again from the values that explain single states.
    """
    uncertainty = problem.compared.uncertainty.ravel()
    ranking = diagnose(problem, uncertainty, NUMBERS_FITTED)
    if not ranking.fits or (ranking.explained and len(ranking.fits[0].causes) == 1):
        return ranking
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
            fits.append(refine(whole, {i: min(sizes, key=sizes.__getitem__)}, slopes))
    accepted = max(NAMED, 2 * whole.floor)
    better = sorted((fit for fit in fits if fit.remaining <= accepted), key=lambda f: f.remaining)
    return replace(ranking, fits=(*better, *ranking.fits), explained=True) if better else ranking


STARTS = 6
"""States whose faults are tried."""


def _faults(problem: LawProblem, slope: Array) -> tuple[float, ...]:
    """Return the faults that explain the states where a number acts most, one by one.

    `slope` is that of all components, (N,).
    """
    defects = problem.compared.defect
    slopes = slope.reshape(defects.shape)
    power = np.sum(slopes**2, axis=1)
    states = [k for k in np.argsort(-power).tolist() if power[k] > 0][:STARTS]
    return tuple(float(slopes[k] @ defects[k] / power[k]) for k in states)


def law_problem(task: TreeTask, numbers: Numbers | None = None) -> LawProblem | None:
    """Compare whole steps of a file with its law; None without one, or if nothing is comparable.

    Args:
        task: the file in an engine.
        numbers: of the file, if they are read.

    Raises:
        RobotError: if no installed engine compiles the file.
    """
    numbers = numbers or robot_numbers(task.target.place, task.spec.settings)
    laws = numbers.laws({}) if isinstance(numbers, CompiledNumbers) else None
    if laws is None or not isinstance(numbers, CompiledNumbers):
        return None
    try:
        comparison = load_comparison(laws, task.engine, task.file)
        if comparison is None:
            return None
        evaluated = comparison.evaluate(tuple(drawn_states(comparison)))
    except (TreeError, EngineError):
        return None
    if not evaluated:
        return None
    compared = comparison.compare(evaluated)
    kept = compared.resolved(task.resolution)
    return LawProblem(
        numbers=numbers,
        comparison=comparison,
        evaluated=[sample for sample, keeps in zip(evaluated, kept, strict=True) if keeps],
        compared=compared.at_states(kept),
    )
