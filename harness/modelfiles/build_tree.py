"""The bodies of a file as a tree; joints without inertia are fixed if that makes it valid."""

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np

from physics_crosscheck.harness.documents.document import Document, FileLink, Mimic, read_numbers
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import ReadError, ReadKind, quote
from physics_crosscheck.harness.documents.sdf.read import SdfJoint
from physics_crosscheck.harness.documents.urdf import UrdfJoint
from physics_crosscheck.reference.mechanism.assemble import Assembled, assemble
from physics_crosscheck.reference.mechanism.bodies import (
    BodyModel,
    Coupling,
    ForceElement,
    Joint,
    RigidBody,
    Triple,
)
from physics_crosscheck.reference.mechanism.rotations import Place, from_rpy, to_quaternion
from physics_crosscheck.reference.mechanism.tree import Tree
from .inertias import massless_groups
from .robot import HELD, LinkPart, Omission, PlacedShape, Robot, home_of, refused

_SIZES: Mapping[str, tuple[tuple[str, int, float], ...]] = MappingProxyType(
    {
        "box": (("size", 3, 0.5),),
        "sphere": (("radius", 1, 1.0),),
        "ellipsoid": (("radii", 3, 1.0),),
        "cylinder": (("radius", 1, 1.0), ("length", 1, 0.5)),
        "capsule": (("radius", 1, 1.0), ("length", 1, 0.5)),
    }
)
"""The sizes of each form: name, count of its numbers, and factor to half edges or half lengths."""


def placed_in(links: Mapping[str, FileLink], file: Path) -> tuple[PlacedShape, ...]:
    """Return the shapes of all links, by their names."""
    rows = (_shapes(name, link.element, file) for name, link in links.items())
    return tuple(shape for row in rows for shape in row)


def _shapes(name: str, link: XmlElement, file: Path) -> Iterator[PlacedShape]:
    """Yield the shapes of a link, visual ones first."""
    elements = (*link.findall("visual"), *link.findall("collision"))
    for index, element in enumerate(elements):
        place, form = _pose(element), element.find("geometry/*")
        size = None if form is None else _size(form)
        if form is None or place is None or size is None:
            continue
        stated = next(filter(None, map(element.find, ("origin", "pose"))), element)
        yield PlacedShape(
            name=f"{element.tag}:{name}#{index}",
            body=name,
            place=place,
            size=size,
            file=file,
            line=stated.place[1] or 0,
            size_place=(file, form.place[1] or 0),
            kind=form.tag,
            visual=element.tag == "visual",
            mesh=form.get("filename") or form.findtext("uri").strip(),
            scale=_scale(form),
        )


def _pose(element: XmlElement) -> Place | None:
    """Return the pose in the link: `<origin xyz rpy>`, or `<pose>x y z roll pitch yaw</pose>`."""
    origin, pose = element.find("origin"), element.find("pose")
    if pose is not None and pose.attributes:
        return None  # in another frame, or with another kind of angles
    texts = ("0 0 0", "0 0 0")
    if origin is not None:
        texts = origin.get("xyz", texts[0]), origin.get("rpy", texts[1])
    elif pose is not None and (words := pose.text.split()):
        texts = " ".join(words[:3]), " ".join(words[3:])
    position, angles = (read_numbers(text, 3) for text in texts)
    if position is None or angles is None:
        return None
    return Place(from_rpy(*angles), np.array(position))


def _scale(form: XmlElement) -> tuple[float, ...]:
    """Return the factors of a mesh's coordinates."""
    return read_numbers(form.get("scale") or form.findtext("scale"), 3) or (1.0, 1.0, 1.0)


def _size(form: XmlElement) -> tuple[float, ...] | None:
    """Return the half sizes of a form; None for an unknown form or sizes that are not numbers."""
    if form.tag == "mesh":
        return ()
    sizes: list[float] = []
    for key, count, factor in _SIZES.get(form.tag, (("", 0, 0.0),)):
        numbers = read_numbers(form.get(key) or form.findtext(key).strip(), count)
        if numbers is None or not count:
            return None
        sizes += [factor * value for value in numbers]
    return tuple(sizes)


Elements = Mapping[str, Any]
"""Elements of a file in any syntax, by the names of links or joints."""


