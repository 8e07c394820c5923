"""One model of an SDFormat file as a tree of bodies, with omissions and problems."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.errors import LocationError, ReadError
from physics_crosscheck.harness.documents.sdf.frames import WORLD, inverse
from physics_crosscheck.harness.documents.sdf.read import SdfFile, SdfJoint, read_sdf
from physics_crosscheck.harness.modelfiles.build_tree import (
    build_tree,
    elements_of,
    enforceable,
    part_of,
    robot_of,
)
from physics_crosscheck.harness.modelfiles.robot import Robot, refused
from physics_crosscheck.harness.modelfiles.sdf.left_out import sdf_left_out
from physics_crosscheck.reference.mechanism.bodies import Joint, RigidBody
from physics_crosscheck.reference.mechanism.rotations import to_quaternion


def read_sdf_robot(path: Path, *, model: str = "") -> Robot:
    """Read one model of an SDFormat file completely.

    `sdf_frames` resolves poses. A joint moves its child along or about `<axis>`, which is in the
    joint's frame unless `expressed_in` names another (to 1.6: `use_parent_model_frame`; to 1.4
    always the model's). A model without a joint to `world` moves freely. Links without mass or
    moments have 1 kg and 1 kg m^2, as the format requires (http://sdformat.org/spec). Step and
    gravity are those of a `<world>`, if it states them. Static models and included files are left
    out.

    Args:
        path: of the file.
        model: name of one of several moving models; empty for a single one.
    """
    try:
        document = Document(path)
    except LocationError as error:
        return refused(path, path.stem, [ReadError.unreadable(error, path)])
    with np.errstate(all="ignore"):  # overflow is reported
        return read_document(document, model)


def read_document(document: Document, chosen: str = "") -> Robot:
    """Read a parsed file; `chosen` is the `model` of `read_sdf_robot`."""
    path, file = document.path, read_sdf(document, chosen)
    if file is None:
        return refused(path, path.stem, document.obstacles)
    name = file.model.get("name") or path.stem
    parts = tuple(part_of(document, link.element, link.body) for link in file.links.values())
    single = {one.name for one in file.joints.values() if one.joint is not None}
    mimics = enforceable(file.mimics, single)
    left_out = sdf_left_out(file, mimics)
    if document.obstacles:
        return refused(path, name, document.obstacles, parts=parts, left_out=left_out)
    build = build_tree(
        document,
        elements_of(file.links),
        elements_of(file.joints),
        mimics,
        lambda still: tuple(_bodies(file, still)),
        file.gravity,
    )
    if document.obstacles:
        return refused(path, name, document.obstacles, parts=parts, left_out=left_out)
    stated = {**file.stated, **({"model": chosen} if chosen else {})}
    return robot_of(
        build, name=name, file=path, parts=parts, left_out=left_out, gravity=file.gravity,
        floats=file.floats, stated=stated,
    )  # fmt: skip


def _bodies(file: SdfFile, still: Collection[str]) -> Iterator[RigidBody]:
    """Yield bodies depth first; a floating root counts from the world, not from its drawn pose."""
    below: dict[str, list[SdfJoint]] = {}
    for joint in file.joints.values():
        below.setdefault(joint.parent, []).append(joint)
    if file.floats:
        yield replace(file.links[file.root].body, joints=(Joint(name=file.base, kind="free"),))
    waiting = list(reversed(below.get(file.root, [])))
    while waiting:
        joint = waiting.pop()
        of_world = joint.parent == WORLD
        outer = file.frames.of_model() if of_world else inverse(file.frames.place(joint.parent))
        place = outer.compose(file.frames.place(joint.child))
        moving = joint.joint is not None and joint.name not in still
        x, y, z = place.origin.tolist()
        yield replace(
            file.links[joint.child].body,
            parent=None if of_world else joint.parent,
            position=(x, y, z),
            quaternion=to_quaternion(place.rotation),
            joints=(joint.joint,) if moving and joint.joint is not None else (),
        )
        waiting += reversed(below.get(joint.child, []))
