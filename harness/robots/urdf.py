"""A URDF as a tree of bodies: any that has one, with all that is left out or in the way said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from harness.files.brief import brief
from harness.robots.couplings import Mimic, couplings, read_mimics
from harness.robots.document import EXPAND, Document, DocumentError
from harness.robots.inertias import resting
from harness.robots.robot import LeftOut, Part, Robot, Told, home_of, refused
from harness.robots.urdf_left_out import HELD, urdf_left_out
from harness.robots.urdf_parts import UrdfJoint, UrdfLink, read_joints, read_links, read_springs
from harness.robots.urdf_root import IMPLICIT, root_of
from harness.robots.urdf_tree import held_still, planned
from reference.multibody.assemble import Assembled, assembled
from reference.multibody.bodies import Triple
from reference.multibody.tree import Tree

GRAVITY = (0.0, 0.0, -9.81)
"""m/s^2: a URDF says none."""


def read_urdf_robot(path: Path, *, gravity: Triple = GRAVITY, floating: bool = False) -> Robot:
    """Read a URDF, whole.

    A joint's frame stands in the parent link's by `<origin>`, whose rpy turns about the fixed axes
    x, y and z in that order; the child's frame is the joint's, moved along or about the direction
    of `<axis>`. Links that fixed joints weld are one body. What is not told is nothing: no mass,
    no damping, no turn; but for the axis, which is x.

    Args:
        path: of the file.
        gravity: m/s^2.
        floating: whether the root link moves freely, on a free joint that is called as it is;
            otherwise it is fixed to the world, as one called `world` always is.
    """
    try:
        document = Document(path)
    except DocumentError as error:
        return refused(path, path.stem, [error.obstacle])
    with np.errstate(all="ignore"):  # what overflows is told
        return _read(document, gravity, floating)


def _read(document: Document, gravity: Triple, floating: bool) -> Robot:
    path = document.path
    _check_document(document)
    links, joints, springs = read_links(document), read_joints(document), read_springs(document)
    root = root_of(document, links, joints)
    name = document.root.attributes.get("name") or path.stem
    parts = tuple(_part(document, link) for link in links.values())
    mimics = read_mimics(document, joints)
    left_out = urdf_left_out(document, joints, springs, mimics)
    if document.obstacles or root is None:
        return refused(path, name, document.obstacles, parts=parts, left_out=left_out)
    if floating and root == IMPLICIT:
        floating = False
        left_out += (LeftOut(what="a free joint of the world", count=1, where=(root,)),)
    still: tuple[str, ...] = ()
    while True:
        moving = held_still(joints, still)
        bodies = planned(root, links, moving, floating).with_springs(springs)
        held = couplings({name: one for name, one in mimics.items() if name not in still})
        found = assembled(bodies, gravity, couplings=held)
        groups = _massless(document, found, links)
        more = _holdable(found.tree, groups, joints, mimics)
        if not more:
            break
        still += more
    for group in groups:
        _hinder_resting(document, found.tree, group, links, joints)
    if document.obstacles:
        return refused(path, name, document.obstacles, parts=parts, left_out=left_out)
    if still:
        left_out += (LeftOut(what=HELD, count=len(still), where=still),)
    return Robot(
        name=name,
        file=path,
        tree=found.tree,
        parts=tuple(replace(part, body=found.bodies[part.name]) for part in parts),
        limits=found.limits,
        home=home_of(found.tree, found.limits),
        left_out=left_out,
        obstacles=(),
        told=Told(bodies=bodies, gravity=gravity, couplings=held),
        held=still,
        floats=floating,
    )


def _part(document: Document, link: UrdfLink) -> Part:
    return Part(
        name=link.name,
        line=document.line(link.element),
        mass=link.lump.mass,
        center=link.lump.center,
        inertia=link.lump.inertia,
    )


def _check_document(document: Document) -> None:
    """What is no URDF, or not one yet."""
    root = document.root
    if root.tag != "robot":
        document.hinder(root, f"the root is <{root.tag}>, not <robot>", "give a URDF")
    xacro = [one for one in root.children if one.tag.startswith("xacro:")]
    if xacro:
        such = f"{len(xacro)} elements such as <{xacro[0].tag}>"
        document.hinder(xacro[0], f"it is source for xacro: {such}", EXPAND)
    for inner in root.children:
        if inner.tag == "robot":
            document.hinder(inner, "a <robot> within the <robot>", "keep one robot a file")


def _massless(
    document: Document, found: Assembled, links: dict[str, UrdfLink]
) -> tuple[tuple[int, ...], ...]:
    """Groups of joints that move no inertia together; what else is wrong with masses is noted."""
    for name in found.cancelled:
        document.hinder(
            links[name].element,
            f"the mass of link {brief(name)} and of those that it is welded to is zero, by a"
            " negative one",
            "a mass is not negative",
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
            f"it has {len(tree.links)} joints and none moves anything that has inertia: it tells"
            " kinematics alone",
            "give its links mass and inertia",
        )
        return ()
    return groups or ()


def _holdable(
    tree: Tree,
    groups: tuple[tuple[int, ...], ...],
    joints: dict[str, UrdfJoint],
    mimics: dict[str, Mimic],
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
    links: dict[str, UrdfLink],
    joints: dict[str, UrdfJoint],
) -> None:
    names = [tree.links[i].name for i in group]
    first = joints.get(names[0])
    element = links[names[0]].element if first is None else first.element
    document.hinder(element, *_resting(names))


def _resting(names: list[str]) -> tuple[str, str]:
    """What is said of joints that move no inertia, and its remedy."""
    told = ", ".join(map(brief, names))
    if len(names) == 1:
        return (
            f"joint {told} moves nothing that has inertia, so it has no acceleration",
            "give what it carries mass and inertia",
        )
    return (
        f"a motion of the joints {told} together moves nothing that has inertia, so they have no"
        " accelerations",
        "give a link between them inertia",
    )
