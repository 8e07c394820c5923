"""A URDF as a tree of bodies, with omissions and problems.

Content of a URDF beyond bodies and joints, counted by kind.
"""

import re
from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from types import MappingProxyType

import numpy as np

from physics_crosscheck.harness.documents.document import GRAVITY, Document, read_numbers
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import LocationError, ReadError
from physics_crosscheck.harness.documents.expanded import has_stand_ins
from physics_crosscheck.harness.documents.urdf import (
    ENDLESS,
    SINGLE,
    UrdfFile,
    UrdfJoint,
    read_joint,
    read_link,
    read_mimics,
    read_springs,
    read_urdf,
)
from physics_crosscheck.reference.mechanism.assemble import assembled, with_bodies
from physics_crosscheck.reference.mechanism.bodies import ZERO, Joint, RigidBody
from physics_crosscheck.reference.mechanism.rotations import Place, from_rpy
from physics_crosscheck.reference.mechanism.tree import Tree
from ..build_tree import build_robot, couplings, enforceable, placed_in
from ..numbers import NUDGE, ModelFile, set_temporarily
from ..robot import FREE_MIMIC, Note, Omission, PlacedShape, Robot, count_notes, refused

UPRIGHT = 0.8
"""Least cosine of the angle between the axis of a propeller and the vertical."""

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

_RATIOS = {"mechanicalReduction": ((1.0,), None), "motorInertia": ((0.0,), None)}
"""Numbers of a transmission that no engine reads, and values without effect."""


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
        yield from _of_transmission(element, name)
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


def _of_transmission(element: XmlElement, name: str) -> Iterator[Note]:
    """Yield a ratio and a rotor's inertia that change motions."""
    for number in element.iter() if element.tag == "transmission" else ():
        if number.tag in _RATIOS and read_numbers(number.text, 1) not in _RATIOS[number.tag]:
            yield f"<{number.tag}> of <transmission>", name, number.place


def _unread(element: XmlElement, name: str) -> Iterator[Note]:
    """Yield child elements that have no meaning here."""
    readable = _READ.get(element.tag)
    if readable is None or (element.tag == "robot" and element.parent is not None):
        return
    for child in element.children:
        if child.tag not in readable and child.tag not in _VISUALS:
            within = "" if element.tag == "robot" else f" of <{element.tag}>"
            yield f"<{child.tag}>{within}", name or child.attributes.get("name", ""), child.place


def _unknown_attributes(element: XmlElement, name: str) -> Iterator[Note]:
    for key in element.attributes if element.tag in _MEANINGFUL_ATTRIBUTES else ():
        if key not in _MEANINGFUL_ATTRIBUTES[element.tag] and not key.startswith("xmlns"):
            yield f"{key} of <{element.tag}>", name, element.attribute_place(key)


