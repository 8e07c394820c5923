"""What a URDF says beyond bodies and joints, counted by its kind."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from types import MappingProxyType

from physics_crosscheck.harness.modelfiles.document import Document, read_numbers
from physics_crosscheck.harness.modelfiles.left_out import FREE_MIMIC, Told, tallied
from physics_crosscheck.harness.modelfiles.locations.xml import RawElement
from physics_crosscheck.harness.modelfiles.robot import LeftOut
from physics_crosscheck.harness.modelfiles.urdf.parts import UrdfJoint

_LOOKS = ("visual", "material")
_READ: Mapping[str, Collection[str]] = MappingProxyType(
    {
        "robot": ("link", "joint", "gazebo"),
        "link": ("inertial", "collision"),
        "inertial": ("origin", "mass", "inertia"),
        "joint": ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic"),
        "gazebo": ("springStiffness", "springReference"),
        **dict.fromkeys(("origin", "mass", "inertia", "parent", "child", "axis"), ()),
        **dict.fromkeys(("limit", "dynamics", "mimic"), ()),
    }
)
"""What is read of an element, here or there, and of whose children the rest is told."""

_SAID: Mapping[str, Collection[str]] = MappingProxyType(
    {
        "robot": ("name", "version"),
        "link": ("name", "type"),
        "joint": ("name", "type"),
        "inertial": (),
        "parent": ("link",),
        "child": ("link",),
        "mimic": ("joint", "multiplier", "offset"),
        "origin": ("xyz", "rpy"),
        "mass": ("value",),
        "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
        "axis": ("xyz",),
        "dynamics": ("damping", "friction"),
        "limit": ("lower", "upper", "effort", "velocity"),
    }
)
"""Attributes that have a meaning."""


def urdf_left_out(
    document: Document,
    joints: Mapping[str, UrdfJoint],
    springs: Collection[str],
    followers: Collection[str],
) -> tuple[LeftOut, ...]:
    """All of it; looks are no loss, and are not told.

    Args:
        document: the file.
        joints: that were read.
        springs: names of the joints that springs are told of.
        followers: names of the joints whose mimics are held.
    """
    return tallied(_all(document, joints, springs), followers)


def _all(
    document: Document, joints: Mapping[str, UrdfJoint], springs: Collection[str]
) -> Iterator[Told]:
    for joint in joints.values():
        yield from _of_joint(document, joint)
    for name in springs:
        if name not in joints or joints[name].kind not in ("hinge", "slide"):
            yield "spring of a joint that is neither hinge nor slide", name
    yield from _unread(document.root, "")
    yield from _unsaid(document.root, "")
    for element in document.root.children:
        name = element.attributes.get("name", element.attributes.get("reference", ""))
        yield from _unread(element, name)
        if element.tag in ("link", "joint"):
            yield from _unsaid(element, name)
            yield from _of_parts(element, name)


def _of_parts(element: RawElement, name: str) -> Iterator[Told]:
    """What is within a link or a joint."""
    if any(part.tag == "collision" for part in element.children):
        yield "collision geometry", name
    for part in element.children:
        if part.tag not in (*_LOOKS, "collision"):
            for inner in (part, *part.children):
                yield from _unread(inner, name)
                yield from _unsaid(inner, name)


def _of_joint(document: Document, joint: UrdfJoint) -> Iterator[Told]:
    dynamics, limit = (document.child(joint.element, tag) for tag in ("dynamics", "limit"))
    if joint.kind is None:
        return
    if dynamics is not None and _nonzero(dynamics, "friction"):
        yield "dry friction", joint.name
    if joint.damping and joint.kind == "free":
        yield "damping of a floating joint", joint.name
    if document.child(joint.element, "mimic") is not None:
        yield FREE_MIMIC, joint.name
    if limit is not None:
        yield from _of_limit(limit, joint)


def _of_limit(limit: RawElement, joint: UrdfJoint) -> Iterator[Told]:
    if any(map(_holds, joint.bounds)):
        yield "limits of position", joint.name
    for key in ("lower", "upper"):
        if key in limit.attributes and read_numbers(limit.attributes[key], 1) is None:
            yield f"limit that is not a number: {key}", joint.name
    for key in ("effort", "velocity"):
        if _nonzero(limit, key):
            yield f"limits of {key}", joint.name


def _holds(bound: float) -> bool:
    return abs(bound) != float("inf")


def _nonzero(element: RawElement, key: str) -> bool:
    """Whether an attribute says anything but zero."""
    text = element.attributes.get(key, "0")
    return read_numbers(text, 1) != (0.0,)


def _unread(element: RawElement, name: str) -> Iterator[Told]:
    """Elements within this one that mean nothing here."""
    known = _READ.get(element.tag)
    if known is None or (element.tag == "robot" and element.parent is not None):
        return
    for child in element.children:
        if child.tag not in known and child.tag not in _LOOKS:
            within = "" if element.tag == "robot" else f" of <{element.tag}>"
            yield f"<{child.tag}>{within}", name or child.attributes.get("name", "")


def _unsaid(element: RawElement, name: str) -> Iterator[Told]:
    """Yield the attributes of an element that mean nothing."""
    for key in element.attributes if element.tag in _SAID else ():
        if key not in _SAID[element.tag] and not key.startswith("xmlns"):
            yield f"{key} of <{element.tag}>", name
