"""A URDF as a tree of bodies, with omissions and problems.

Content of a URDF beyond bodies and joints, counted by kind.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from physics_crosscheck.harness.documents.document import Document, read_numbers
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import LocationError, ReadError
from physics_crosscheck.harness.documents.tree import GRAVITY
from physics_crosscheck.harness.documents.urdf import (
    ENDLESS,
    SINGLE,
    UrdfFile,
    UrdfJoint,
    read_urdf,
)
from physics_crosscheck.reference.mechanism.bodies import ZERO, Joint, RigidBody
from ..build_tree import build_robot, enforceable
from ..robot import FREE_MIMIC, Note, Omission, Robot, count_notes, refused

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


def read_urdf_robot(
    path: Path,
    *,
    floating: bool = False,
    armatures: Mapping[str, float] = MappingProxyType({}),
) -> Robot:
    """Read a URDF completely.

    `<origin>` gives a joint's frame in the parent link's; its rpy rotates about the fixed axes x, y
    and z in that order. The child's frame is the joint's, moved along or about the direction of
    `<axis>`. Links on fixed joints form one body. Missing numbers are zero: no mass, no damping, no
    rotation. The default axis is x.

    Args:
        path: of the file.
        floating: whether the root link moves freely, on a free joint with its name; otherwise it is
            fixed to the world, like a link named `world`. Without joints, a root with mass is free.
        armatures: as in `Document`.
    """
    try:
        document = Document(path)
    except LocationError as error:
        return refused(path, path.stem, [ReadError.unreadable(error, path)])
    document.armatures = armatures
    with np.errstate(all="ignore"):  # overflow is reported
        return _read(document, floating)


def _read(document: Document, floating: bool) -> Robot:
    file = read_urdf(document)
    mimics = enforceable(file.mimics, singles(file.joints))
    left_out = urdf_left_out(file, mimics)
    if not any(joint.kind for joint in file.joints.values()):
        # Its root is all that can move, unless it is a scene that engines fix.
        has_mass = any(link.body.mass for link in file.links.values())
        floating = floating or (file.can_float and has_mass)
    if floating and not file.can_float:
        floating = False
        left_out += (Omission(what="a free joint of the world", count=1, where=(file.root,)),)
    return build_robot(
        document,
        name=document.root.get("name") or document.path.stem,
        links=file.links,
        joints=file.joints,
        mimics=mimics,
        bodies_with=lambda still: bodies_of(file, floating, still),
        left_out=left_out,
        gravity=GRAVITY,
        floats=floating,
    )


def singles(joints: Mapping[str, UrdfJoint]) -> set[str]:
    """Return the names of slides and hinges."""
    return {name for name, joint in joints.items() if joint.kind in SINGLE}


def bodies_of(file: UrdfFile, floating: bool, still: Collection[str]) -> tuple[RigidBody, ...]:
    """Return the links as bodies with springs, depth first; joints of one link in the file's order.

    Args:
        file: the content of the file.
        floating: whether the root link moves freely.
        still: joints that are fixed at their drawn positions.
    """
    return tuple(_bodies(file, floating, still))


def _bodies(file: UrdfFile, floating: bool, still: Collection[str]) -> Iterator[RigidBody]:
    below: dict[str, list[UrdfJoint]] = {}
    for joint in file.joints.values():
        below.setdefault(joint.parent, []).append(joint)
    yield body_of(file, file.root, None, floating, still)
    waiting = list(reversed(below.get(file.root, [])))
    while waiting:
        joint = waiting.pop()
        yield body_of(file, joint.child, joint, floating, still)
        waiting += reversed(below.get(joint.child, []))


def body_of(
    file: UrdfFile, link: str, joint: UrdfJoint | None, floating: bool, still: Collection[str]
) -> RigidBody:
    """Return a link as a body, on its joint; arguments as in `bodies_of`."""
    body = file.links[link].body
    if joint is None:
        return replace(body, joints=(Joint(name=file.base, kind="free"),) if floating else ())
    moves = joint.kind is not None and joint.name not in still
    # A free body next to a fixed root counts from the world, as in engines.
    loose = moves and joint.kind == "free" and joint.parent == file.root and not floating
    return replace(
        body,
        parent=joint.parent,
        position=ZERO if loose else joint.origin,
        rpy=ZERO if loose else joint.rpy,
        joints=(_joint(file, joint),) if moves else (),
    )


def _joint(file: UrdfFile, joint: UrdfJoint) -> Joint:
    """Return the joint of a body, with its spring."""
    assert joint.kind is not None  # it moves
    stiffness, rest = file.springs.get(joint.name, (0.0, 0.0))
    return Joint(
        name=joint.name,
        kind=joint.kind,
        axis=joint.axis,
        damping=0.0 if joint.kind == "free" else joint.damping,
        stiffness=stiffness,
        rest=rest,
        limits=None if joint.bounds == ENDLESS else joint.bounds,
        armature=file.document.armatures.get(joint.name, 0.0),
    )