def read_urdf_robot(
    path: Path,
    *,
    floating: bool | None = False,
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
            None: it is also free if it has mass and shapes, and two chains reach below all of them.
        armatures: as in `Document`.
    """
    try:
        document = Document(path)
    except LocationError as error:
        return refused(path, path.stem, [ReadError.unreadable(error, path)])
    document.armatures = armatures
    with np.errstate(all="ignore"):  # overflow is reported
        return _read(document, floating)


def _read(document: Document, floating: bool | None) -> Robot:
    file = read_urdf(document)
    mimics = enforceable(file.mimics, singles(file.joints))
    left_out = urdf_left_out(file, mimics)
    stands = floating is None and file.can_float and _stands(file)
    floating = floating or file.is_free_body or stands
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


def _stands(file: UrdfFile) -> bool:
    """Return whether a robot with a heavy root stands on legs or wheels, or flies, as drawn.

    Two or more chains of moving links have shapes below all shapes of the root and the links that
    are fixed to it. Of a mesh, only its origin counts. Or three or more moving links are
    propellers: each is lighter than the root, on an upright hinge without limits. All others, such
    as a camera gimbal, are together lighter than the root.
    """
    below: dict[str, list[UrdfJoint]] = {}
    for joint in file.joints.values():
        below.setdefault(joint.parent, []).append(joint)
    lowest, mass, places = {"": np.inf}, 0.0, dict[str, Place]()
    waiting, seen = [(file.root, Place(np.eye(3), np.zeros(3)), "")], set[str]()
    while waiting:
        name, place, chain = waiting.pop()
        link = file.links.get(name)
        if link is None or name in seen:
            continue
        seen.add(name)
        if not chain:
            mass, places[name] = mass + link.body.mass, place
        heights = [_lowest(shape, place) for shape in placed_in({name: link}, file.document.path)]
        lowest[chain] = min([lowest.get(chain, np.inf), *heights])
        for joint in below.get(name, ()):
            frame = Place(from_rpy(*joint.rpy), np.array(joint.origin))
            first = chain or (joint.name if joint.kind else "")
            waiting.append((joint.child, place.compose(frame), first))
    base, moving = lowest.pop(""), file.joints.values()
    spins = [one.child for one in moving if _is_propeller(file, one, places, mass)]
    weights = {name: link.body.mass for name, link in file.links.items()}
    others = sum(weights.values()) - mass - sum(map(weights.__getitem__, spins))
    if len(spins) > 2 and others < mass:
        return True
    return mass > 0 and np.isfinite(base) and sum(low < base for low in lowest.values()) > 1


def _is_propeller(
    file: UrdfFile, joint: UrdfJoint, places: Mapping[str, Place], mass: float
) -> bool:
    """Return whether a joint carries a link lighter than its root, on an upright endless hinge."""
    parent, link = places.get(joint.parent), file.links.get(joint.child)
    if parent is None or link is None or joint.kind != "hinge" or joint.bounds != ENDLESS:
        return False
    up = parent.rotation[2] @ from_rpy(*joint.rpy) @ joint.axis
    return link.body.mass < mass and abs(up) > UPRIGHT * float(np.linalg.norm(joint.axis))


def _lowest(shape: PlacedShape, link: Place) -> float:
    """Return the height of a shape's lowest point, m; of a mesh, that of its origin."""
    placed = link.compose(shape.place)
    down = np.abs(placed.rotation[2])
    radius, *half = shape.size or (0.0,)
    depth = down @ np.array(shape.size) if shape.kind == "box" else radius + down[2] * sum(half)
    return float(placed.origin[2] - depth)


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


_RELEVANT = re.compile(
    r"robot/(link/inertial/.*|joint/(origin|axis)@.*|joint/dynamics@damping|joint/mimic@.*"
    r"|gazebo/spring(Stiffness|Reference))"
)
"""Numbers that affect a tree."""

_BODIES = re.compile(r"robot/(link/inertial/.*|joint/(origin|axis)@.*|joint/dynamics@damping)")
"""Numbers that affect one body of it and its joint."""

_SHAPES = re.compile(
    r"robot/link/collision/(origin@(xyz|rpy)|geometry/(box|sphere|cylinder|capsule|mesh)@\w+)"
)
"""Numbers on which collision shapes depend."""


class UrdfNumbers(ModelFile):
    """The numbers of a URDF that has a tree.

    Args:
        path: of the file.
        floating: whether its root moves freely.
        held: joints that are fixed.
        armatures: as in `Document`.

    Attributes:
        floats: whether its root moves freely.
    """

    def __init__(
        self,
        path: Path,
        *,
        floating: bool,
        held: Collection[str] = (),
        armatures: Mapping[str, float] = MappingProxyType({}),
    ) -> None:
        self._document = Document(path)
        super().__init__([self._document])
        self._document.armatures = armatures
        self._file = file = read_urdf(self._document)
        self._held, self.floats = held, floating and file.can_float
        if has_stand_ins(path):
            self.numerals = tuple(one for one in self.numerals if "/inertial/" not in one.path)

    @cached_property
    def relevant_numbers(self) -> tuple[int, ...]:
        """Indices of the numbers that may affect the tree."""
        owners = {one.element for one in self._file.links.values()}
        owners |= {one.element for one in self._file.joints.values()}
        owners |= set(self._document.root.findall("gazebo"))
        numbers = enumerate(self.numerals)
        kept = (i for i, one in numbers if _RELEVANT.fullmatch(one.path))
        return tuple(i for i in kept if self._owner(i) in owners)

    def tree(self, values: Mapping[int, float]) -> Tree | None:
        """Return the tree with other values of some numbers, by index, or None."""
        nominal = self._nominal
        if nominal is None or not all(_BODIES.fullmatch(self.numerals[i].path) for i in values):
            return self._built(values)
        if not values:
            return nominal
        with self.changed(values, coupled=True, tree=nominal) as changed:
            if changed is None:
                return None
            file, joints = changed[0], {one.child: one for one in changed[0].joints.values()}
            others = {}
            for element in filter(None, map(self._owner, values)):
                name = element.get("name")
                link = file.joints[name].child if element.tag == "joint" else name
                if link in self._bodies:
                    joint = joints.get(link)
                    others[link] = body_of(file, link, joint, self.floats, self._held)
            return with_bodies(nominal, {**self._bodies, **others}, others)

    @cached_property
    def _nominal(self) -> Tree | None:
        """The tree of the file as it is."""
        return self._built({})

    @cached_property
    def _bodies(self) -> Mapping[str, RigidBody]:
        """The bodies of the file as it is, by their links."""
        return {body.name: body for body in bodies_of(self._file, self.floats, self._held)}

    def _built(self, values: Mapping[int, float]) -> Tree | None:
        with self.changed(values, coupled=True) as changed:
            return changed and changed[1]

    @contextmanager
    def changed(
        self, values: Mapping[int, float], *, coupled: bool, tree: Tree | None = None
    ) -> Iterator[tuple[UrdfFile, Tree] | None]:
        """Give the file with other values of some numbers, and its tree, or None.

        Its elements have these values until the context closes. A given tree is not built again.
        """
        document = self._document
        count = len(document.obstacles)
        with ExitStack() as restored:
            for index, value in values.items():
                set_temporarily(self.numerals[index], value, restored)
            read = partial(self._reread, values, coupled=coupled, tree=tree)
            changed = read() if self._file.root else None
            yield None if len(document.obstacles) > count else changed
        del document.obstacles[count:]

    def _reread(
        self, values: Mapping[int, float], *, coupled: bool, tree: Tree | None
    ) -> tuple[UrdfFile, Tree] | None:
        """Return the file with the present values of some numbers, and its tree."""
        document = self._document
        elements = {id(owner): owner for i in values if (owner := self._owner(i)) is not None}
        links, joints = dict(self._file.links), dict(self._file.joints)
        for element in elements.values():
            name = element.get("name")
            if element.tag == "link":
                links[name] = read_link(document, element, name)
            elif element.tag == "joint":
                joints[name] = read_joint(document, element, name)
        file = replace(self._file, links=links, joints=joints)
        if tree is not None:
            return file, tree
        springs, mimics = read_springs(document), read_mimics(document, joints)
        file = replace(file, springs=springs)
        leaders = enforceable(mimics, singles(joints) - set(self._held)) if coupled else {}
        bodies = bodies_of(file, self.floats, self._held)
        tree = assembled(bodies, GRAVITY, couplings=couplings(leaders)).tree
        return None if tree is None else (file, tree)

    def placing(self, candidates: Collection[int]) -> Collection[int]:
        """Return those on which the frame or the size of a collision shape depends."""
        shapes = (i for i in candidates if _SHAPES.fullmatch(self.numerals[i].path))
        return frozenset(i for i in shapes if self._places_shape(i))

    def _places_shape(self, index: int) -> bool:
        number, owner = self.numerals[index], self._owner(index)
        links = {name: one for name, one in self._file.links.items() if one.element is owner}
        before = placed_in(links, self._document.path)
        with ExitStack() as restored:
            set_temporarily(number, number.value + NUDGE * number.scale, restored)
            return any(map(_differ, before, placed_in(links, self._document.path)))

    def _owner(self, index: int) -> XmlElement | None:
        return _owner(self.numerals[index].element)


def _owner(element: XmlElement) -> XmlElement | None:
    """Return the child of the root that contains an element."""
    while element.parent is not None and element.parent.parent is not None:
        element = element.parent
    return None if element.parent is None else element


def _differ(first: PlacedShape, second: PlacedShape) -> bool:
    """Return whether two shapes differ in frame, size or scale."""
    same = map(np.array_equal, first.place, second.place)
    return (first.size, first.scale) != (second.size, second.scale) or not all(same)