class ProblemList(Protocol):
    """A file, to which problems of its elements are added."""

    path: Path
    obstacles: list[ReadError]

    def add_problem(
        self, element: Any, sentence: str, remedy: str, kind: ReadKind = "robot"
    ) -> None:
        """Add a problem that prevents building a tree."""


def build_robot(
    document: Document,
    *,
    name: str,
    links: Mapping[str, FileLink],
    joints: Mapping[str, UrdfJoint] | Mapping[str, SdfJoint],
    mimics: Mapping[str, Mimic],
    bodies_with: Callable[[Collection[str]], tuple[RigidBody, ...]],
    left_out: tuple[Omission, ...],
    gravity: Triple,
    floats: bool,
    stated: Mapping[str, object] = MappingProxyType({}),
) -> Robot:
    """Return the robot of a file; without a tree if the document has problems, also with masses.

    Args:
        document: the file.
        name: of the robot.
        links, joints: of the file.
        mimics: joints that follow others.
        bodies_with: a function that returns the bodies, with joints of these names fixed.
        left_out, floats, stated: as in `Robot`.
        gravity: m/s^2.
    """
    return built_robot(
        document,
        name=name,
        root=document.root,
        links={name: one.element for name, one in links.items()},
        joints={name: one.element for name, one in joints.items()},
        mimics=mimics,
        bodies_with=bodies_with,
        parts=tuple(_part_of(document, link) for link in links.values()),
        placed=placed_in(links, document.path),
        left_out=left_out,
        gravity=gravity,
        floats=floats,
        stated=stated,
        repeated=tuple(document.repeated.values()),
    )


def built_robot(
    document: ProblemList,
    *,
    name: str,
    root: Any,
    links: Elements,
    joints: Elements,
    mimics: Mapping[str, Mimic],
    bodies_with: Callable[[Collection[str]], tuple[RigidBody, ...]],
    parts: tuple[LinkPart, ...],
    placed: tuple[PlacedShape, ...],
    left_out: tuple[Omission, ...],
    gravity: Triple,
    floats: bool,
    pulls: tuple[ForceElement, ...] = (),
    stated: Mapping[str, object] = MappingProxyType({}),
    repeated: tuple[ReadError, ...] = (),
) -> Robot:
    """Return the robot of a file in any syntax, as `build_robot`.

    Args:
        document: the file, with its problems.
        root: its element, for problems of the whole file.
        links, joints: elements by the names of links and joints, for problems.
        pulls: forces along joints.
    """
    path, still = document.path, tuple[str, ...]()
    while not document.obstacles:
        bodies = bodies_with(still)
        followers = couplings({name: one for name, one in mimics.items() if name not in still})
        model = BodyModel(bodies=bodies, gravity=gravity, pulls=pulls, couplings=followers)
        model = replace(model, pulls=model.without(still).pulls)
        built = assemble(model)
        groups = _massless(document, root, built, links)
        more = _holdable(built.tree, groups, joints, mimics)
        if not more:
            for group in groups:
                _add_resting_problem(document, built.tree, group, links, joints)
            break
        still += more
    if document.obstacles:
        return refused(path, name, document.obstacles, parts=parts, left_out=left_out)
    held = (Omission(what=HELD, count=len(still), where=still),) if still else ()
    return Robot(
        name=name,
        file=path,
        tree=built.tree,
        parts=tuple(replace(part, body=built.tree.frames[part.name][0]) for part in parts),
        limits=built.limits,
        home=home_of(built.tree, built.limits),
        left_out=(*left_out, *held),
        obstacles=(),
        body_model=model,
        held=still,
        floats=floats,
        placed=placed,
        stated=dict(stated),  # a proxy can't be sent between processes
        repeated=repeated,
    )


def _massless(
    document: ProblemList, root: Any, built: Assembled, links: Elements
) -> tuple[tuple[int, ...], ...]:
    """Return groups of joints that move no inertia together; note other problems with masses."""
    for name in built.cancelled:
        document.add_problem(
            links[name],
            f"the masses of link {quote(name)} and of the links fixed to it add up "
            "to zero, with a negative one",
            "write a positive mass",
            kind="massless",
        )
    if document.obstacles:
        return ()
    groups, tree = massless_groups(built.tree, built.limits), built.tree
    if groups is None:
        document.add_problem(
            root,
            "its mass matrix is not finite",
            "write masses in kg and lengths in m",
        )
    if len(groups or ()) == len(tree.links) > 1:
        document.add_problem(
            root,
            f"none of its {len(tree.links)} joints moves anything with inertia: the "
            "file describes kinematics only",
            "give its links mass and inertia",
            kind="massless",
        )
        return ()
    return groups or ()


