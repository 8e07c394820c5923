"""Links and joints of a URDF, each by itself: before it is known what hangs from what."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from physics_crosscheck.harness.modelfiles.couplings import Mimic, acyclic
from physics_crosscheck.harness.modelfiles.document import EXPAND, Document, read_numbers
from physics_crosscheck.harness.modelfiles.locations.xml import RawElement
from physics_crosscheck.harness.modelfiles.quote import brief
from physics_crosscheck.reference.mechanism.bodies import ZERO, RigidBody, Triple
from physics_crosscheck.reference.mechanism.spatial_inertia import SpatialInertia
from physics_crosscheck.reference.mechanism.tree import Kind

KINDS: Mapping[str, Kind | None] = MappingProxyType(
    {
        "revolute": "hinge",
        "continuous": "hinge",
        "prismatic": "slide",
        "floating": "free",
        "spherical": "ball",
        "fixed": None,
    }
)
"""What a joint's type is in a tree; nothing of what is welded. "spherical" is one engine's own."""

ENDLESS = (-np.inf, np.inf)


@dataclass(frozen=True, kw_only=True, eq=False)
class UrdfLink:
    """A link: its element, and its body, of which it is not known yet what it hangs from."""

    name: str
    element: RawElement
    body: RigidBody

    @property
    def lump(self) -> SpatialInertia:
        """Its mass in its own frame."""
        return self.body.spatial_inertia


@dataclass(frozen=True, kw_only=True, eq=False)
class UrdfJoint:
    """A joint.

    Attributes:
        kind: None of a fixed one.
        parent, child: names of links.
        at, rpy: place of its frame in the parent's.
        axis: direction in its frame, of any length but zero.
        damping: N s/m or N m s/rad.
        bounds: of its position; infinite ones where they hold nothing.
    """

    name: str
    element: RawElement
    kind: Kind | None
    parent: str
    child: str
    at: Triple
    rpy: Triple
    axis: Triple
    damping: float
    bounds: tuple[float, float]


def read_links(document: Document) -> dict[str, UrdfLink]:
    """The links by their names; what is wrong with them is noted in the document."""
    found: dict[str, UrdfLink] = {}
    for name, element in _named(document, "link").items():
        found[name] = read_link(document, element, name)
    return found


def read_link(document: Document, element: RawElement, name: str) -> UrdfLink:
    """One of them."""
    return UrdfLink(name=name, element=element, body=_body(document, element, name))


def read_joints(document: Document) -> dict[str, UrdfJoint]:
    """The joints by their names, but those that make no sense, which are noted in the document."""
    named = _named(document, "joint")
    return {name: read_joint(document, element, name) for name, element in named.items()}


def read_joint(document: Document, element: RawElement, name: str) -> UrdfJoint:
    """One of them."""
    kind, what = element.attributes.get("type", ""), f"joint {brief(name)}"
    if kind == "planar":
        document.hinder(
            element,
            f"{what} is planar, which is not covered",
            "write two prismatic joints and a continuous one",
            "unsupported",
        )
    elif kind not in KINDS:
        document.hinder(
            element, f"{what} is of type {brief(kind)}", f"types are {', '.join(KINDS)}"
        )
    ends = [_end(document, element, tag, what) for tag in ("parent", "child")]
    at, rpy = _place(document, element, what)
    return UrdfJoint(
        name=name,
        element=element,
        kind=KINDS.get(kind),
        parent=ends[0],
        child=ends[1],
        at=at,
        rpy=rpy,
        axis=_axis(document, element, KINDS.get(kind), what),
        damping=document.number(document.child(element, "dynamics"), "damping", 0.0, what),
        bounds=_bounds(document, element, kind),
    )


def read_springs(document: Document) -> dict[str, tuple[float, float]]:
    """Stiffness and rest of joints, in Gazebo's convention: by what `<gazebo>` refers to.

    `<gazebo reference="joint"><springStiffness>k</springStiffness>
    <springReference>rest</springReference></gazebo>` (SDFormat 1.x, URDF extensions).
    """
    found: dict[str, tuple[float, float]] = {}
    for element in document.root.children:
        if element.tag != "gazebo":
            continue
        stiffness = document.child(element, "springStiffness")
        if stiffness is None:
            continue
        name = element.attributes.get("reference", "")
        rest = document.child(element, "springReference")
        spring = _text(document, stiffness, name), _text(document, rest, name)
        if found.setdefault(name, spring) != spring:
            document.hinder(
                stiffness, f"a second spring of joint {brief(name)}", "keep one of them"
            )
    return found


def _named(document: Document, tag: str) -> dict[str, RawElement]:
    found: dict[str, RawElement] = {}
    for element in document.root.children:
        if element.tag != tag:
            continue
        name = element.attributes.get("name", "")
        if not name:
            document.hinder(element, f"a <{tag}> has no name", "give it a unique name")
        elif name in found:
            document.hinder(
                element, f"a second {tag} is called {brief(name)}", "give it a unique name"
            )
        else:
            found[name] = element
    return found


def _body(document: Document, link: RawElement, name: str) -> RigidBody:
    bare = RigidBody(name=name, parent=None)
    inertial = document.child(link, "inertial")
    if inertial is None:
        return bare
    what = f"link {brief(name)}"
    center, rpy = _place(document, inertial, f"<inertial> of {what}")
    mass, inertia = document.child(inertial, "mass"), document.child(inertial, "inertia")
    if mass is None and inertia is None:
        return bare
    if mass is None or "value" not in mass.attributes:
        document.hinder(mass or inertial, f"{what} has an inertial without mass",
                        'write <mass value="..."/>, in kg')  # fmt: skip
    weight = document.number(mass, "value", 0.0, f"<mass> of {what}")
    return replace(
        bare,
        mass=weight,
        center=center,
        inertia_rpy=rpy,
        inertia=_tensor(document, inertial, inertia, weight, what),
    )


def _tensor(
    document: Document, inertial: RawElement, inertia: RawElement | None, mass: float, what: str
) -> tuple[float, float, float, float, float, float]:
    """About the center of mass, in the axes of `<inertial>`; products that are not told are 0."""
    told = {} if inertia is None else inertia.attributes
    missing = [key for key in ("ixx", "iyy", "izz") if key not in told]
    if missing and (mass or told):
        document.hinder(
            inertia or inertial,
            f"the inertia of {what} has no {' and no '.join(missing)}",
            "write all of ixx, ixy, ixz, iyy, iyz and izz, in kg m^2",
        )
    xx, xy, xz, yy, yz, zz = (
        document.number(inertia, key, 0.0, f"<inertia> of {what}")
        for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    return xx, yy, zz, xy, xz, yz


def _place(document: Document, element: RawElement, what: str) -> tuple[Triple, Triple]:
    """Origin and rpy."""
    origin = document.child(element, "origin")
    if origin is None:
        return ZERO, ZERO
    x, y, z = document.numbers(origin, "xyz", ZERO, f"<origin> of {what}")
    roll, pitch, yaw = document.numbers(origin, "rpy", ZERO, f"<origin> of {what}")
    return (x, y, z), (roll, pitch, yaw)


def _end(document: Document, joint: RawElement, tag: str, what: str) -> str:
    element = document.child(joint, tag)
    link = "" if element is None else element.attributes.get("link", "")
    if not link:
        document.hinder(joint, f"{what} has no {tag}", f'write <{tag} link="..."/>')
    return link


def _axis(document: Document, joint: RawElement, kind: Kind | None, what: str) -> Triple:
    """The x axis where none is told, and of joints that have none."""
    default = (1.0, 0.0, 0.0)
    element = document.child(joint, "axis")
    if kind not in ("hinge", "slide"):
        return default
    if element is not None and "xyz" not in element.attributes:
        document.hinder(element, f"the <axis> of {what} has no xyz", 'write <axis xyz="..."/>')
    x, y, z = document.numbers(element, "xyz", default, f"<axis> of {what}")
    if not (x or y or z):
        document.hinder(
            element or joint, f"the axis of {what} has no length", "give it a direction"
        )
        return default
    return x, y, z


def _bounds(document: Document, joint: RawElement, kind: str) -> tuple[float, float]:
    """Of its position; a lower one above the upper one holds nothing, nor do unreadable ones.

    Where one of both is told, the other is 0, as the format has it; no engine holds a joint at
    bounds of which neither is told.
    """
    limit = document.child(joint, "limit")
    told = {} if limit is None else limit.attributes
    if kind not in ("revolute", "prismatic") or not {"lower", "upper"} & set(told):
        return ENDLESS
    lower, upper = (read_numbers(told.get(key, "0"), 1) for key in ("lower", "upper"))
    if lower is None or upper is None or lower > upper:
        return ENDLESS
    return lower[0], upper[0]


def _text(document: Document, element: RawElement | None, joint: str) -> float:
    """The number of a spring; 0 where there is no element."""
    if element is None:
        return 0.0
    found = read_numbers(element.text, 1)
    if found is None or not np.isfinite(found[0]):
        document.hinder(
            element,
            f"<{element.tag}> of joint {brief(joint)} is "
            f"{brief(element.text.strip())}; expected a finite number",
            EXPAND if "$" in element.text else "write a number",
            "file",
        )
        return 0.0
    return found[0]


def read_mimics(document: Document, joints: Mapping[str, UrdfJoint]) -> dict[str, Mimic]:
    """By the following joint's name.

    A gear holds rates, so that one with an offset, or with the multiplier zero, is none; it is left
    free, as is one whose leader is no hinge and no slide, or that follows itself by way of others.
    """
    found: dict[str, Mimic] = {}
    for name, joint in joints.items():
        mimic = document.child(joint.element, "mimic")
        if mimic is None or joint.kind not in ("hinge", "slide"):
            continue
        leader = joints.get(mimic.attributes.get("joint", ""))
        what = f"<mimic> of joint {brief(name)}"
        multiplier = document.number(mimic, "multiplier", 1.0, what)
        offset = document.number(mimic, "offset", 0.0, what)
        single = leader is not None and leader.kind in ("hinge", "slide")
        if leader is not None and single and multiplier and not offset:
            found[name] = Mimic(leader.name, multiplier)
    return acyclic(found)
