"""What an SDFormat model says beyond bodies and joints, counted by its kind."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from types import MappingProxyType

from harness.files.locations.xml import RawElement
from harness.robots.document import Document, read_numbers
from harness.robots.left_out import FREE_MIMIC, Told, tallied
from harness.robots.robot import LeftOut
from harness.robots.sdf_parts import SdfJoint

_READ: Mapping[str, Collection[str]] = MappingProxyType(
    {
        "model": ("link", "joint", "frame", "pose", "static", "self_collide"),
        "link": ("inertial", "pose", "collision", "gravity", "self_collide"),
        "inertial": ("pose", "mass", "inertia"),
        "joint": ("pose", "parent", "child", "axis"),
        "axis": ("xyz", "dynamics", "limit", "mimic", "use_parent_model_frame"),
        "dynamics": ("damping", "friction", "spring_stiffness", "spring_reference"),
        "limit": ("lower", "upper", "effort", "velocity"),
    }
)
"""What is read of an element, here or there, and of whose children the rest is told."""

_LOOKS = ("visual", "material", "light")


def sdf_left_out(
    document: Document,
    model: RawElement,
    joints: Mapping[str, SdfJoint],
    followers: Collection[str],
) -> tuple[LeftOut, ...]:
    """All of it; looks are no loss, and are not told."""
    return tallied(_all(document, model, joints), followers)


def _all(document: Document, model: RawElement, joints: Mapping[str, SdfJoint]) -> Iterator[Told]:
    for joint in joints.values():
        yield from _of_joint(document, joint)
    for element in model.children:
        name = element.attributes.get("name", "")
        if any(part.tag == "collision" for part in element.children):
            yield "collision geometry", name
    yield from _unread(model, "")


def _of_joint(document: Document, joint: SdfJoint) -> Iterator[Told]:
    axis = document.child(joint.element, "axis")
    if axis is None or joint.joint is None:
        return
    dynamics, limit = document.child(axis, "dynamics"), document.child(axis, "limit")
    if _number(document, dynamics, "friction"):
        yield "dry friction", joint.name
    if document.child(axis, "mimic") is not None:
        yield FREE_MIMIC, joint.name
    if joint.joint.limits is not None:
        yield "limits of position", joint.name
    for key in ("effort", "velocity"):
        if _number(document, limit, key) > 0:
            yield f"limits of {key}", joint.name


def _number(document: Document, holder: RawElement | None, key: str) -> float:
    element = None if holder is None else document.child(holder, key)
    found = None if element is None else read_numbers(element.text, 1)
    return 0.0 if found is None else found[0]


def _unread(element: RawElement, name: str) -> Iterator[Told]:
    """Elements within this one that mean nothing here."""
    known = _READ.get(element.tag)
    if known is None:
        return
    for child in element.children:
        if child.tag in _LOOKS:
            continue
        own = name or child.attributes.get("name", "")
        if child.tag not in known:
            yield f"<{child.tag}> of <{element.tag}>", own
        else:
            yield from _unread(child, own)
