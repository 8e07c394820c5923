"""Links and joints of an SDFormat model, as bodies that know what they hang from."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from physics_crosscheck.harness.engines.sdf_shapes import is_automatic
from physics_crosscheck.harness.modelfiles.couplings import Mimic, acyclic
from physics_crosscheck.harness.modelfiles.document import Document
from physics_crosscheck.harness.modelfiles.locations.xml import RawElement
from physics_crosscheck.harness.modelfiles.quote import brief
from physics_crosscheck.harness.modelfiles.sdf.frames import (
    MODEL,
    WORLD,
    Frames,
    child_of,
    inverse,
    read_pose,
)
from physics_crosscheck.harness.modelfiles.sdf.shapes import automatic_lump
from physics_crosscheck.reference.mechanism.bodies import Joint, Quaternion, RigidBody, Triple
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.tree import Kind

KINDS: Mapping[str, Kind | None] = MappingProxyType(
    {"revolute": "hinge", "continuous": "hinge", "prismatic": "slide", "fixed": None}
)
"""What a joint's type is in a tree; nothing of what is welded."""

ENDLESS = 1e16
"""A bound that is none: the format's own, rad or m."""

_TENSOR = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
_UNIT = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)
"""kg m^2 where a file tells none."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SdfLink:
    """A link: its element, and its body, which hangs from nothing yet."""

    element: RawElement
    body: RigidBody


@dataclass(frozen=True, kw_only=True, eq=False)
class SdfJoint:
    """A joint.

    Attributes:
        kind: None of a fixed one.
        parent, child: names of links, or `world`.
        joint: as its child has it; None of a fixed one.
    """

    name: str
    element: RawElement
    kind: Kind | None
    parent: str
    child: str
    joint: Joint | None


def read_links(document: Document, frames: Frames) -> dict[str, SdfLink]:
    """The links by their names; what is wrong with them is noted in the document."""
    return {
        name: SdfLink(element=element, body=_body(document, frames, element, name))
        for name, element in frames.of("link").items()
    }


def _body(document: Document, frames: Frames, link: RawElement, name: str) -> RigidBody:
    """Return the body of a link: 1 kg and 1 kg m^2 where a file states nothing else."""
    told = document.child(link, "inertial")
    falls = document.child(link, "gravity")
    lift = 1.0 if falls is not None and falls.text.strip().lower() in ("0", "false") else 0.0
    if told is not None and is_automatic(told.attributes.get("auto")):
        lump = automatic_lump(document, frames, link, told, name)
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = lump.inertia.tolist()
        return RigidBody(
            name=name,
            parent=None,
            mass=lump.mass,
            center=_triple(lump.center),
            inertia=(xx, yy, zz, xy, xz, yz),
            lift=lift,
        )
    return _stated_body(document, told, name, lift)


def _stated_body(document: Document, told: RawElement | None, name: str, lift: float) -> RigidBody:
    """Return the body of an `<inertial>` that states its numbers, or of none."""
    what = f"link {brief(name)}"
    mass = None if told is None else document.child(told, "mass")
    inertia = None if told is None else document.child(told, "inertia")
    place = None if told is None else read_pose(document, told, f"<inertial> of {what}").place
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
    return replace(body, center=_triple(place.origin), inertia_quaternion=_turn(place.rotation))


def read_joints(document: Document, frames: Frames) -> dict[str, SdfJoint]:
    """The joints by their names; what is wrong with them is noted in the document."""
    return {
        name: _joint(document, frames, element, name)
        for name, element in frames.of("joint").items()
    }


def _joint(document: Document, frames: Frames, element: RawElement, name: str) -> SdfJoint:
    kind, what = element.attributes.get("type", ""), f"joint {brief(name)}"
    if kind not in KINDS:
        document.hinder(
            element,
            f"{what} is of type {brief(kind)}, which is not covered",
            f"types are {', '.join(KINDS)}",
            "unsupported",
        )
    parents = (one.text.strip() for one in element.children if one.tag == "parent")
    ends = {"parent": next(parents, ""), "child": child_of(element)}
    links = {tag: frames.link(end) for tag, end in ends.items()}
    for tag, link in links.items():
        if not link or (tag, link) == ("child", WORLD):
            document.hinder(
                element,
                f"the {tag} of {what} is {brief(ends[tag])}, which is not a link",
                "declare the link, or correct its name",
            )
    of_tree = KINDS.get(kind)
    known = of_tree is not None and links["child"] not in ("", WORLD)
    return SdfJoint(
        name=name,
        element=element,
        kind=of_tree,
        parent=links["parent"],
        child=links["child"],
        joint=_moving(document, frames, element, name, of_tree, links["child"])
        if of_tree is not None and known
        else None,
    )


def _moving(
    document: Document, frames: Frames, element: RawElement, name: str, kind: Kind, child: str
) -> Joint:
    """Anchor and axis in the child link's frame."""
    what, axis = f"joint {brief(name)}", document.child(element, "axis")
    xyz = None if axis is None else document.child(axis, "xyz")
    direction = np.array(document.text_numbers(xyz, (0.0, 0.0, 1.0), what))
    inward = inverse(frames.place(child))
    frame = _expressed_in(document, axis, xyz) or name
    direction = inward.rotation @ frames.place(frame).rotation @ direction
    if not direction.any():
        document.hinder(xyz or element, f"the axis of {what} has no length", "give a direction")
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


