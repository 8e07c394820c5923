"""A robot's discrepancy, and what the numbers of its file do to it: by the equations alone.

What an engine ignores has a slope so, and no engine is run again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from physics_crosscheck.harness.diagnosis.fit import Hypothesis
from physics_crosscheck.harness.diagnosis.hypotheses.trial import REFUSED
from physics_crosscheck.harness.diagnosis.robot_followers import Following
from physics_crosscheck.harness.modelfiles.numbers import NUDGE
from physics_crosscheck.harness.modelfiles.readers import Numbers
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.tree import Tree
from physics_crosscheck.reference.solving.flows import Flow
from physics_crosscheck.reference.solving.integrate import ReferenceError

NOTHING = 1e-13
"""A change of the ends by less, relative to their movement, is that of rounding."""

BEND = 1e-2
"""Share of its size by which a number is moved that has no slope to speak of."""

FLAT, BENT = 1e-4, 30.0
"""A slope is none to speak of where a change by the number's size would make no more than this; a
chord that is steeper by so many times says that it bends."""

NEAR = 1e-4
"""Faults by no more than this share of their sizes leave slopes as they are, to four digits."""

Faults = Mapping[int, float]
"""Faults by index of the hypothesis; those not named are none."""


@dataclass(frozen=True, kw_only=True)
class Suspicion:
    """A hypothesis on numbers of a file.

    Attributes:
        hypothesis: what might be wrong.
        units: how a fault of one moves each number, by its index.
    """

    hypothesis: Hypothesis
    units: Mapping[int, float]


@dataclass(frozen=True, kw_only=True)
class RobotProblem:
    """What an engine makes of a robot's file, beside its equations.

    Attributes:
        numbers: of the file that the engine runs.
        flow: where the equations of that file take some states.
        suspicions: H of them.
        apart: engine - reference at the ends, scaled, (B, 2n); then of the k joints that follow
            others, (B, 2n + 2k).
        scale: what a defect is relative to, (2n + 2k,).
        way: 1 where the reference is the file's own, so that a fault moves what the engine seems to
            take; -1 where it is another's, so that repairing the fault moves what the file says.
        following: what joints that follow others are off; None where none does.
    """

    numbers: Numbers
    flow: Flow
    suspicions: tuple[Suspicion, ...]
    apart: Array
    scale: Array
    way: int
    following: Following | None = None
    _defects: dict[object, Array] = field(default_factory=dict, init=False, repr=False)
    _flows: dict[object, Flow | None] = field(default_factory=dict, init=False, repr=False)
    _last: dict[tuple[int, ...], Flow] = field(default_factory=dict, init=False, repr=False)
    _rows: dict[int, Array | None] = field(default_factory=dict, init=False, repr=False)

    @cached_property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """What might be wrong."""
        return tuple(one.hypothesis for one in self.suspicions)

    def beside(self, apart: Array) -> RobotProblem:
        """The same numbers and states with another discrepancy; slopes are worked out once."""
        other = replace(self, apart=apart)
        other._rows.update(self._rows)
        return other

    def defect(self, faults: Faults) -> Array:
        """Engine - reference once these faults are repaired, scaled and flat, (N,)."""
        values = self._values(faults)
        key = tuple(sorted(values.items()))
        if key not in self._defects:
            self._defects[key] = self._defect(values)
        return self._defects[key]

    def left_by(self, tree: Tree) -> Array:
        """Return what is left, (N,), where the engine takes the file for this tree.

        Raises:
            ReferenceError: where the equations can't follow it.
        """
        return self._left(self.flow.for_tree(tree))

    def slopes(self, faults: Faults, of: Sequence[int] | None = None) -> Array:
        """How much of the defect a unit of each fault makes, near these faults, (len(of), N).

        Near to no fault they are those of none; far from it those of the trajectories there, and of
        the linear problem here.
        """
        of = range(len(self.suspicions)) if of is None else of
        if all(abs(by) <= NEAR * self.hypotheses[i].size for i, by in faults.items()):
            return np.stack([self._or_none(self.effect(index)) for index in of])
        rows = np.zeros((len(of), self.apart.size))
        flow = self._flow(self._values(faults))
        if flow is None:
            return rows
        for row, index in enumerate(of):
            if self.hypotheses[index].switch:
                rows[row] = self._switched(flow, faults, index)
            else:
                rows[row] = self._or_none(self._slope(flow, faults, index))
        return rows

    def _or_none(self, slope: Array | None) -> Array:
        """A slope; zeros for one that is not known, which no fit names then."""
        return np.zeros(self.apart.size) if slope is None else slope

    def effect(self, index: int) -> Array | None:
        """Return a slope at no fault, (N,); of a switch, all that it does.

        None where it is not known: the file makes no such tree with another value on either side,
        or the equations can't follow it.
        """
        if index not in self._rows:
            self._rows[index] = (
                self.defect({}) - self.defect({index: 1.0})
                if self.hypotheses[index].switch
                else self._slope(self.flow, {}, index)
            )
        return self._rows[index]

    def _switched(self, flow: Flow, faults: Faults, index: int) -> Array:
        """What a switch does beside faults, at trajectories as they are: enough to rank pairs."""
        tree = self._tree(self._values({**faults, index: 1.0}))
        try:
            by = None if tree is None else self._ends(tree, flow.variation(tree))
        except ReferenceError:
            by = None
        return np.zeros(self.apart.size) if by is None else self.way * by.ravel()

    def _slope(self, flow: Flow, faults: Faults, index: int) -> Array | None:
        """By a difference; of what has no slope to speak of and bends, by a longer one.

        The length of an axis, or a turn out of the plane of all motions, has no effect of the first
        order: the chord then points where its curvature does.
        """
        near = self._chord(flow, faults, index, NUDGE)
        if near is None or np.max(np.abs(near)) * self.hypotheses[index].size >= FLAT:
            return near
        far = self._chord(flow, faults, index, BEND)
        bends = far is not None and np.max(np.abs(far)) > BENT * np.max(np.abs(near))
        return far if bends else near

    def _chord(self, flow: Flow, faults: Faults, index: int, share: float) -> Array | None:
        """Slope by a share of the size; to the other side where there is no tree on the one.

        None where there is none on either.
        """
        size = self.hypotheses[index].size
        for step in (share * size, -share * size):
            tree = self._tree(self._values({**faults, index: faults.get(index, 0.0) + step}))
            if tree is None:
                continue
            try:
                by = self._ends(tree, flow.variation(tree))
            except ReferenceError:
                continue
            slope: Array = self.way * by.ravel() / step
            return np.zeros_like(slope) if np.max(np.abs(by)) <= NOTHING else slope
        return None

    def _defect(self, values: Mapping[int, float]) -> Array:
        found = self.apart.ravel()
        if not values:
            return found
        flow = self._flow(values)
        if flow is None:
            return np.full_like(found, REFUSED)
        return self._left(flow)

    def _left(self, flow: Flow) -> Array:
        by = self._ends(flow.tree, flow.apart(self.flow))
        left: Array = self.apart.ravel() - self.way * by.ravel()
        return left

    def _ends(self, tree: Tree, by: Array) -> Array:
        """With a tree that moves ends so, how far they and what follows are moved, scaled."""
        if self.following is None:
            return by / self.scale
        return np.concatenate([by, self.following.apart(tree, by)], axis=1) / self.scale

    def _values(self, faults: Faults) -> dict[int, float]:
        """The numbers with these faults repaired."""
        values: dict[int, float] = {}
        for index, fault in faults.items():
            for number, unit in self.suspicions[index].units.items():
                if fault and unit:
                    before = values.get(number, self.numbers.numerals[number].value)
                    values[number] = before + fault * unit
        return values

    def _flow(self, values: Mapping[int, float]) -> Flow | None:
        if not values:
            return self.flow
        key = tuple(sorted(values.items()))
        if key not in self._flows:
            tree = self._tree(values)
            try:
                self._flows[key] = None if tree is None else self._near(values).for_tree(tree)
            except ReferenceError:
                self._flows[key] = None
            if (found := self._flows[key]) is not None:
                self._last[tuple(values)] = found
        return self._flows[key]

    def _near(self, values: Mapping[int, float]) -> Flow:
        """Where the same numbers were last moved to, from where there is less to correct."""
        return self._last.get(tuple(values), self.flow)

    def _tree(self, values: Mapping[int, float]) -> Tree | None:
        with np.errstate(all="ignore"):
            found = self.numbers.tree(values)
        own = self.flow.tree
        if found is None or found.dof != own.dof:
            return None
        same = [one.kind for one in found.links] == [one.kind for one in own.links]
        return found if same else None
