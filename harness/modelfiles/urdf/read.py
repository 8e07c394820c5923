"""A URDF as a tree of bodies: any that has one, with all that is left out or in the way said."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.modelfiles.build_tree import elements_of, part_of, robot_of, settled
from physics_crosscheck.harness.modelfiles.document import EXPAND, Document, DocumentError
from physics_crosscheck.harness.modelfiles.robot import LeftOut, Robot, refused
from physics_crosscheck.harness.modelfiles.urdf.left_out import urdf_left_out
from physics_crosscheck.harness.modelfiles.urdf.parts import (
    read_joints,
    read_links,
    read_mimics,
    read_springs,
)
from physics_crosscheck.harness.modelfiles.urdf.root import IMPLICIT, root_of
from physics_crosscheck.harness.modelfiles.urdf.tree import held_still, planned
from physics_crosscheck.harness.results.status import counted
from physics_crosscheck.reference.mechanism.bodies import RigidBody, Triple

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
    parts = tuple(part_of(document, link.element, link.body) for link in links.values())
    mimics = read_mimics(document, joints)
    left_out = urdf_left_out(document, joints, springs, mimics)
    if document.obstacles or root is None:
        return refused(path, name, document.obstacles, parts=parts, left_out=left_out)
    if floating and root == IMPLICIT:
        floating = False
        left_out += (LeftOut(what="a free joint of the world", count=1, where=(root,)),)

    def bodies_with(still: Collection[str]) -> tuple[RigidBody, ...]:
        moving = held_still(joints, still)
        return planned(root, links, moving, floating).with_springs(springs)

    found = settled(document, elements_of(links), elements_of(joints), mimics, bodies_with, gravity)
    if document.obstacles:
        return refused(path, name, document.obstacles, parts=parts, left_out=left_out)
    return robot_of(
        found, name=name, file=path, parts=parts, left_out=left_out, gravity=gravity,
        floats=floating,
    )  # fmt: skip


def _check_document(document: Document) -> None:
    """What is no URDF, or not one yet."""
    root = document.root
    if root.tag != "robot":
        document.hinder(root, f"the root is <{root.tag}>, not <robot>", "give a URDF")
    xacro = [one for one in root.children if one.tag.startswith("xacro:")]
    if xacro:
        such = f"{counted(len(xacro), 'element')} such as <{xacro[0].tag}>"
        document.hinder(xacro[0], f"it is xacro source: {such}", EXPAND, "file")
    for inner in root.children:
        if inner.tag == "robot":
            document.hinder(inner, "a <robot> inside the <robot>", "keep one robot per file")