def _expressed_in(document: Document, axis: RawElement | None, xyz: RawElement | None) -> str:
    """The frame of an axis: in versions to 1.4 the model's; empty for the joint's own."""
    if xyz is not None and xyz.attributes.get("expressed_in"):
        return xyz.attributes["expressed_in"]
    told = None if axis is None else document.child(axis, "use_parent_model_frame")
    if told is not None:
        return MODEL if told.text.strip().lower() in ("1", "true") else ""
    return MODEL if version(document) <= (1, 4) else ""


def version(document: Document) -> tuple[int, ...]:
    """Of the format, such as (1, 7); the newest where it is not told."""
    words = document.root.attributes.get("version", "").split(".")
    return tuple(map(int, words)) if all(word.isdigit() for word in words) else (2,)


def _bounds(
    document: Document, joint: RawElement, axis: RawElement | None
) -> tuple[float, float] | None:
    limit = None if axis is None else document.child(axis, "limit")
    if limit is None or joint.attributes.get("type") == "continuous":
        return None
    ends = []
    for tag, sign in (("lower", -1.0), ("upper", 1.0)):
        element = document.child(limit, tag)
        endless = element is None or element.text.strip().lower().lstrip("+-") in ("", "inf")
        found = sign * ENDLESS if endless else document.text_numbers(element, (0.0,), tag)[0]
        ends.append(sign * np.inf if abs(found) >= ENDLESS else found)
    lower, upper = ends
    return None if lower > upper or np.isinf(ends).all() else (lower, upper)


def read_mimics(document: Document, joints: Mapping[str, SdfJoint]) -> dict[str, Mimic]:
    """Joints that follow others, by their names, of those whose rates a gear holds."""
    found: dict[str, Mimic] = {}
    for name, joint in joints.items():
        axis = document.child(joint.element, "axis")
        mimic = None if axis is None else document.child(axis, "mimic")
        if mimic is None or joint.joint is None:
            continue
        what = f"<mimic> of joint {brief(name)}"
        ratio, offset, reference = (
            document.text_numbers(document.child(mimic, tag), (default,), what)[0]
            for tag, default in (("multiplier", 1.0), ("offset", 0.0), ("reference", 0.0))
        )
        leader = joints.get(mimic.attributes.get("joint", ""))
        single = leader is not None and leader.joint is not None
        if leader is not None and single and ratio and offset == ratio * reference:
            found[name] = Mimic(leader.name, ratio)
    return acyclic(found)


def bodies_of(
    frames: Frames,
    root: str,
    links: Mapping[str, SdfLink],
    joints: Mapping[str, SdfJoint],
    still: Collection[str],
) -> Iterator[RigidBody]:
    """Bodies depth first; a root that floats counts from the world, however it is drawn."""
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
            quaternion=_turn(place.rotation),
            joints=(joint.joint,) if moving and joint.joint is not None else (),
        )
        waiting += reversed(below.get(joint.child, []))


def _triple(vector: Array) -> Triple:
    x, y, z = map(float, vector)
    return x, y, z


def _turn(rotation: Array) -> Quaternion:
    """The quaternion of a rotation, (w, x, y, z): by its largest component."""
    r = rotation
    products = np.array([
        [1 + r[0, 0] + r[1, 1] + r[2, 2], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
        [r[2, 1] - r[1, 2], 1 + r[0, 0] - r[1, 1] - r[2, 2], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
        [r[0, 2] - r[2, 0], r[0, 1] + r[1, 0], 1 - r[0, 0] + r[1, 1] - r[2, 2], r[1, 2] + r[2, 1]],
        [r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], 1 - r[0, 0] - r[1, 1] + r[2, 2]],
    ])  # fmt: skip
    row = products[np.argmax(np.diagonal(products))]
    w, x, y, z = (row / np.linalg.norm(row)).tolist()
    return w, x, y, z
