"""Discrepancy of a robot, and the effects of its file's numbers, from the equations alone.

Thus a number that an engine ignores has a slope, and no engine runs again.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations

import numpy as np

from physics_crosscheck.harness.checks.scene import inertia_difference
from physics_crosscheck.harness.documents.elements import Number, XmlElement
from physics_crosscheck.harness.modelfiles.inertias import breaks_rule
from physics_crosscheck.harness.modelfiles.numbers import NUDGE, ModelFile
from physics_crosscheck.harness.records.cause import CauseId, CauseKind
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import SpatialInertia
from physics_crosscheck.reference.mechanism.tree import Tree, TreeLink
from physics_crosscheck.reference.solving.flows import Flow
from physics_crosscheck.reference.solving.integrate import ReferenceError
from .fit import Faults, Hypothesis, NumberProblem, Perturbation
from .hypotheses import line_of, rank
from .robot_followers import Following
from .trial import REFUSED

ROUNDING_CHANGE = 1e-13
"""Relative change of the ends that counts as rounding error."""

SAME_INERTIA = 1e-9
"""Relative difference below which the inertia of a compiled body is the file's."""

READ_SHARE = 1e-2
"""Distance of a fitted body from the compiled one, as a share of the file's distance from it."""

CURVED_NUDGE = 1e-2
"""Relative change of a number whose slope is negligible."""

NEGLIGIBLE_SLOPE, MIN_CHORD_RATIO = 1e-4, 30.0
"""Limits of negligible slopes: effect of a change by the number's size, and ratio of chords.

A longer chord that is steeper by this ratio indicates curvature.
"""


