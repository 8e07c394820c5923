"""The joints of an MJCF, by its own words: named as they are here, with what its defaults add."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterator
from dataclasses import dataclass

from physics_crosscheck.harness.engines.mjcf_defaults import (
    Attributes,
    Defaults,
    bodies_of,
    number_of,
    numbers_of,
)
from physics_crosscheck.harness.engines.mjcf_source import MjcfSource

FREE, BALL, SLIDE, HINGE = "free", "ball", "slide", "hinge"

JOINTS = ("joint", "freejoint")


@dataclass(frozen=True, kw_only=True)
class MjcfJoint:
    """A joint of a file.

    Attributes:
        element: of the file.
        body: that it moves.
        name: its own, or `joint_0`, ... by its place among all.
        kind: free, ball, slide or hinge.
        ref: its position where the file draws it, m or rad.
        limits: between which it is said to be; infinite where nothing is.
        stiffness, rest: of its spring, N/m or N m/rad, m or rad.
        damping, armature: N s/m or N m s/rad, kg or kg m^2.
        friction: dry, N or N m.
    """

    element: ET.Element
    body: ET.Element
    name: str
    kind: str
    ref: float
    limits: tuple[float, float]
    stiffness: float
    rest: float
    damping: float
    armature: float
    friction: float


def joints_of(source: MjcfSource, defaults: Defaults) -> tuple[MjcfJoint, ...]:
    """All joints, in the order of their bodies.

    Raises:
        EngineError: naming file and line.
    """
    rows = [
        (one, body, inherited)
        for body, inherited in bodies_of(source)
        for one in body
        if one.tag in JOINTS
    ]
    found = [_joint(source, defaults, i, *row) for i, row in enumerate(rows)]
    names: set[str] = set()
    for one in found:
        if one.name in names:
            raise source.refused(one.element, f"a second joint is called {one.name!r}")
        names.add(one.name)
    return tuple(found)


def _joint(
    source: MjcfSource,
    defaults: Defaults,
    i: int,
    element: ET.Element,
    body: ET.Element,
    inherited: str,
) -> MjcfJoint:
    free = element.tag == "freejoint"
    said = element.attrib if free else defaults.of(element, inherited)
    kind = FREE if free else said.get("type", HINGE)
    turn = 1.0 if kind != HINGE or _radians(source) else math.pi / 180
    if "springdamper" in said and any(numbers_of(source, element, said, "springdamper", "0 0")):
        raise source.unsupported(
            element, "springdamper (a spring with a time constant) is not supported"
        )

    def one(key: str) -> float:
        return number_of(source, element, said, key)

    return MjcfJoint(
        element=element,
        body=body,
        name=element.get("name") or f"joint_{i}",
        kind=kind,
        ref=one("ref") * turn,
        limits=_limits(source, element, said, turn),
        stiffness=one("stiffness"),
        rest=one("springref") * turn,
        damping=0.0 if source.disabled("damper") else one("damping"),
        armature=one("armature"),
        friction=one("frictionloss"),
    )


def _radians(source: MjcfSource) -> bool:
    return source.stated("compiler", "angle") == "radian"


def _limits(
    source: MjcfSource, element: ET.Element, said: Attributes, turn: float
) -> tuple[float, float]:
    """None where the lower is above the upper, or nothing switches them on."""
    automatic = source.stated("compiler", "autolimits", "true") == "true"
    limited = said.get("limited", "auto")
    on = limited == "true" or (limited == "auto" and automatic and "range" in said)
    if not on or source.disabled("limit", "constraint"):
        return -math.inf, math.inf
    numbers = numbers_of(source, element, said, "range", "0 0")
    if len(numbers) != 2:
        raise source.refused(element, f"<joint range> is {said['range']!r}; expected two numbers")
    lower, upper = (number * turn for number in numbers)
    return (lower, upper) if lower < upper else (-math.inf, math.inf)


def rows_of(joints: Collection[MjcfJoint]) -> Iterator[tuple[ET.Element, list[MjcfJoint]]]:
    """Bodies with the joints that each has."""
    bodies = list(dict.fromkeys(one.body for one in joints))
    for body in bodies:
        yield body, [one for one in joints if one.body is body]
