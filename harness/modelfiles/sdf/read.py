"""One model of an SDFormat file as a tree of bodies, with omissions and problems."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import quote
from physics_crosscheck.harness.documents.sdf import WORLD
from physics_crosscheck.harness.modelfiles.attach import add_loop_problems, attach_child
from physics_crosscheck.harness.modelfiles.build_tree import (
    build_tree,
    elements_of,
    part_of,
    robot_of,
)
from physics_crosscheck.harness.modelfiles.document import Document, DocumentError
from physics_crosscheck.harness.modelfiles.robot import Robot, refused
from physics_crosscheck.harness.modelfiles.sdf.frames import SdfFrames
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
"""Elements of a model without bodies and joints, whatever their content."""


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
    except DocumentError as error:
        return refused(path, path.stem, [error.error])
    with np.errstate(all="ignore"):  # overflow is reported
        return read_document(document, model)


def read_document(document: Document, chosen: str = "") -> Robot:
    """Read a parsed file; `chosen` is the `model` of `read_sdf_robot`."""
    path = document.path
    model, world = chosen_model(document, chosen)
    if model is None:
        return refused(path, path.stem, document.obstacles)
    name = model.attributes.get("name") or path.stem
    frames = SdfFrames(document, model)
    links, joints = read_links(document, frames), read_joints(document, frames)
    root = _root(document, model, links, joints)
    parts = tuple(part_of(document, link.element, link.body) for link in links.values())
    mimics = read_sdf_mimics(document, joints)
    left_out = sdf_left_out(document, model, world, joints, mimics)
    stated, gravity = _stated(document, world)
    if chosen:
        stated["model"] = chosen
    if not document.obstacles:
        for frame_name in (*links, *joints):
            frames.place(frame_name)
        frames.of_model()
    if document.obstacles or root is None:
        return refused(path, name, document.obstacles, parts=parts, left_out=left_out)
    ground: str = root

    def bodies_with(still: Collection[str]) -> tuple[RigidBody, ...]:
        return tuple(bodies_of(frames, ground, links, joints, still))

    build = build_tree(
        document, elements_of(links), elements_of(joints), mimics, bodies_with, gravity
    )
    if document.obstacles:
        return refused(path, name, document.obstacles, parts=parts, left_out=left_out)
    return robot_of(
        build, name=name, file=path, parts=parts, left_out=left_out, gravity=gravity,
        floats=root != WORLD, stated=stated,
    )  # fmt: skip


def chosen_model(
    document: Document, chosen: str = ""
) -> tuple[XmlElement | None, XmlElement | None]:
    """Return the model, and the world that contains it; problems are noted.

    Args:
        document: the file.
        chosen: the model's name; empty for the single moving one.
    """
    root = document.root
    if root.tag != "sdf":
        document.add_problem(root, f"the root is <{root.tag}>, not <sdf>", "give an SDFormat file")
        return None, None
    worlds = [element for element in root.children if element.tag == "world"]
    for element in worlds[1:]:
        document.add_problem(element, "a second <world> of one file", "keep one")
    model = _only_model(document, chosen, [root, *worlds])
    for element in (joint for world in worlds for joint in world.children if joint.tag == "joint"):
        document.add_problem(
            element,
            "a <joint> between models is not covered",
            "write both into one model",
            "unsupported",
        )
    if model is None:
        return None, None
    for element in _within(model):
        if element.tag in _UNCOVERED:
            document.add_problem(
                element, f"<{element.tag}> is not covered", _UNCOVERED[element.tag], "unsupported"
            )
    return model, worlds[0] if worlds else None


def _only_model(
    document: Document, chosen: str, holders: Sequence[XmlElement]
) -> XmlElement | None:
    """Return the single moving model, or the one with the chosen name; else note the problem.

    Included files are left out: they could act on the model only through a joint of the world,
    which is refused.
    """
    models = [one for holder in holders for one in holder.children if one.tag == "model"]
    moving = [one for one in models if not is_static(one)]
    candidates = [one for one in moving if not chosen or one.attributes.get("name") == chosen]
    names = ", ".join(quote(one.attributes.get("name", "")) for one in moving[:_NAMED])
    names += ", ..." if len(moving) > _NAMED else ""
    includes = [one for holder in holders for one in holder.children if one.tag == "include"]
    if len(candidates) == 1:
        return candidates[0]
    if chosen and moving:
        what = f"{len(candidates)} models" if candidates else "no moving model"
        document.add_problem(
            candidates[1] if candidates else holders[0],
            f"it has {what} of the name {quote(chosen)}",
            f"choose one of {names}",
        )
    elif candidates:
        document.add_problem(
            candidates[1],
            f"it has {len(candidates)} models that move: {names}",
            "choose one: crosscheck run --model NAME FILE",
        )
    elif includes:
        document.add_problem(
            includes[0],
            "<include> is not covered, and the file itself has no moving model",
            _UNCOVERED["include"],
            "unsupported",
        )
    elif models:
        static = next(one for one in models[0].children if one.tag == "static")
        what = "the model is" if len(models) == 1 else "all models are"
        document.add_problem(static, f"{what} static, so nothing moves", "give another")
    else:
        document.add_problem(holders[0], "it has no <model>", "add one")
    return None


_NAMED = 8
"""The most models that a sentence names."""


def _within(element: XmlElement) -> Iterator[XmlElement]:
    for child in element.children:
        if child.tag not in _OPAQUE:
            yield child
            yield from _within(child)


def _root(
    document: Document,
    model: XmlElement,
    links: Mapping[str, SdfLink],
    joints: Mapping[str, SdfJoint],
) -> str | None:
    """Return the floating root link, or `world`; None if neither is a unique root."""
    above: dict[str, str] = {}
    for joint in joints.values():
        attach_child(document, above, joint.element, joint.name, (joint.parent, joint.child))
    if not links:
        document.add_problem(model, "it has no <link>", "add at least one")
    add_loop_problems(document, links, above, elements_of(links))
    loose = [name for name in links if name not in above]
    if len(loose) > 1 or (loose and WORLD in above.values()):
        document.add_problem(
            links[loose[-1]].element,
            f"no joint holds {', '.join(map(quote, loose))}",
            "give every link except one a joint",
        )
    return loose[0] if loose else WORLD


def _stated(
    document: Document, world: XmlElement | None
) -> tuple[dict[str, object], tuple[float, float, float]]:
    """Return settings that a world states, and its gravity."""
    settings: dict[str, object] = {}
    gravity: Triple = GRAVITY
    if world is None:
        return settings, gravity
    gravity_element, physics = document.child(world, "gravity"), document.child(world, "physics")
    if gravity_element is not None and gravity_element.text.strip():
        x, y, z = document.text_numbers(gravity_element, GRAVITY, "the world")
        gravity = x, y, z
        settings["gravity"] = [x, y, z]
    step = None if physics is None else document.child(physics, "max_step_size")
    if step is not None and step.text.strip():
        settings["step"] = document.text_numbers(step, (0.001,), "the world")[0]
    return settings, gravity
