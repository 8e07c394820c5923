"""One model of an SDFormat file as a tree of bodies, with what is left out and what hinders it."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.modelfiles.attach import hang, hinder_loops
from physics_crosscheck.harness.modelfiles.build_tree import elements_of, part_of, robot_of, settled
from physics_crosscheck.harness.modelfiles.document import Document, DocumentError
from physics_crosscheck.harness.modelfiles.locations.xml import RawElement
from physics_crosscheck.harness.modelfiles.quote import brief
from physics_crosscheck.harness.modelfiles.robot import Robot, refused
from physics_crosscheck.harness.modelfiles.sdf.frames import WORLD, Frames
from physics_crosscheck.harness.modelfiles.sdf.left_out import is_static, sdf_left_out
from physics_crosscheck.harness.modelfiles.sdf.parts import (
    SdfJoint,
    SdfLink,
    bodies_of,
    read_joints,
    read_links,
)
from physics_crosscheck.harness.modelfiles.sdf.parts import read_mimics as read_sdf_mimics
from physics_crosscheck.harness.modelfiles.urdf.read import GRAVITY
from physics_crosscheck.reference.mechanism.bodies import RigidBody, Triple

_UNCOVERED: Mapping[str, str] = {
    "include": "write what it includes into the file (gz sdf -p FILE)",
    "model": "write the links of both into one model",
    "axis2": "write two joints",
    "gearbox_ratio": "remove the gearbox",
    "thread_pitch": "remove the screw",
}

_OPAQUE = ("plugin", "sensor", "visual", "collision")
"""Parts of a model that hold no bodies and no joints, whatever stands in them."""


def read_sdf_robot(path: Path, *, model: str = "") -> Robot:
    """Read one model of an SDFormat file, whole.

    Poses are resolved as `sdf_frames` says. A joint moves its child along or about `<axis>`, which
    is told in the joint's frame unless `expressed_in` names another (to 1.6:
    `use_parent_model_frame`; to 1.4 always the model's). A model that no joint holds to `world`
    moves freely. Links without mass or moments have 1 kg and 1 kg m^2, as the format says
    (http://sdformat.org/spec). Step and gravity are those of a `<world>`, where it states them.
    Static models and files that a world includes are left out.

    Args:
        path: of the file.
        model: which of several models that move; empty: the only one.
    """
    try:
        document = Document(path)
    except DocumentError as error:
        return refused(path, path.stem, [error.obstacle])
    with np.errstate(all="ignore"):  # what overflows is told
        return read_document(document, model)


def read_document(document: Document, chosen: str = "") -> Robot:
    """Read a file that is parsed; `chosen` as the model of `read_sdf_robot`."""
    path = document.path
    model, world = chosen_model(document, chosen)
    if model is None:
        return refused(path, path.stem, document.obstacles)
    name = model.attributes.get("name") or path.stem
    frames = Frames(document, model)
    links, joints = read_links(document, frames), read_joints(document, frames)
    root = _root(document, model, links, joints)
    parts = tuple(part_of(document, link.element, link.body) for link in links.values())
    mimics = read_sdf_mimics(document, joints)
    left_out = sdf_left_out(document, model, world, joints, mimics)
    stated, gravity = _stated(document, world)
    if chosen:
        stated["model"] = chosen
    if not document.obstacles:
        for one in (*links, *joints):
            frames.place(one)
        frames.of_model()
    if document.obstacles or root is None:
        return refused(path, name, document.obstacles, parts=parts, left_out=left_out)
    ground: str = root

    def bodies_with(still: Collection[str]) -> tuple[RigidBody, ...]:
        return tuple(bodies_of(frames, ground, links, joints, still))

    found = settled(document, elements_of(links), elements_of(joints), mimics, bodies_with, gravity)
    if document.obstacles:
        return refused(path, name, document.obstacles, parts=parts, left_out=left_out)
    return robot_of(
        found, name=name, file=path, parts=parts, left_out=left_out, gravity=gravity,
        floats=root != WORLD, stated=stated,
    )  # fmt: skip


def chosen_model(
    document: Document, chosen: str = ""
) -> tuple[RawElement | None, RawElement | None]:
    """Return the model, and the world in which it stands; what hinders is noted.

    Args:
        document: the file.
        chosen: the model's name; empty: the only one that moves.
    """
    root = document.root
    if root.tag != "sdf":
        document.hinder(root, f"the root is <{root.tag}>, not <sdf>", "give an SDFormat file")
        return None, None
    worlds = [one for one in root.children if one.tag == "world"]
    for one in worlds[1:]:
        document.hinder(one, "a second <world> of one file", "keep one")
    model = _only_model(document, chosen, [root, *worlds])
    for one in (joint for world in worlds for joint in world.children if joint.tag == "joint"):
        document.hinder(
            one,
            "a <joint> between models is not covered",
            "write both into one model",
            "unsupported",
        )
    if model is None:
        return None, None
    for one in _within(model):
        if one.tag in _UNCOVERED:
            document.hinder(one, f"<{one.tag}> is not covered", _UNCOVERED[one.tag], "unsupported")
    return model, worlds[0] if worlds else None


def _only_model(
    document: Document, chosen: str, holders: Sequence[RawElement]
) -> RawElement | None:
    """Return the one model that moves, or that is chosen by its name; else note why there is none.

    Files that are included beside it are left out: nothing but a joint of the world, which is
    refused, would let one of their models act on it.
    """
    models = [one for holder in holders for one in holder.children if one.tag == "model"]
    moving = [one for one in models if not is_static(one)]
    found = [one for one in moving if not chosen or one.attributes.get("name") == chosen]
    names = ", ".join(brief(one.attributes.get("name", "")) for one in moving[:_NAMED])
    names += ", ..." if len(moving) > _NAMED else ""
    includes = [one for holder in holders for one in holder.children if one.tag == "include"]
    if len(found) == 1:
        return found[0]
    if chosen and moving:
        what = f"{len(found)} models" if found else "no moving model"
        document.hinder(
            found[1] if found else holders[0],
            f"it has {what} of the name {brief(chosen)}",
            f"choose one of {names}",
        )
    elif found:
        document.hinder(
            found[1],
            f"it has {len(found)} models that move: {names}",
            "choose one: crosscheck run --model NAME FILE",
        )
    elif includes:
        document.hinder(
            includes[0],
            "<include> is not covered, and the file itself has no moving model",
            _UNCOVERED["include"],
            "unsupported",
        )
    elif models:
        static = next(one for one in models[0].children if one.tag == "static")
        what = "the model is" if len(models) == 1 else "all models are"
        document.hinder(static, f"{what} static, so nothing moves", "give another")
    else:
        document.hinder(holders[0], "it has no <model>", "add one")
    return None


_NAMED = 8
"""Models named in a sentence."""


def _within(element: RawElement) -> Iterator[RawElement]:
    for child in element.children:
        if child.tag not in _OPAQUE:
            yield child
            yield from _within(child)


def _root(
    document: Document,
    model: RawElement,
    links: Mapping[str, SdfLink],
    joints: Mapping[str, SdfJoint],
) -> str | None:
    """The link that floats and carries all others, or `world`; None where neither does."""
    above: dict[str, str] = {}
    for joint in joints.values():
        hang(document, above, joint.element, joint.name, (joint.parent, joint.child))
    if not links:
        document.hinder(model, "it has no <link>", "add at least one")
    hinder_loops(document, links, above, elements_of(links))
    loose = [name for name in links if name not in above]
    if len(loose) > 1 or (loose and WORLD in above.values()):
        document.hinder(
            links[loose[-1]].element,
            f"no joint holds {', '.join(map(brief, loose))}",
            "give every link except one a joint",
        )
    return loose[0] if loose else WORLD


def _stated(
    document: Document, world: RawElement | None
) -> tuple[dict[str, object], tuple[float, float, float]]:
    """Settings that a world states, and its gravity."""
    found: dict[str, object] = {}
    gravity: Triple = GRAVITY
    if world is None:
        return found, gravity
    told, physics = document.child(world, "gravity"), document.child(world, "physics")
    if told is not None and told.text.strip():
        x, y, z = document.text_numbers(told, GRAVITY, "the world")
        gravity = x, y, z
        found["gravity"] = [x, y, z]
    step = None if physics is None else document.child(physics, "max_step_size")
    if step is not None and step.text.strip():
        found["step"] = document.text_numbers(step, (0.001,), "the world")[0]
    return found, gravity
