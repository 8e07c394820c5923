"""Links and joints of an SDFormat model, with their parents."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import quote
from physics_crosscheck.harness.documents.sdf import MODEL, WORLD, child_of, is_automatic
from physics_crosscheck.harness.modelfiles.couplings import MimicLeader, acyclic
from physics_crosscheck.harness.modelfiles.document import Document
from physics_crosscheck.harness.modelfiles.sdf.frames import SdfFrames, inverse, read_pose
from physics_crosscheck.harness.modelfiles.sdf.shapes import automatic_inertia
from physics_crosscheck.reference.mechanism.bodies import Joint, RigidBody, Triple
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import to_quaternion
from physics_crosscheck.reference.mechanism.tree import Kind

KINDS: Mapping[str, Kind | None] = MappingProxyType(
    {"revolute": "hinge", "continuous": "hinge", "prismatic": "slide", "fixed": None}
)
"""The kind of joint in a tree; None for a fixed joint."""

ENDLESS = 1e16
"""The format's value for a missing bound, rad or m."""

_TENSOR = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
_UNIT = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)
"""Default inertia, kg m^2."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SdfLink:
    """A link: its element, and its body, which has no parent yet."""

    element: XmlElement
    body: RigidBody


@dataclass(frozen=True, kw_only=True, eq=False)
class SdfJoint:
    """A joint.

    Attributes:
        kind: None for a fixed joint.
        parent, child: names of links, or `world`.
        joint: in its child's frame; None for a fixed joint.
    """

    name: str
    element: XmlElement
    kind: Kind | None
    parent: str
    child: str
    joint: Joint | None


def read_links(document: Document, frames: SdfFrames) -> dict[str, SdfLink]:
    """Return the links by name; problems are noted in the document."""
    return {
        name: SdfLink(element=element, body=_body(document, frames, element, name))
        for name, element in frames.tagged("link").items()
    }


def _body(document: Document, frames: SdfFrames, link: XmlElement, name: str) -> RigidBody:
    """Return the body of a link: 1 kg and 1 kg m^2 by default."""
    inertial = document.child(link, "inertial")
    falls = document.child(link, "gravity")
    lift = 1.0 if falls is not None and falls.text.strip().lower() in ("0", "false") else 0.0
    if inertial is not None and is_automatic(inertial):
        spatial_inertia = automatic_inertia(document, frames, link, inertial, name)
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = spatial_inertia.inertia.tolist()
        return RigidBody(
            name=name,
            parent=None,
            mass=spatial_inertia.mass,
            center=_triple(spatial_inertia.center),
            inertia=(xx, yy, zz, xy, xz, yz),
            lift=lift,
        )
    return _stated_body(document, inertial, name, lift)


def _stated_body(
    document: Document, inertial: XmlElement | None, name: str, lift: float
) -> RigidBody:
    """Return the body of an `<inertial>` that states its numbers, or of None."""
    what = f"link {quote(name)}"
    mass = None if inertial is None else document.child(inertial, "mass")
    inertia = None if inertial is None else document.child(inertial, "inertia")
    place = (
        None if inertial is None else read_pose(document, inertial, f"<inertial> of {what}").place
    )
    (weight,) = document.text_numbers(mass, (1.0,), what)
    tensor: list[float] = []
    for key, default in zip(_TENSOR, _UNIT, strict=True):
        element = None if inertia is None else document.child(inertia, key)
        tensor += document.text_numbers(element, (default,), what)
    xx, yy, zz, xy, xz, yz = tensor
    body = RigidBody(
        name=name, parent=None, mass=weight, inertia=(xx, yy, zz, xy, xz, yz), lift=lift
    )
    if place is None:
        return body
    return replace(
        body, center=_triple(place.origin), inertia_quaternion=to_quaternion(place.rotation)
    )


def read_joints(document: Document, frames: SdfFrames) -> dict[str, SdfJoint]:
    """Return the joints by name; problems are noted in the document."""
    return {
        name: _joint(document, frames, element, name)
        for name, element in frames.tagged("joint").items()
    }


def _joint(document: Document, frames: SdfFrames, element: XmlElement, name: str) -> SdfJoint:
    kind, what = element.attributes.get("type", ""), f"joint {quote(name)}"
    if kind not in KINDS:
        document.add_problem(
            element,
            f"{what} is of type {quote(kind)}, which is not covered",
            f"types are {', '.join(KINDS)}",
            "unsupported",
        )
    parents = (one.text.strip() for one in element.children if one.tag == "parent")
    ends = {"parent": next(parents, ""), "child": child_of(element)}
    links = {tag: frames.link(end) for tag, end in ends.items()}
    for tag, link in links.items():
        if not link or (tag, link) == ("child", WORLD):
            document.add_problem(
                element,
                f"the {tag} of {what} is {quote(ends[tag])}, which is not a link",
                "declare the link, or correct its name",
            )
    of_tree = KINDS.get(kind)
    is_valid = of_tree is not None and links["child"] not in ("", WORLD)
    return SdfJoint(
        name=name,
        element=element,
        kind=of_tree,
        parent=links["parent"],
        child=links["child"],
        joint=_moving(document, frames, element, name, of_tree, links["child"])
        if of_tree is not None and is_valid
        else None,
    )


def _moving(
    document: Document, frames: SdfFrames, element: XmlElement, name: str, kind: Kind, child: str
) -> Joint:
    """Return a joint with anchor and axis in the child link's frame."""
    what, axis = f"joint {quote(name)}", document.child(element, "axis")
    xyz = None if axis is None else document.child(axis, "xyz")
    direction = np.array(document.text_numbers(xyz, (0.0, 0.0, 1.0), what))
    inward = inverse(frames.place(child))
    frame = _expressed_in(document, axis, xyz) or name
    direction = inward.rotation @ frames.place(frame).rotation @ direction
    if not direction.any():
        document.add_problem(
            xyz or element, f"the axis of {what} has no length", "give a direction"
        )
        direction = np.array([0.0, 0.0, 1.0])
    dynamics = None if axis is None else document.child(axis, "dynamics")
    number = {
        key: document.text_numbers(
            None if dynamics is None else document.child(dynamics, key), (0.0,), what
        )[0]
        for key in ("damping", "spring_stiffness", "spring_reference")
    }
    return Joint(
        name=name,
        kind=kind,
        axis=_triple(direction),
        at=_triple(inward.compose(frames.place(name)).origin),
        damping=number["damping"],
        stiffness=number["spring_stiffness"],
        rest=number["spring_reference"],
        limits=_bounds(document, element, axis),
    )


