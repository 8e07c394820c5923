"""Hypotheses on a robot's file, or on how an engine reads it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

from physics_crosscheck.harness.diagnosis.fit import Hypothesis
from physics_crosscheck.harness.diagnosis.hypotheses.candidate import rank
from physics_crosscheck.harness.diagnosis.robot_problem import FileHypothesis
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.modelfiles.numbers import Number
from physics_crosscheck.harness.modelfiles.readers import Numbers
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.cause import CauseId

MAX_NAMED_ELEMENTS = 4
"""Maximum number of elements that are named if all their numbers are ignored."""

AXIS = re.compile(r".*(axis@xyz|axis/xyz|joint@axis)")
"""Paths of the numbers of a joint's axis."""

_MOMENT = re.compile(r"(.*inertia[@/])i(?:xx|yy|zz)|(.*@diaginertia)\[\d\]")
_MOMENTS = re.compile(r".*/inertia@\w+")
_PRODUCTS = re.compile(r".*/inertia@(ixy|ixz|iyz)")


def suspicions(numbers: Numbers, *, is_reference: bool) -> Iterator[FileHypothesis]:
    """Yield all hypotheses.

    Args:
        numbers: of the file.
        is_reference: whether the file is right, and the engine may read it differently.
    """
    for i in numbers.relevant_numbers:
        number = numbers.numerals[i]
        hypothesis = Hypothesis(
            id=CauseId(kind="taken" if is_reference else "literal", subject=(number.address,)),
            value=number.value,
            size=number.scale,
            rank=rank("literal"),
            where=(_line(number),),
            correction=1.0 if is_reference else -1.0,
        )
        yield FileHypothesis(hypothesis=hypothesis, units={i: hypothesis.correction})
    yield from _reversed(numbers)
    yield from _exchanged(numbers)
    if is_reference:
        yield from _dropped(numbers)


def _reversed(numbers: Numbers) -> Iterator[FileHypothesis]:
    """Yield each joint with a reversed axis."""
    axes: dict[str, dict[int, float]] = {}
    relevant = set(numbers.relevant_numbers)
    for i, number in enumerate(numbers.numerals):
        if AXIS.fullmatch(number.path) and (joint := joint_of(number.element)):
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


def _exchanged(numbers: Numbers) -> Iterator[FileHypothesis]:
    """Yield each pair of moments of one tensor with exchanged values."""
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
    numbers: Numbers, cause: CauseId, units: Mapping[int, float], order: int
) -> FileHypothesis:
    """Return a hypothesis whose fault is 0 or 1."""
    places = tuple(dict.fromkeys(_line(numbers.numerals[i]) for i in units))
    hypothesis = Hypothesis(id=cause, value=0.0, size=1.0, rank=order, where=places, switch=True)
    return FileHypothesis(hypothesis=hypothesis, units=units)


def _dropped(numbers: Numbers) -> Iterator[FileHypothesis]:
    """Yield groups of numbers that an engine may ignore, each as if it were zero."""
    numerals = numbers.numerals
    groups: dict[tuple[int, ...], str] = {}
    for name, group in _groups(numbers):
        nonzero = tuple(i for i in group if numerals[i].value)
        if len(nonzero) > 1:  # a single number is a hypothesis already
            groups.setdefault(nonzero, name)
    for chosen, name in groups.items():
        elements = tuple(dict.fromkeys(numerals[i].address.split("@")[0] for i in chosen))
        several = (f"{name} of {len(elements)} elements",)
        subject = _named(elements, name) if len(elements) <= MAX_NAMED_ELEMENTS else several
        cause = CauseId(kind="dropped", subject=subject)
        units = {i: -numerals[i].value for i in chosen}
        yield _switch(numbers, cause, units, rank("default"))


def _named(elements: Sequence[str], name: str) -> tuple[str, ...]:
    return tuple(f"{name} of {element}" for element in elements)


def _groups(numbers: Numbers) -> Iterator[tuple[str, list[int]]]:
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
    """Return the mass stated with moments of inertia."""
    inertial = number.element.parent
    masses = [] if inertial is None else [m for m in inertial.children if m.tag == "mass"]
    try:
        return float(masses[0].attributes["value"]) if masses else None
    except (KeyError, ValueError):
        return None


def _line(number: Number) -> SourceLine:
    return SourceLine(file=number.file.name, line=number.line, span=number.span, text=number.text)