def _holdable(
    tree: Tree,
    groups: tuple[tuple[int, ...], ...],
    joints: Elements,
    mimics: Mapping[str, Mimic],
) -> tuple[str, ...]:
    """Return joints of these groups that have no acceleration by themselves, while others move.

    Engines fix such a joint, or refuse it. A joint that follows or leads a moving joint is
    excluded: its motion is known.
    """
    single = [tree.links[group[0]].name for group in groups if len(group) == 1]
    fixed = {name for name in single if name in joints}
    pairs = [(name, one.leader) for name, one in mimics.items()]
    while moved := {name for pair in pairs for name in pair if not fixed.issuperset(pair)} & fixed:
        fixed -= moved
    return tuple(name for name in single if name in fixed) if len(fixed) < len(tree.links) else ()


def _add_resting_problem(
    document: ProblemList,
    tree: Tree,
    group: tuple[int, ...],
    links: Elements,
    joints: Elements,
) -> None:
    names = [tree.links[i].name for i in group]
    first = joints.get(names[0])
    element = links[names[0]] if first is None else first
    document.add_problem(element, *_resting(names), kind="massless")


def _resting(names: list[str]) -> tuple[str, str]:
    """Return the message about joints that move no inertia, and its remedy."""
    listed = ", ".join(map(quote, names))
    if len(names) == 1:
        return (
            f"joint {listed} moves nothing with inertia, so its acceleration is undefined",
            "give the links that it carries mass and inertia",
        )
    return (
        f"a combined motion of the joints {listed} moves nothing with inertia, so "
        "their accelerations are undefined",
        "give a link between them inertia",
    )


def enforceable(mimics: Mapping[str, Mimic], single: Collection[str]) -> dict[str, Mimic]:
    """Return the mimics that every engine can enforce, by the follower's name.

    A gear constrains velocities. A mimic with an offset or a zero multiplier is therefore left
    free, and so is one whose leader is not a hinge or slide, or that follows itself through others.

    Args:
        mimics: all of them, by the follower's name.
        single: names of hinges and slides.
    """
    gears = {
        name: one
        for name, one in mimics.items()
        if name in single and one.leader in single and one.multiplier and not one.offset
    }
    return {name: one for name, one in gears.items() if not _circular(name, gears)}


def _circular(name: str, mimics: Mapping[str, Mimic]) -> bool:
    passed: set[str] = set()
    while name in mimics and name not in passed:
        passed.add(name)
        name = mimics[name].leader
    return name in passed


def placed_body(
    body: RigidBody, parent: str | None, place: Place, joints: tuple[Joint, ...] = ()
) -> RigidBody:
    """Return a body at a place in its parent, with its joints."""
    x, y, z = place.origin.tolist()
    turn = to_quaternion(place.rotation)
    return replace(body, parent=parent, position=(x, y, z), quaternion=turn, joints=joints)


def couplings(mimics: Mapping[str, Mimic]) -> tuple[Coupling, ...]:
    """Return mimics as couplings of joints."""
    return tuple(
        Coupling(follower=name, leader=one.leader, multiplier=one.multiplier)
        for name, one in mimics.items()
    )


def _part_of(document: Document, link: FileLink) -> LinkPart:
    """Return a link as a separate part."""
    line, stated = document.line(link.element), link.element.find("inertial/inertia")
    return LinkPart(link=link.body, line=line, rounding=_rounding(stated))


def _rounding(stated: XmlElement | None) -> float:
    """Return half units of the last digits of a tensor, in sum; zeros are exact."""
    total = 0.0
    if stated is None:
        return total
    for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"):
        with suppress(ArithmeticError):  # its reader reports it
            number = Decimal((stated.get(key) or stated.findtext(key)).strip())
            if number.is_finite() and number:
                half = Decimal(5 if key[1] == key[2] else 10)
                total += float(half.scaleb(int(number.as_tuple().exponent) - 1))
    return total
