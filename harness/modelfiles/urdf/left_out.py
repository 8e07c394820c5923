"""Content of a URDF beyond bodies and joints, counted by kind."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from types import MappingProxyType

from physics_crosscheck.harness.documents.document import read_numbers
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.urdf import UrdfFile, UrdfJoint
from physics_crosscheck.harness.modelfiles.robot import FREE_MIMIC, Note, Omission, count_notes

_VISUALS = ("visual", "material")
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
"""The child elements that are read, by tag; the other children of these elements are reported."""

_MEANINGFUL_ATTRIBUTES: Mapping[str, Collection[str]] = MappingProxyType(
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
"""Attributes with a meaning."""


def urdf_left_out(file: UrdfFile, followers: Collection[str]) -> tuple[Omission, ...]:
    """Return all of it, except visual geometry, which does not matter.

    Args:
        file: the content of the file.
        followers: names of the joints whose mimics are enforced.
    """
    return count_notes(_all(file), followers)


def _all(file: UrdfFile) -> Iterator[Note]:
    for joint in file.joints.values():
        yield from _of_joint(joint, file.mimics)
    document = file.document
    yield from _unread(document.root, "")
    yield from _unknown_attributes(document.root, "")
    for element in document.root.children:
        name = element.attributes.get("name", element.attributes.get("reference", ""))
        yield from _unread(element, name)
        if element.tag in ("link", "joint"):
            yield from _unknown_attributes(element, name)
            yield from _of_parts(element, name)


def _of_parts(element: XmlElement, name: str) -> Iterator[Note]:
    """Yield the omitted content of a link or a joint."""
    if any(part.tag == "collision" for part in element.children):
        yield "collision geometry", name
    for part in element.children:
        if part.tag not in (*_VISUALS, "collision"):
            for inner in (part, *part.children):
                yield from _unread(inner, name)
                yield from _unknown_attributes(inner, name)


def _of_joint(joint: UrdfJoint, mimics: Collection[str]) -> Iterator[Note]:
    limit = joint.element.find("limit")
    if joint.kind is None:
        return
    if joint.friction:
        yield "dry friction", joint.name
    if joint.damping and joint.kind == "free":
        yield "damping of a floating joint", joint.name
    if joint.name in mimics:
        yield FREE_MIMIC, joint.name
    if any(abs(bound) != float("inf") for bound in joint.bounds):
        yield "limits of position", joint.name
    for key in ("effort", "velocity"):
        if limit is not None and _nonzero(limit, key):
            yield f"limits of {key}", joint.name


def _nonzero(element: XmlElement, key: str) -> bool:
    """Return whether an attribute differs from zero."""
    text = element.attributes.get(key, "0")
    return read_numbers(text, 1) != (0.0,)


def _unread(element: XmlElement, name: str) -> Iterator[Note]:
    """Yield child elements that have no meaning here."""
    readable = _READ.get(element.tag)
    if readable is None or (element.tag == "robot" and element.parent is not None):
        return
    for child in element.children:
        if child.tag not in readable and child.tag not in _VISUALS:
            within = "" if element.tag == "robot" else f" of <{element.tag}>"
            yield f"<{child.tag}>{within}", name or child.attributes.get("name", "")


def _unknown_attributes(element: XmlElement, name: str) -> Iterator[Note]:
    """Yield the attributes of an element that have no meaning."""
    for key in element.attributes if element.tag in _MEANINGFUL_ATTRIBUTES else ():
        if key not in _MEANINGFUL_ATTRIBUTES[element.tag] and not key.startswith("xmlns"):
            yield f"{key} of <{element.tag}>", name
