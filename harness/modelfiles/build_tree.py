"""The bodies of a file as a tree; joints without inertia are fixed if that makes it valid."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path
from types import MappingProxyType
from typing import Protocol

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import quote
from physics_crosscheck.harness.documents.tree import Mimic
from physics_crosscheck.reference.mechanism.assemble import Assembled, assembled
from physics_crosscheck.reference.mechanism.bodies import Coupling, RigidBody, Triple
from physics_crosscheck.reference.mechanism.tree import Tree
from .inertias import massless_groups
from .robot import HELD, BodyModel, LinkPart, Omission, PlacedShape, Robot, home_of

Elements = Mapping[str, XmlElement]
"""Elements by the names of links or joints."""


@dataclass(frozen=True, kw_only=True)
class TreeBuild:
    """A tree with accelerations, unless the document has problems.

    Attributes:
        assembled: the tree.
        bodies, couplings: its parts.
        still: joints that are fixed, since they move nothing that has inertia.
    """

    assembled: Assembled
    bodies: Sequence[RigidBody]
    couplings: tuple[Coupling, ...]
    still: tuple[str, ...]


def build_tree(
    document: Document,
    links: Elements,
    joints: Elements,
    mimics: Mapping[str, Mimic],
    bodies_with: Callable[[Collection[str]], tuple[RigidBody, ...]],
    gravity: Triple,
) -> TreeBuild:
    """Assemble bodies; problems with masses are noted in the document.

    Args:
        document: the file.
        links, joints: their elements.
        mimics: joints that follow others.
        bodies_with: a function that returns the bodies, with joints of these names fixed.
        gravity: m/s^2.
    """
    still: tuple[str, ...] = ()
    while True:
        bodies = bodies_with(still)
        held = couplings({name: one for name, one in mimics.items() if name not in still})
        tree = assembled(bodies, gravity, couplings=held)
        groups = _massless(document, tree, links)
        more = _holdable(tree.tree, groups, joints, mimics)
        if not more:
            break
        still += more
    for group in groups:
        _add_resting_problem(document, tree.tree, group, links, joints)
    return TreeBuild(assembled=tree, bodies=bodies, couplings=held, still=still)


def _massless(document: Document, built: Assembled, links: Elements) -> tuple[tuple[int, ...], ...]:
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
            document.root,
            "its mass matrix is not finite",
            "write masses in kg and lengths in m",
        )
    if len(groups or ()) == len(tree.links) > 1:
        document.add_problem(
            document.root,
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
    document: Document,
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


def couplings(mimics: Mapping[str, Mimic]) -> tuple[Coupling, ...]:
    """Return mimics as couplings of joints."""
    return tuple(
        Coupling(follower=name, leader=one.leader, multiplier=one.multiplier)
        for name, one in mimics.items()
    )


class Named(Protocol):
    """A link or a joint that was read."""

    @property
    def element(self) -> XmlElement:
        """Its element in the file."""


def elements_of(named: Mapping[str, Named]) -> Elements:
    """Return the elements of links or joints."""
    return {name: one.element for name, one in named.items()}


def part_of(document: Document, element: XmlElement, body: RigidBody) -> LinkPart:
    """Return a link as a separate part."""
    stated = element.find("inertial/inertia")
    return LinkPart(link=body, line=document.line(element), rounding=_rounding(stated))


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


def robot_of(
    build: TreeBuild,
    *,
    name: str,
    file: Path,
    parts: tuple[LinkPart, ...],
    left_out: tuple[Omission, ...],
    gravity: Triple,
    floats: bool,
    placed: tuple[PlacedShape, ...] = (),
    stated: Mapping[str, object] = MappingProxyType({}),
) -> Robot:
    """Return the robot of a tree; the arguments are its attributes."""
    built, still = build.assembled, build.still
    held = (Omission(what=HELD, count=len(still), where=still),) if still else ()
    return Robot(
        name=name,
        file=file,
        tree=built.tree,
        parts=tuple(replace(part, body=built.tree.frames[part.name][0]) for part in parts),
        limits=built.limits,
        home=home_of(built.tree, built.limits),
        left_out=(*left_out, *held),
        obstacles=(),
        body_model=BodyModel(
            bodies=tuple(build.bodies), gravity=gravity, couplings=build.couplings
        ),
        held=still,
        floats=floats,
        placed=placed,
        stated=dict(stated),  # a proxy can't be sent between processes
    )
