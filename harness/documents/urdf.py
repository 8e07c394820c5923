"""URDF: the meaning of its elements, and the rules of a valid file.

The rules are those of the format (http://wiki.ros.org/urdf/XML). Ambiguous files are refused too,
because engines read them differently or crash.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from physics_crosscheck.reference.mechanism.bodies import ZERO, RigidBody, Triple
from physics_crosscheck.reference.mechanism.tree import Kind
from .document import (
    EXPAND,
    Document,
    FileLink,
    Mimic,
    add_loop_problems,
    attach_child,
    free_name,
    named_elements,
)
from .elements import XmlElement
from .errors import quote
from .schema import remedy_with_hint

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

SINGLE = ("hinge", "slide")
"""Kinds of joints with one coordinate."""

ENDLESS = (-math.inf, math.inf)

_COUNTS = {
    **dict.fromkeys((("origin", "xyz"), ("origin", "rpy")), 3),
    **{("inertia", key): 1 for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")},
    **{("limit", key): 1 for key in ("lower", "upper", "velocity", "effort")},
    **{("dynamics", key): 1 for key in ("damping", "friction")},
    **{("mimic", key): 1 for key in ("multiplier", "offset")},
    ("axis", "xyz"): 3,
    ("mass", "value"): 1,
}
"""How many numbers an attribute has."""


@dataclass(frozen=True, kw_only=True, eq=False)
class UrdfJoint:
    """A joint.

    Attributes:
        kind: None for a fixed joint.
        parent, child: names of links.
        origin, rpy: pose of its frame in the parent's.
        axis: direction in its frame, of any length but zero.
        damping, friction: N s/m or N m s/rad, N or N m.
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
    friction: float
    bounds: tuple[float, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class UrdfFile:
    """The content of a URDF; problems are noted in its document.

    Attributes:
        links, joints: by name, in the file's order.
        springs: stiffness and rest position of joints, in Gazebo's convention.
        mimics: joints that follow others, by the follower's name.
        root: the link without a parent; empty without a unique one.
    """

    document: Document
    links: Mapping[str, FileLink]
    joints: Mapping[str, UrdfJoint]
    springs: Mapping[str, tuple[float, float]]
    mimics: Mapping[str, Mimic]
    root: str

    def stated_bounds(self, name: str) -> tuple[float, float]:
        """Return the bounds of a joint; a continuous one has those that its `<limit>` states."""
        joint = self.joints[name]
        limit = self.document.child(joint.element, "limit")
        keys = ("lower", "upper")
        if joint.bounds != ENDLESS or limit is None or not set(keys) <= set(limit.attributes):
            return joint.bounds
        lower, upper = (self.document.number(limit, key, 0.0, "<limit>") for key in keys)
        return lower, upper

    @property
    def can_float(self) -> bool:
        """False for a root link `world`: to some engines it is the world itself."""
        return self.root != "world"

    @property
    def is_free_body(self) -> bool:
        """True if it has mass and no joint moves: its root moves, unless it is a scene."""
        has_mass = any(link.body.mass for link in self.links.values())
        return self.can_float and has_mass and not any(one.kind for one in self.joints.values())

    @property
    def base(self) -> str:
        """The name of a floating root's free joint."""
        return free_name(self.root, self.joints)


def read_urdf(document: Document) -> UrdfFile:
    """Read a parsed file; problems are noted in the document."""
    root = document.root
    _check_root(document)
    links = named_elements(document, root.findall("link"), "link")
    joints = named_elements(document, root.findall("joint"), "joint")
    for element in (*root.findall("link"), *root.findall("joint")):
        _check_numbers(document, element)
    read_links = {name: read_link(document, one, name) for name, one in links.items()}
    read_joints = {name: read_joint(document, one, name) for name, one in joints.items()}
    springs = read_springs(document)
    for joint, element in _spring_elements(document):
        if joint not in read_joints or read_joints[joint].kind not in SINGLE:
            document.add_problem(
                element,
                f"a spring names {quote(joint)}, which is neither a slide nor a hinge",
                "name such a joint in the reference of its <gazebo>",
            )
    return UrdfFile(
        document=document,
        links=read_links,
        joints=read_joints,
        springs=springs,
        mimics=read_mimics(document, read_joints),
        root=_root(document, links, read_joints),
    )


def _check_root(document: Document) -> None:
    """Note why a document is not a URDF, or not yet."""
    root = document.root
    if root.tag != "robot":
        document.add_problem(root, f"the root is <{root.tag}>, not <robot>", "give a URDF")
    xacro = [one for one in root if one.tag.startswith("xacro:")]
    if xacro:
        elements = "1 element" if len(xacro) == 1 else f"{len(xacro)} elements"
        such = f"{elements} such as <{xacro[0].tag}>"
        document.add_problem(xacro[0], f"it is xacro source: {such}", EXPAND, "file")
    for inner in root.findall("robot"):
        document.add_problem(inner, "a <robot> inside the <robot>", "keep one robot per file")


def _check_numbers(document: Document, element: XmlElement) -> None:
    """Note every attribute of a link or joint that is not the numbers that it must be."""
    what = f"{element.tag} {quote(element.get('name'))}"
    for part in element.iter():
        for key in part.attributes:
            if count := _COUNTS.get((part.tag, key)):
                document.numbers(part, key, (0.0,) * count, f"<{part.tag}> of {what}")


def read_link(document: Document, element: XmlElement, name: str) -> FileLink:
    """Read a link."""
    return FileLink(element=element, body=_body(document, element, name))


def read_joint(document: Document, element: XmlElement, name: str) -> UrdfJoint:
    """Read a joint."""
    kind, what = element.get("type"), f"joint {quote(name)}"
    _check_kind(document, element, kind, what)
    ends = [_end(document, element, tag, what) for tag in ("parent", "child")]
    origin, rpy = _place(document, element, what)
    dynamics = document.child(element, "dynamics")
    return UrdfJoint(
        name=name,
        element=element,
        kind=KINDS.get(kind),
        parent=ends[0],
        child=ends[1],
        origin=origin,
        rpy=rpy,
        axis=_axis(document, element, KINDS.get(kind), what),
        damping=document.number(dynamics, "damping", 0.0, f"<dynamics> of {what}"),
        friction=document.number(dynamics, "friction", 0.0, f"<dynamics> of {what}"),
        bounds=_bounds(document, element, kind, what),
    )


def _check_kind(document: Document, joint: XmlElement, kind: str, what: str) -> None:
    if kind == "planar":
        document.add_problem(
            joint,
            f"{what} is planar, which is not covered",
            "write two prismatic joints and a continuous one",
            "unsupported",
        )
    elif kind not in KINDS:
        document.add_problem(
            joint,
            f"{what} is of type {quote(kind)}",
            remedy_with_hint(kind, KINDS, f"types are {', '.join(KINDS)}"),
        )


def read_springs(document: Document) -> dict[str, tuple[float, float]]:
    """Return stiffness and rest of joints by their reference, in Gazebo's convention.

    `<gazebo reference="joint"><springStiffness>k</springStiffness>
    <springReference>rest</springReference></gazebo>` (SDFormat 1.x, URDF extensions).
    """
    springs: dict[str, tuple[float, float]] = {}
    for name, stiffness in _spring_elements(document):
        rest = document.child(stiffness.parent, "springReference")
        spring = _text(document, stiffness, name), _text(document, rest, name)
        if springs.setdefault(name, spring) != spring:
            document.add_problem(
                stiffness, f"a second spring of joint {quote(name)}", "keep one of them"
            )
    return springs


def _spring_elements(document: Document) -> Iterator[tuple[str, XmlElement]]:
    """Yield each `<springStiffness>` with the name of its joint."""
    for gazebo in document.root.findall("gazebo"):
        stiffness = document.child(gazebo, "springStiffness")
        if stiffness is not None:
            yield gazebo.get("reference"), stiffness


def _text(document: Document, element: XmlElement | None, joint: str) -> float:
    """Return the number of a spring; 0 without an element."""
    if element is None:
        return 0.0
    place = f"<{element.tag}> of joint {quote(joint)}"
    return document.parsed(element, place, element.text.strip(), (0.0,))[0]


def _body(document: Document, link: XmlElement, name: str) -> RigidBody:
    bare = RigidBody(name=name, parent=None)
    inertial = document.child(link, "inertial")
    if inertial is None:
        return bare
    what = f"link {quote(name)}"
    center, rpy = _place(document, inertial, what)
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
    link = "" if element is None else element.get("link")
    if not link:
        document.add_problem(joint, f"{what} has no {tag}", f'write <{tag} link="..."/>')
    return link


def _axis(document: Document, joint: XmlElement, kind: Kind | None, what: str) -> Triple:
    """Return the axis; x by default, and for joints without an axis."""
    default = (1.0, 0.0, 0.0)
    element = document.child(joint, "axis")
    if kind not in SINGLE:
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


def _bounds(document: Document, joint: XmlElement, kind: str, what: str) -> tuple[float, float]:
    """Return position bounds; infinite if lower is above upper.

    If only one bound is stated, the other is 0, as the format defines; without both, engines apply
    no limit.
    """
    limit = document.child(joint, "limit")
    stated = {} if limit is None else limit.attributes
    if kind not in ("revolute", "prismatic") or not {"lower", "upper"} & set(stated):
        return ENDLESS
    lower, upper = (
        document.number(limit, key, 0.0, f"<limit> of {what}") for key in ("lower", "upper")
    )
    return ENDLESS if lower > upper else (lower, upper)


def read_mimics(document: Document, joints: Mapping[str, UrdfJoint]) -> dict[str, Mimic]:
    """Return the mimics by the follower's name."""
    mimics: dict[str, Mimic] = {}
    for name, joint in joints.items():
        mimic = document.child(joint.element, "mimic")
        if mimic is None:
            continue
        leader, what = mimic.get("joint"), f"joint {quote(name)}"
        if leader == name:
            document.add_problem(mimic, f"{what} mimics itself", "name another joint")
        elif leader not in joints:
            document.add_problem(
                mimic, f"{what} mimics {quote(leader)}, which is not a joint", "name another joint"
            )
        multiplier = document.number(mimic, "multiplier", 1.0, f"<mimic> of {what}")
        offset = document.number(mimic, "offset", 0.0, f"<mimic> of {what}")
        mimics[name] = Mimic(name, leader, multiplier, offset)
    return mimics


def _root(
    document: Document, links: Mapping[str, XmlElement], joints: Mapping[str, UrdfJoint]
) -> str:
    """Return the root link; without a unique one, note the problems."""
    above: dict[str, str] = {}
    for joint in joints.values():
        for tag, end in (("parent", joint.parent), ("child", joint.child)):
            if end and end not in links:
                document.add_problem(
                    joint.element,
                    f"the {tag} of joint {quote(joint.name)} is {quote(end)}, which is not a link",
                    remedy_with_hint(end, links, "declare the link, or correct its name"),
                )
        attach_child(document, above, joint.element, (joint.parent, joint.child))
    if not links:
        document.add_problem(document.root, "it has no <link>", "add at least one")
    # A misspelled name is reported instead of the link that it leaves without a joint.
    children = (joint.find("child") for joint in document.root.findall("joint"))
    named = {"" if child is None else child.get("link") for child in children}
    roots = [name for name in links if name not in above and name not in named]
    if len(roots) > 1 and named <= set(links):
        document.add_problem(
            links[roots[-1]],
            f"it has {len(roots)} root links, {', '.join(map(quote, roots))}",
            "give every root except one a joint",
        )
    add_loop_problems(document, above, links)
    return roots[0] if roots else ""