@dataclass(frozen=True, kw_only=True, eq=False)
class RobotProblem(NumberProblem):
    """Discrepancy of a robot's file in an engine, with the equations.

    Attributes:
        numbers: of the file that the engine runs.
        flow: end states of that file's equations from some states.
        hypotheses: H of them that might explain the discrepancy.
        apart: engine - reference at the ends, scaled, (B, 2n); with k followers, (B, 2n + 2k).
        scale: of a defect, (2n + 2k,).
        way: 1 if the reference is the file itself, so that a fault changes the engine's apparent
            value; -1 for another reference, so that repairing the fault changes the file's value.
        following: deviations of followers; None without followers.
        compiled: inertia that the engine compiled, by link; empty if unknown.
    """

    numbers: ModelFile
    flow: Flow
    hypotheses: tuple[Hypothesis, ...]
    apart: Array
    scale: Array
    way: int
    following: Following | None = None
    compiled: Mapping[int, SpatialInertia] = field(default_factory=dict)
    _defects: dict[object, Array] = field(default_factory=dict, init=False, repr=False)
    _flows: dict[object, Flow | None] = field(default_factory=dict, init=False, repr=False)
    _last: dict[tuple[int, ...], Flow] = field(default_factory=dict, init=False, repr=False)
    _rows: dict[int, Array | None] = field(default_factory=dict, init=False, repr=False)

    def with_discrepancy(self, apart: Array) -> RobotProblem:
        """Return the problem with another discrepancy and the same slopes."""
        other = replace(self, apart=apart)
        other._rows.update(self._rows)
        return other

    @property
    def numerals(self) -> Sequence[Number]:
        """Numbers of the file."""
        return self.numbers.numerals

    def defect(self, faults: Faults) -> Array:
        """Return engine - reference after repair of these faults, scaled and flat, (N,)."""
        values = self.values(faults)
        key = tuple(sorted(values.items()))
        if key not in self._defects:
            self._defects[key] = self._defect(values)
        return self._defects[key]

    def left_by(self, tree: Tree) -> Array:
        """Return the remaining defect, (N,), if the engine reads the file as this tree.

        Raises:
            ReferenceError: if the equations cannot be solved.
        """
        return self._remaining(self.flow.for_tree(tree))

    def _slopes_at(self, faults: Faults, indices: Sequence[int]) -> Sequence[Array | None]:
        """Return the slopes of the trajectories there, and of the linear problem here."""
        flow = self._flow(self.values(faults))
        return [
            None
            if flow is None
            else self._switched(flow, faults, index)
            if self.hypotheses[index].switch
            else self._slope(flow, faults, index)
            for index in indices
        ]

    def _effect(self, index: int) -> Array | None:
        if self.hypotheses[index].switch:
            change: Array = self.defect({}) - self.defect({index: 1.0})
            return change
        return self._slope(self.flow, {}, index)

    def _switched(self, flow: Flow, faults: Faults, index: int) -> Array:
        """Return a switch's effect with faults, on unchanged trajectories, to rank pairs."""
        tree = self._tree(self.values({**faults, index: 1.0}))
        try:
            by = None if tree is None else self._ends(tree, flow.variation(tree))
        except ReferenceError:
            by = None
        return np.zeros(self.apart.size) if by is None else self.way * by.ravel()

    def _slope(self, flow: Flow, faults: Faults, index: int) -> Array | None:
        """Return the slope by a difference; if it is negligible and curved, by a longer one.

        The length of an axis, or a turn out of the plane of all motions, has no first-order effect.
        The chord then points in the direction of the curvature.
        """
        near = self._chord(flow, faults, index, NUDGE)
        if near is None or np.max(np.abs(near)) * self.hypotheses[index].size >= NEGLIGIBLE_SLOPE:
            return near
        far = self._chord(flow, faults, index, CURVED_NUDGE)
        is_curved = far is not None and np.max(np.abs(far)) > MIN_CHORD_RATIO * np.max(np.abs(near))
        return far if is_curved else near

    def _chord(self, flow: Flow, faults: Faults, index: int, share: float) -> Array | None:
        """Return the slope over a share of the size, downwards if no tree exists upwards.

        Return None if none exists on either side.
        """
        size = self.hypotheses[index].size
        for step in (share * size, -share * size):
            tree = self._tree(self.values({**faults, index: faults.get(index, 0.0) + step}))
            if tree is None:
                continue
            try:
                by = self._ends(tree, flow.variation(tree))
            except ReferenceError:
                continue
            slope: Array = self.way * by.ravel() / step
            return np.zeros_like(slope) if np.max(np.abs(by)) <= ROUNDING_CHANGE else slope
        return None

    def _defect(self, values: Mapping[int, float]) -> Array:
        nominal = self.apart.ravel()
        if not values:
            return nominal
        flow = self._flow(values)
        if flow is None:
            return np.full_like(nominal, REFUSED)
        return self._remaining(flow)

    def _remaining(self, flow: Flow) -> Array:
        by = self._ends(flow.tree, flow.apart(self.flow))
        remaining: Array = self.apart.ravel() - self.way * by.ravel()
        return remaining

    def _ends(self, tree: Tree, by: Array) -> Array:
        """Return the scaled change of ends and followers, for a tree and its change of ends."""
        if self.following is None:
            return by / self.scale
        return np.concatenate([by, self.following.apart(tree, by)], axis=1) / self.scale

    def _flow(self, values: Mapping[int, float]) -> Flow | None:
        if not values:
            return self.flow
        key = tuple(sorted(values.items()))
        if key not in self._flows:
            tree = self._tree(values)
            try:
                self._flows[key] = (
                    None
                    if tree is None or self._is_impossible(tree)
                    else self._last.get(tuple(values), self.flow).for_tree(tree)
                )
            except ReferenceError:
                self._flows[key] = None
            if (flow := self._flows[key]) is not None:
                self._last[tuple(values)] = flow
        return self._flows[key]

    def _tree(self, values: Mapping[int, float]) -> Tree | None:
        with np.errstate(all="ignore"):
            tree = self.numbers.tree(values)
        nominal = self.flow.tree
        if tree is None or tree.dof != nominal.dof:
            return None
        same = [one.kind for one in tree.links] == [one.kind for one in nominal.links]
        return tree if same and self._read_links.isdisjoint(self._changed(tree)) else None

    @cached_property
    def _read_links(self) -> frozenset[int]:
        """Links whose compiled inertia is the file's, so that no number of it is misread."""
        nominal = self.flow.tree.links
        return frozenset(
            i
            for i, one in self.compiled.items()
            if inertia_difference(one, inertia_of(nominal[i])) <= SAME_INERTIA
        )

    def _changed(self, tree: Tree) -> Iterator[int]:
        for i, (link, nominal) in enumerate(zip(tree.links, self.flow.tree.links, strict=True)):
            if link is nominal:
                continue
            if inertia_difference(inertia_of(link), inertia_of(nominal)) > ROUNDING_CHANGE:
                yield i

    def _is_impossible(self, tree: Tree) -> bool:
        """Return whether a link has an inertia that no body can have, unlike in the file."""
        nominal = self.flow.tree.links
        return any(
            breaks_rule(inertia_of(tree.links[i])) and not breaks_rule(inertia_of(nominal[i]))
            for i in self._changed(tree)
        )

    def is_read(self, faults: Faults) -> bool | None:
        """Return whether compiled bodies have the values of these faults; None if unknown."""
        tree = self._tree(self.values(faults))
        changed = [] if tree is None else list(self._changed(tree))
        if tree is None or not changed or not self.compiled.keys() >= set(changed):
            return None
        nominal = self.flow.tree.links
        return all(
            inertia_difference(self.compiled[i], inertia_of(tree.links[i]))
            <= READ_SHARE * inertia_difference(self.compiled[i], inertia_of(nominal[i]))
            for i in changed
        )


