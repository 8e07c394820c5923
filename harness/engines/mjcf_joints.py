"""The joints of an MJCF, with their defaults; unnamed joints get a name."""

import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass

from physics_crosscheck.harness.documents.elements import XmlElement
from .mjcf_defaults import Attributes, Defaults, bodies_of, number_of, numbers_of
from .mjcf_source import MjcfSource

FREE, BALL, SLIDE, HINGE = "free", "ball", "slide", "hinge"

JOINTS = ("joint", "freejoint")


@dataclass(frozen=True, kw_only=True)
class MjcfJoint:
    """A joint of a file.

    Attributes:
        element: of the file.
        body: that it moves.
        name: its own, or `joint_0`, ... by its index.
        kind: free, ball, slide or hinge.
        ref: its position in the drawn configuration, m or rad.
        limits: lower and upper; infinite without limits.
        stiffness, rest: of its spring, N/m or N m/rad, m or rad.
        damping, armature: N s/m or N m s/rad, kg or kg m^2.
        friction: dry, N or N m.
    """

    element: XmlElement
    body: XmlElement
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
    """Return all joints, in the order of their bodies.

    Raises:
        EngineError: naming file and line.
    """
    rows = [
        (joint, body, inherited)
        for body, inherited in bodies_of(source)
        for joint in body
        if joint.tag in JOINTS
    ]
    joints = [_joint(source, defaults, i, *row) for i, row in enumerate(rows)]
    names: set[str] = set()
    for joint in joints:
        if joint.name in names:
            raise source.refused(joint.element, f"a second joint is called {joint.name!r}")
        names.add(joint.name)
    return tuple(joints)


def _joint(
    source: MjcfSource,
    defaults: Defaults,
    i: int,
    element: XmlElement,
    body: XmlElement,
    inherited: str,
) -> MjcfJoint:
    free = element.tag == "freejoint"
    attributes = element.attributes if free else defaults.attributes(element, inherited)
    kind = FREE if free else attributes.get("type", HINGE)
    turn = 1.0 if kind != HINGE else source.angle_unit
    if "springdamper" in attributes and any(
        numbers_of(source, element, attributes, "springdamper", "0 0")
    ):
        raise source.unsupported(
            element, "springdamper (a spring with a time constant) is not supported"
        )

    def number(key: str) -> float:
        return number_of(source, element, attributes, key)

    return MjcfJoint(
        element=element,
        body=body,
        name=element.get("name") or f"joint_{i}",
        kind=kind,
        ref=number("ref") * turn,
        limits=_limits(source, element, attributes, turn),
        stiffness=0.0 if source.disabled("spring") else number("stiffness"),
        rest=number("springref") * turn,
        damping=0.0 if source.disabled("damper") else number("damping"),
        armature=number("armature"),
        friction=number("frictionloss"),
    )


def _limits(
    source: MjcfSource, element: XmlElement, attributes: Attributes, turn: float
) -> tuple[float, float]:
    """Return infinite limits if lower is above upper or no attribute enables them."""
    automatic = source.stated("compiler", "autolimits", "true") == "true"
    limited = attributes.get("limited", "auto")
    on = limited == "true" or (limited == "auto" and automatic and "range" in attributes)
    if not on or source.disabled("limit", "constraint"):
        return -math.inf, math.inf
    numbers = numbers_of(source, element, attributes, "range", "0 0")
    if len(numbers) != 2:
        raise source.refused(
            element, f"<joint range> is {attributes['range']!r}; expected two numbers"
        )
    lower, upper = (number * turn for number in numbers)
    return (lower, upper) if lower < upper else (-math.inf, math.inf)


def rows_of(joints: Collection[MjcfJoint]) -> Iterator[tuple[XmlElement, list[MjcfJoint]]]:
    """Yield bodies with the joints of each."""
    bodies = list(dict.fromkeys(one.body for one in joints))
    for body in bodies:
        yield body, [one for one in joints if one.body is body]
