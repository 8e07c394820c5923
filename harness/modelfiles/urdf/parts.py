"""Links and joints of a URDF, each by itself, before the tree is built."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import quote
from physics_crosscheck.harness.modelfiles.couplings import MimicLeader, acyclic
from physics_crosscheck.harness.modelfiles.document import EXPAND, Document, read_numbers
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
"""The kind of joint in a tree; None for a fixed joint. Only one engine defines "spherical"."""

ENDLESS = (-np.inf, np.inf)


@dataclass(frozen=True, kw_only=True, eq=False)
class UrdfLink:
    """A link: its element, and its body, which has no parent yet."""

    name: str
    element: XmlElement
    body: RigidBody

    @property
    def spatial_inertia(self) -> SpatialInertia:
        """Its mass and inertia in its own frame."""
        return self.body.spatial_inertia


@dataclass(frozen=True, kw_only=True, eq=False)
class UrdfJoint:
    """A joint.

    Attributes:
        kind: None for a fixed joint.
        parent, child: names of links.
        origin, rpy: pose of its frame in the parent's.
        axis: direction in its frame, of any length but zero.
        damping: N s/m or N m s/rad.
        bounds: of its position; infinite without a limit.
    """

    name: str
    element: XmlElement
    kind: Kind | None
    parent: str
    child: str
    origin: Triple
    rpy: Triple
    axis: Triple
    damping: float
    bounds: tuple[float, float]


def read_links(document: Document) -> dict[str, UrdfLink]:
    """Return the links by name; problems are noted in the document."""
    links: dict[str, UrdfLink] = {}
    for name, element in _named(document, "link").items():
        links[name] = read_link(document, element, name)
    return links


def read_link(document: Document, element: XmlElement, name: str) -> UrdfLink:
    """Read a link."""
    return UrdfLink(name=name, element=element, body=_body(document, element, name))


def read_joints(document: Document) -> dict[str, UrdfJoint]:
    """Return the joints by name, without invalid ones, which are noted in the document."""
    named = _named(document, "joint")
    return {name: read_joint(document, element, name) for name, element in named.items()}


def read_joint(document: Document, element: XmlElement, name: str) -> UrdfJoint:
    """Read a joint."""
    kind, what = element.attributes.get("type", ""), f"joint {quote(name)}"
    if kind == "planar":
        document.add_problem(
            element,
            f"{what} is planar, which is not covered",
            "write two prismatic joints and a continuous one",
            "unsupported",
        )
    elif kind not in KINDS:
        document.add_problem(
            element, f"{what} is of type {quote(kind)}", f"types are {', '.join(KINDS)}"
        )
    ends = [_end(document, element, tag, what) for tag in ("parent", "child")]
    origin, rpy = _place(document, element, what)
    return UrdfJoint(
        name=name,
        element=element,
        kind=KINDS.get(kind),
        parent=ends[0],
        child=ends[1],
        origin=origin,
        rpy=rpy,
        axis=_axis(document, element, KINDS.get(kind), what),
        damping=document.number(document.child(element, "dynamics"), "damping", 0.0, what),
        bounds=_bounds(document, element, kind),
    )


def read_springs(document: Document) -> dict[str, tuple[float, float]]:
    """Return stiffness and rest of joints by their reference, in Gazebo's convention.

    `<gazebo reference="joint"><springStiffness>k</springStiffness>
    <springReference>rest</springReference></gazebo>` (SDFormat 1.x, URDF extensions).
    """
    springs: dict[str, tuple[float, float]] = {}
    for element in document.root.children:
        if element.tag != "gazebo":
            continue
        stiffness = document.child(element, "springStiffness")
        if stiffness is None:
            continue
        name = element.attributes.get("reference", "")
        rest = document.child(element, "springReference")
        spring = _text(document, stiffness, name), _text(document, rest, name)
        if springs.setdefault(name, spring) != spring:
            document.add_problem(
                stiffness, f"a second spring of joint {quote(name)}", "keep one of them"
            )
    return springs


def _named(document: Document, tag: str) -> dict[str, XmlElement]:
    by_name: dict[str, XmlElement] = {}
    for element in document.root.children:
        if element.tag != tag:
            continue
        name = element.attributes.get("name", "")
        if not name:
            document.add_problem(element, f"a <{tag}> has no name", "give it a unique name")
        elif name in by_name:
            document.add_problem(
                element, f"a second {tag} is called {quote(name)}", "give it a unique name"
            )
        else:
            by_name[name] = element
    return by_name


def _body(document: Document, link: XmlElement, name: str) -> RigidBody:
    bare = RigidBody(name=name, parent=None)
    inertial = document.child(link, "inertial")
    if inertial is None:
        return bare
    what = f"link {quote(name)}"
    center, rpy = _place(document, inertial, f"<inertial> of {what}")
    mass, inertia = document.child(inertial, "mass"), document.child(inertial, "inertia")
    if mass is None and inertia is None:
        return bare
    if mass is None or "value" not in mass.attributes:
        document.add_problem(mass or inertial, f"{what} has an inertial without mass",
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
    document: Document, inertial: XmlElement, inertia: XmlElement | None, mass: float, what: str
) -> tuple[float, float, float, float, float, float]:
    """Return the tensor about the center of mass, in the axes of `<inertial>`; products default to
    0.
    """
    stated = {} if inertia is None else inertia.attributes
    missing = [key for key in ("ixx", "iyy", "izz") if key not in stated]
    if missing and (mass or stated):
        document.add_problem(
            inertia or inertial,
            f"the inertia of {what} has no {' and no '.join(missing)}",
            "write all of ixx, ixy, ixz, iyy, iyz and izz, in kg m^2",
        )
    xx, xy, xz, yy, yz, zz = (
        document.number(inertia, key, 0.0, f"<inertia> of {what}")
        for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    return xx, yy, zz, xy, xz, yz


def _place(document: Document, element: XmlElement, what: str) -> tuple[Triple, Triple]:
    """Return origin and rpy."""
    origin = document.child(element, "origin")
    if origin is None:
        return ZERO, ZERO
    x, y, z = document.numbers(origin, "xyz", ZERO, f"<origin> of {what}")
    roll, pitch, yaw = document.numbers(origin, "rpy", ZERO, f"<origin> of {what}")
    return (x, y, z), (roll, pitch, yaw)


def _end(document: Document, joint: XmlElement, tag: str, what: str) -> str:
    element = document.child(joint, tag)
    link = "" if element is None else element.attributes.get("link", "")
    if not link:
        document.add_problem(joint, f"{what} has no {tag}", f'write <{tag} link="..."/>')
    return link


def _axis(document: Document, joint: XmlElement, kind: Kind | None, what: str) -> Triple:
    """Return the axis; x by default, and for joints without an axis."""
    default = (1.0, 0.0, 0.0)
    element = document.child(joint, "axis")
    if kind not in ("hinge", "slide"):
        return default
    if element is not None and "xyz" not in element.attributes:
        document.add_problem(element, f"the <axis> of {what} has no xyz", 'write <axis xyz="..."/>')
    x, y, z = document.numbers(element, "xyz", default, f"<axis> of {what}")
    if not (x or y or z):
        document.add_problem(
            element or joint, f"the axis of {what} has no length", "give it a direction"
        )
        return default
    return x, y, z


def _bounds(document: Document, joint: XmlElement, kind: str) -> tuple[float, float]:
    """Return position bounds; infinite if lower is above upper, or they can't be read.

    If only one bound is stated, the other is 0, as the format defines; without both, engines apply
    no limit.
    """
    limit = document.child(joint, "limit")
    stated = {} if limit is None else limit.attributes
    if kind not in ("revolute", "prismatic") or not {"lower", "upper"} & set(stated):
        return ENDLESS
    lower, upper = (read_numbers(stated.get(key, "0"), 1) for key in ("lower", "upper"))
    if lower is None or upper is None or lower > upper:
        return ENDLESS
    return lower[0], upper[0]


def _text(document: Document, element: XmlElement | None, joint: str) -> float:
    """Return the number of a spring; 0 without an element."""
    if element is None:
        return 0.0
    values = read_numbers(element.text, 1)
    if values is None or not np.isfinite(values[0]):
        document.add_problem(
            element,
            f"<{element.tag}> of joint {quote(joint)} is "
            f"{quote(element.text.strip())}; expected a finite number",
            EXPAND if "$" in element.text else "write a number",
            "file",
        )
        return 0.0
    return values[0]


def read_mimics(document: Document, joints: Mapping[str, UrdfJoint]) -> dict[str, MimicLeader]:
    """Return the mimics by the follower's name.

    A gear constrains velocities. A mimic with an offset or a zero multiplier is therefore left
    free, and so is one whose leader is not a hinge or slide, or that follows itself through others.
    """
    mimics: dict[str, MimicLeader] = {}
    for name, joint in joints.items():
        mimic = document.child(joint.element, "mimic")
        if mimic is None or joint.kind not in ("hinge", "slide"):
            continue
        leader = joints.get(mimic.attributes.get("joint", ""))
        what = f"<mimic> of joint {quote(name)}"
        multiplier = document.number(mimic, "multiplier", 1.0, what)
        offset = document.number(mimic, "offset", 0.0, what)
        single = leader is not None and leader.kind in ("hinge", "slide")
        if leader is not None and single and multiplier and not offset:
            mimics[name] = MimicLeader(leader.name, multiplier)
    return acyclic(mimics)