def inertia_of(link: TreeLink) -> SpatialInertia:
    """Return the inertia of a link, in its frame."""
    return SpatialInertia(link.mass, link.center, link.inertia)


MAX_NAMED_ELEMENTS = 4
"""Maximum number of elements that are named if all their numbers are ignored."""

AXIS = re.compile(r".*(axis@xyz|axis/xyz|joint@axis)")
"""Paths of the numbers of a joint's axis."""

_MOMENT = re.compile(r"(.*inertia[@/])i(?:xx|yy|zz)|(.*@diaginertia)\[\d\]")
_MOMENTS = re.compile(r".*/inertia@\w+")
_PRODUCTS = re.compile(r".*/inertia@(ixy|ixz|iyz)")


def suspicions(numbers: ModelFile, *, is_reference: bool) -> Iterator[Hypothesis]:
    """Yield all hypotheses.

    Args:
        numbers: of the file.
        is_reference: whether the file is right, and the engine may read it differently.
    """
    way = 1.0 if is_reference else -1.0
    for i in numbers.relevant_numbers:
        yield number_hypothesis(numbers.numerals[i], i, way, "taken" if is_reference else "literal")
    yield from _reversed(numbers)
    yield from _exchanged(numbers)
    if is_reference:
        yield from _dropped(numbers)


def number_hypothesis(
    number: Number, index: int, unit: float, kind: CauseKind = "taken", *, switch: bool = False
) -> Hypothesis:
    """Return the hypothesis that a number is wrong, or taken differently.

    Args:
        number: of the file.
        index: its index there.
        unit: change of the number that repairs one unit of the fault.
        kind: of the cause.
        switch: whether the fault is either 0 or 1.
    """
    return Hypothesis(
        id=CauseId(kind=kind, subject=(number.address,)),
        value=number.value,
        size=1.0 if switch else number.scale,
        rank=rank("literal"),
        where=(line_of(number),),
        correction=unit,
        switch=switch,
        repair=Perturbation(numbers={index: unit}),
    )


