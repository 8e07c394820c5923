"""Bodies of a file as a tree; joints that move nothing are held where that alone is amiss."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Protocol

from physics_crosscheck.harness.modelfiles.couplings import Mimic, couplings
from physics_crosscheck.harness.modelfiles.document import Document
from physics_crosscheck.harness.modelfiles.inertias import resting
from physics_crosscheck.harness.modelfiles.left_out import HELD
from physics_crosscheck.harness.modelfiles.locations.xml import RawElement
from physics_crosscheck.harness.modelfiles.quote import brief
from physics_crosscheck.harness.modelfiles.robot import LeftOut, Part, Robot, Told, home_of
from physics_crosscheck.reference.mechanism.assemble import Assembled, assembled
from physics_crosscheck.reference.mechanism.bodies import Coupling, RigidBody, Triple
from physics_crosscheck.reference.mechanism.tree import Tree

Elements = Mapping[str, RawElement]
"""By the names of links or joints."""


@dataclass(frozen=True, kw_only=True)
class Settled:
    """A tree that has accelerations, unless the document says what is in the way.

    Attributes:
        found: the tree.
        bodies, couplings: of which it is assembled.
        still: joints that stand still, since they move nothing that has inertia.
    """

    found: Assembled
    bodies: Sequence[RigidBody]
    couplings: tuple[Coupling, ...]
    still: tuple[str, ...]


def settled(
    document: Document,
    links: Elements,
    joints: Elements,
    mimics: Mapping[str, Mimic],
    bodies_with: Callable[[Collection[str]], tuple[RigidBody, ...]],
    gravity: Triple,
) -> Settled:
    """Assemble bodies; what is wrong with masses is noted in the document.

    Args:
        document: the file.
        links, joints: where they stand.
        mimics: joints that follow others.
        bodies_with: the bodies, with joints of these names held still.
        gravity: m/s^2.
    """
    still: tuple[str, ...] = ()
    while True:
        bodies = bodies_with(still)
        held = couplings({name: one for name, one in mimics.items() if name not in still})
        found = assembled(bodies, gravity, couplings=held)
        groups = _massless(document, found, links)
        more = _holdable(found.tree, groups, joints, mimics)
        if not more:
            break
        still += more
    for group in groups:
        _hinder_resting(document, found.tree, group, links, joints)
    return Settled(found=found, bodies=bodies, couplings=held, still=still)


def _massless(document: Document, found: Assembled, links: Elements) -> tuple[tuple[int, ...], ...]:
    """Groups of joints that move no inertia together; what else is wrong with masses is noted."""
    for name in found.cancelled:
        document.hinder(
            links[name],
            f"the masses of link {brief(name)} and of the links fixed to it add up "
            "to zero, with a negative one",
            "write a positive mass",
        )
    if document.obstacles:
        return ()
    groups, tree = resting(found.tree, found.limits), found.tree
    if groups is None:
        document.hinder(
            document.root,
            "its mass matrix is not finite",
            "write masses in kg and lengths in m",
        )
    if len(groups or ()) == len(tree.links) > 1:
        document.hinder(
            document.root,
            f"none of its {len(tree.links)} joints moves anything with inertia: the "
            "file describes kinematics only",
            "give its links mass and inertia",
        )
        return ()
    return groups or ()


def _holdable(
    tree: Tree,
    groups: tuple[tuple[int, ...], ...],
    joints: Elements,
    mimics: Mapping[str, Mimic],
) -> tuple[str, ...]:
    """Of those groups, joints that have no acceleration each on its own, while others move.

    Engines hold such a joint still, or refuse it. One that follows or leads a joint that does move
    is none: what that one moves is known.
    """
    alone = [tree.links[group[0]].name for group in groups if len(group) == 1]
    found = {name for name in alone if name in joints}
    pairs = [(name, one.leader) for name, one in mimics.items()]
    while moved := {name for pair in pairs for name in pair if not found.issuperset(pair)} & found:
        found -= moved
    return tuple(name for name in alone if name in found) if len(found) < len(tree.links) else ()


def _hinder_resting(
    document: Document,
    tree: Tree,
    group: tuple[int, ...],
    links: Elements,
    joints: Elements,
) -> None:
    names = [tree.links[i].name for i in group]
    first = joints.get(names[0])
    element = links[names[0]] if first is None else first
    document.hinder(element, *_resting(names))


def _resting(names: list[str]) -> tuple[str, str]:
    """What is said of joints that move no inertia, and its remedy."""
    told = ", ".join(map(brief, names))
    if len(names) == 1:
        return (
            f"joint {told} moves nothing with inertia, so its acceleration is undefined",
            "give the links that it carries mass and inertia",
        )
    return (
        f"a combined motion of the joints {told} moves nothing with inertia, so "
        "their accelerations are undefined",
        "give a link between them inertia",
    )


class Named(Protocol):
    """A link or a joint that was read."""

    @property
    def element(self) -> RawElement:
        """Where it stands."""


def elements_of(named: Mapping[str, Named]) -> Elements:
    """Where links or joints stand."""
    return {name: one.element for name, one in named.items()}


def part_of(document: Document, element: RawElement, body: RigidBody) -> Part:
    """A link by itself."""
    lump = body.spatial_inertia
    return Part(
        name=body.name,
        line=document.line(element),
        mass=lump.mass,
        center=lump.center,
        inertia=lump.inertia,
    )


def robot_of(
    one: Settled,
    *,
    name: str,
    file: Path,
    parts: tuple[Part, ...],
    left_out: tuple[LeftOut, ...],
    gravity: Triple,
    floats: bool,
    stated: Mapping[str, object] = MappingProxyType({}),
) -> Robot:
    """The robot of a tree; the arguments are its attributes."""
    found, still = one.found, one.still
    held = (LeftOut(what=HELD, count=len(still), where=still),) if still else ()
    return Robot(
        name=name,
        file=file,
        tree=found.tree,
        parts=tuple(replace(part, body=found.bodies[part.name]) for part in parts),
        limits=found.limits,
        home=home_of(found.tree, found.limits),
        left_out=(*left_out, *held),
        obstacles=(),
        told=Told(bodies=tuple(one.bodies), gravity=gravity, couplings=one.couplings),
        held=still,
        floats=floats,
        stated=dict(stated),  # a proxy can not be sent between processes
    )