def _expressed_in(document: Document, axis: XmlElement | None, xyz: XmlElement | None) -> str:
    """Return the frame of an axis: in versions to 1.4 the model's; empty for the joint's own."""
    if xyz is not None and xyz.attributes.get("expressed_in"):
        return xyz.attributes["expressed_in"]
    flag = None if axis is None else document.child(axis, "use_parent_model_frame")
    if flag is not None:
        return MODEL if flag.text.strip().lower() in ("1", "true") else ""
    return MODEL if version(document) <= (1, 4) else ""


def version(document: Document) -> tuple[int, ...]:
    """Return the format's version, such as (1, 7); the newest if it is not stated."""
    words = document.root.attributes.get("version", "").split(".")
    return tuple(map(int, words)) if all(word.isdigit() for word in words) else (2,)


def _bounds(
    document: Document, joint: XmlElement, axis: XmlElement | None
) -> tuple[float, float] | None:
    limit = None if axis is None else document.child(axis, "limit")
    if limit is None or joint.attributes.get("type") == "continuous":
        return None
    ends = []
    for tag, sign in (("lower", -1.0), ("upper", 1.0)):
        element = document.child(limit, tag)
        endless = element is None or element.text.strip().lower().lstrip("+-") in ("", "inf")
        bound = sign * ENDLESS if endless else document.text_numbers(element, (0.0,), tag)[0]
        ends.append(sign * np.inf if abs(bound) >= ENDLESS else bound)
    lower, upper = ends
    return None if lower > upper or np.isinf(ends).all() else (lower, upper)


def read_mimics(document: Document, joints: Mapping[str, SdfJoint]) -> dict[str, MimicLeader]:
    """Return joints that follow others, by name, if a velocity constraint can enforce them."""
    mimics: dict[str, MimicLeader] = {}
    for name, joint in joints.items():
        axis = document.child(joint.element, "axis")
        mimic = None if axis is None else document.child(axis, "mimic")
        if mimic is None or joint.joint is None:
            continue
        what = f"<mimic> of joint {quote(name)}"
        ratio, offset, reference = (
            document.text_numbers(document.child(mimic, tag), (default,), what)[0]
            for tag, default in (("multiplier", 1.0), ("offset", 0.0), ("reference", 0.0))
        )
        leader = joints.get(mimic.attributes.get("joint", ""))
        single = leader is not None and leader.joint is not None
        if leader is not None and single and ratio and offset == ratio * reference:
            mimics[name] = MimicLeader(leader.name, ratio)
    return acyclic(mimics)


def bodies_of(
    frames: SdfFrames,
    root: str,
    links: Mapping[str, SdfLink],
    joints: Mapping[str, SdfJoint],
    still: Collection[str],
) -> Iterator[RigidBody]:
    """Yield bodies depth first; a floating root counts from the world, not from its drawn pose."""
    below: dict[str, list[SdfJoint]] = {}
    for joint in joints.values():
        below.setdefault(joint.parent, []).append(joint)
    if root != WORLD:
        name = root
        while name in joints:
            name += "_free"
        yield replace(links[root].body, joints=(Joint(name=name, kind="free"),))
    waiting = list(reversed(below.get(root, [])))
    while waiting:
        joint = waiting.pop()
        place = inverse(frames.place(joint.parent)).compose(frames.place(joint.child))
        if joint.parent == WORLD:
            place = frames.of_model().compose(frames.place(joint.child))
        moving = joint.joint is not None and joint.name not in still
        yield replace(
            links[joint.child].body,
            parent=None if joint.parent == WORLD else joint.parent,
            position=_triple(place.origin),
            quaternion=to_quaternion(place.rotation),
            joints=(joint.joint,) if moving and joint.joint is not None else (),
        )
        waiting += reversed(below.get(joint.child, []))


def _triple(vector: Array) -> Triple:
    x, y, z = map(float, vector)
    return x, y, z