def _reversed(numbers: ModelFile) -> Iterator[Hypothesis]:
    axes: dict[str, dict[int, float]] = {}
    relevant = set(numbers.relevant_numbers)
    for i, number in enumerate(numbers.numerals):
        if AXIS.fullmatch(number.path) and (joint := joint_of(number.within)):
            axes.setdefault(joint, {})[i] = number.value
    for joint, values in axes.items():
        units = {i: -2.0 * value for i, value in values.items() if value}
        if relevant.isdisjoint(values) or not units:  # the length of an axis has no effect
            continue
        yield _switch(numbers, CauseId(kind="axis", subject=(joint,)), units, rank("axis"))


def joint_of(element: XmlElement | None) -> str:
    """Return the name of the joint that an element belongs to, or ""."""
    while element is not None and element.tag != "joint":
        element = element.parent
    return "" if element is None else element.identity or ""


def _exchanged(numbers: ModelFile) -> Iterator[Hypothesis]:
    tensors: dict[str, list[int]] = {}
    for i in numbers.relevant_numbers:
        if match := _MOMENT.fullmatch(numbers.numerals[i].address):
            tensors.setdefault(match[1] or match[2], []).append(i)
    for tensor in tensors.values():
        for i, j in combinations(tensor, 2):
            first, second = numbers.numerals[i], numbers.numerals[j]
            change = second.value - first.value
            if change:
                cause = CauseId(kind="exchange", subject=(first.address, second.address))
                yield _switch(numbers, cause, {i: change, j: -change}, rank("exchange"))


def _switch(
    numbers: ModelFile, cause: CauseId, units: Mapping[int, float], order: int
) -> Hypothesis:
    places = tuple(dict.fromkeys(line_of(numbers.numerals[i]) for i in units))
    repair = Perturbation(numbers=units)
    return Hypothesis(
        id=cause, value=0.0, size=1.0, rank=order, where=places, switch=True, repair=repair
    )


def _dropped(numbers: ModelFile) -> Iterator[Hypothesis]:
    """Yield groups of numbers that an engine may ignore, each as if it were zero."""
    numerals = numbers.numerals
    groups: dict[tuple[int, ...], str] = {}
    for name, group in _groups(numbers):
        nonzero = tuple(i for i in group if numerals[i].value)
        if len(nonzero) > 1:  # a single number is a hypothesis already
            groups.setdefault(nonzero, name)
    for chosen, name in groups.items():
        elements = tuple(dict.fromkeys(numerals[i].address.split("@")[0] for i in chosen))
        subject = tuple(f"{name} of {element}" for element in elements)
        if len(elements) > MAX_NAMED_ELEMENTS:
            subject = (f"{name} of {len(elements)} elements",)
        cause = CauseId(kind="dropped", subject=subject)
        units = {i: -numerals[i].value for i in chosen}
        yield _switch(numbers, cause, units, rank("default"))


def _groups(numbers: ModelFile) -> Iterator[tuple[str, list[int]]]:
    """Yield named groups of numbers that may be ignored together; groups may be equal."""
    kinds: dict[str, list[int]] = {}
    links: dict[int, list[int]] = {}
    massless: list[int] = []
    products: list[int] = []
    for i in numbers.relevant_numbers:
        number = numbers.numerals[i]
        kinds.setdefault("/".join(number.path.split("/")[-2:]), []).append(i)
        if _MOMENTS.fullmatch(number.path):
            links.setdefault(id(number.element), []).append(i)
            if _mass(number) == 0.0:
                massless.append(i)
        if _PRODUCTS.fullmatch(number.path):
            products.append(i)
    for group in links.values():
        yield "moments", group
    yield "moments", massless
    yield "products", products
    for kind, group in kinds.items():
        yield kind.rpartition("@")[2] or kind, group


def _mass(number: Number) -> float | None:
    inertial = number.element.parent
    masses = [] if inertial is None else [m for m in inertial.children if m.tag == "mass"]
    try:
        return float(masses[0].attributes["value"]) if masses else None
    except (KeyError, ValueError):
        return None
