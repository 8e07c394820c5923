"""Discrepancy of whole steps, and the effects of a file's numbers on their law.

A file with other numbers has other laws. These are evaluated again at the same states; the engine
does not run again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from physics_crosscheck.harness.checks.task import TreeTask
from physics_crosscheck.harness.checks.whole_step import (
    Evaluated,
    LawComparison,
    LawDefect,
    drawn_states,
    load_comparison,
)
from physics_crosscheck.harness.diagnosis.fit import Faults, Hypothesis
from physics_crosscheck.harness.diagnosis.hypotheses import rank
from physics_crosscheck.harness.diagnosis.robot_problem import ROUNDING_CHANGE, source_line
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
        return self.comparison.judge(self.evaluated, resolution)

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
        """Return the defect per unit of each fault, near no fault, (len(indices), N)."""
        indices = range(len(self.hypotheses)) if indices is None else indices
        rows = [self.effect(index) for index in indices]
        nothing = np.zeros(self.compared.defect.size)
        return np.array([nothing if row is None else row for row in rows])

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
            numbers.law_numbers[index]: self.hypotheses[index].value + fault
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
            after = self.comparison.predict(law, acceleration, sample.engine)
            before = self.comparison.predict(
                sample.solution.law, sample.acceleration, sample.engine
            )
            rows.append(after - before)
        change: Array = np.array(rows) / self.compared.scale
        return change

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
            after = other.predict(again.law, again.acceleration, sample.engine)
            before = self.comparison.predict(
                sample.solution.law, sample.acceleration, sample.engine
            )
            rows.append(after - before)
        change: Array = np.array(rows) / self.compared.scale
        return change


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
    return LawProblem(
        numbers=numbers,
        comparison=comparison,
        evaluated=evaluated,
        compared=comparison.compare(evaluated),
    )
