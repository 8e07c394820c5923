"""A URDF as a tree of bodies, with omissions and problems."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.modelfiles.build_tree import (
    build_tree,
    elements_of,
    part_of,
    robot_of,
)
from physics_crosscheck.harness.modelfiles.document import EXPAND, Document, DocumentError
from physics_crosscheck.harness.modelfiles.robot import Omission, Robot, refused
from physics_crosscheck.harness.modelfiles.urdf.left_out import urdf_left_out
from physics_crosscheck.harness.modelfiles.urdf.parts import (
    read_joints,
    read_links,
    read_mimics,
    read_springs,
)
from physics_crosscheck.harness.modelfiles.urdf.root import IMPLICIT, root_of
from physics_crosscheck.harness.modelfiles.urdf.tree import fix_joints, plan_bodies
from physics_crosscheck.harness.results.status import counted
from physics_crosscheck.reference.mechanism.bodies import RigidBody, Triple

GRAVITY = (0.0, 0.0, -9.81)
"""m/s^2; a URDF does not state gravity."""


def read_urdf_robot(path: Path, *, gravity: Triple = GRAVITY, floating: bool = False) -> Robot:
    """Read a URDF completely.

    `<origin>` gives a joint's frame in the parent link's; its rpy rotates about the fixed axes x, y
    and z in that order. The child's frame is the joint's, moved along or about the direction of
    `<axis>`. Links on fixed joints form one body. Missing numbers are zero: no mass, no damping, no
    rotation. The default axis is x.

    Args:
        path: of the file.
        gravity: m/s^2.
        floating: whether the root link moves freely, on a free joint with its name; otherwise it is
            fixed to the world, like a link named `world`.
    """
    try:
        document = Document(path)
    except DocumentError as error:
        return refused(path, path.stem, [error.error])
    with np.errstate(all="ignore"):  # overflow is reported
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
        left_out += (Omission(what="a free joint of the world", count=1, where=(root,)),)

    def bodies_with(still: Collection[str]) -> tuple[RigidBody, ...]:
        moving = fix_joints(joints, still)
        return plan_bodies(root, links, moving, floating).with_springs(springs)

    build = build_tree(
        document, elements_of(links), elements_of(joints), mimics, bodies_with, gravity
    )
    if document.obstacles:
        return refused(path, name, document.obstacles, parts=parts, left_out=left_out)
    return robot_of(
        build, name=name, file=path, parts=parts, left_out=left_out, gravity=gravity,
        floats=floating,
    )  # fmt: skip


def _check_document(document: Document) -> None:
    """Note why a document is not a URDF, or not yet."""
    root = document.root
    if root.tag != "robot":
        document.add_problem(root, f"the root is <{root.tag}>, not <robot>", "give a URDF")
    xacro = [one for one in root.children if one.tag.startswith("xacro:")]
    if xacro:
        such = f"{counted(len(xacro), 'element')} such as <{xacro[0].tag}>"
        document.add_problem(xacro[0], f"it is xacro source: {such}", EXPAND, "file")
    for inner in root.children:
        if inner.tag == "robot":
            document.add_problem(inner, "a <robot> inside the <robot>", "keep one robot per file")
