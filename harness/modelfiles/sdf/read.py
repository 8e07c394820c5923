"""One model of an SDFormat file as a tree of bodies, with omissions and problems.

Content of an SDFormat file beyond the bodies and joints of one model, counted by kind.
"""

import re
from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType

import numpy as np

from physics_crosscheck.harness.documents.document import Document, read_numbers
from physics_crosscheck.harness.documents.elements import Number, XmlElement
from physics_crosscheck.harness.documents.errors import LocationError, ReadError
from physics_crosscheck.harness.documents.sdf.frames import WORLD, inverse, is_automatic
from physics_crosscheck.harness.documents.sdf.read import (
    AXES,
    SdfFile,
    SdfJoint,
    chosen_model,
    is_static,
    read_sdf,
)
from physics_crosscheck.reference.mechanism.assemble import assemble
from physics_crosscheck.reference.mechanism.bodies import Joint, RigidBody
from physics_crosscheck.reference.mechanism.tree import Tree
from ..build_tree import build_robot, enforceable, placed_body
from ..numbers import ModelFile, set_temporarily
from ..robot import CLOSING, FREE_MIMIC, Note, Omission, Robot, count_notes, refused

_READ: Mapping[str, Collection[str]] = MappingProxyType(
    {
        "world": ("model", "include", "gravity", "physics", "joint", "frame"),
        "physics": ("max_step_size", "real_time_factor", "real_time_update_rate"),
        "model": ("link", "joint", "frame", "pose", "static", "self_collide"),
        "frame": ("pose",),
        "link": ("inertial", "pose", "collision", "gravity", "self_collide"),
        "inertial": ("pose", "mass", "inertia", "density"),
        "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
        "joint": ("pose", "parent", "child", "thread_pitch", "screw_thread_pitch", *AXES),
        **dict.fromkeys(AXES, ("xyz", "dynamics", "limit", "mimic", "use_parent_model_frame")),
        "dynamics": ("damping", "friction", "spring_stiffness", "spring_reference"),
        "limit": ("lower", "upper", "effort", "velocity"),
        "mimic": ("multiplier", "offset", "reference"),
    }
)
"""The child elements that are read, by tag; the other children of these elements are reported."""

_MEANINGFUL_ATTRIBUTES: Mapping[str, Collection[str]] = MappingProxyType(
    {
        "world": ("name",),
        "physics": ("name", "type", "default"),
        "model": ("name", "canonical_link", "placement_frame"),
        "frame": ("name", "attached_to"),
        "link": ("name",),
        "inertial": ("auto",),
        "joint": ("name", "type"),
        "pose": ("relative_to", "rotation_format", "degrees"),
        "xyz": ("expressed_in",),
        "mimic": ("joint", "axis"),
    }
)
"""Attributes with a meaning, by the element's tag; others have none."""

_VISUALS = ("visual", "material", "light", "gui", "scene", "audio", "road")
_WHOLE = ("model", "include", "collision")
"""Elements that count as a whole, whatever their content."""


def sdf_left_out(file: SdfFile, followers: Collection[str]) -> tuple[Omission, ...]:
    """Return all of it, except visual geometry, which does not matter."""
    return count_notes(_all(file), followers)


def _all(file: SdfFile) -> Iterator[Note]:
    document, model, world = file.document, file.model, file.world
    for joint in file.joints.values():
        yield from _of_joint(joint, file.mimics)
    yield from ((CLOSING, one.name) for one in file.closing)
    for element in model.children:
        name = element.attributes.get("name", "")
        if any(part.tag == "collision" for part in element.children):
            yield "collision geometry", name
        yield from _of_automatic(element, name)
    yield from _unread(model, "")
    numbers = [one for surface in document.root.iter("surface") for one in surface.iter()]
    yield from ((f"<{one.tag}> of <surface>", "", one.place) for one in numbers if _is_ignored(one))
    for element in (*document.root.children, *(world.children if world is not None else ())):
        name = element.attributes.get("name", "")
        if element.tag == "model" and element is not model:
            yield "static model" if is_static(element) else "another model that moves", name
        elif element.tag == "include":
            name = next((one.text.strip() for one in element.children if one.tag == "uri"), "")
            yield "<include> of another file", name
    if world is not None:
        yield from _unread(world, world.attributes.get("name", ""))


def _is_ignored(number: XmlElement) -> bool:
    """Return whether a number of a surface is not one of friction, which some engine reads."""
    return bool(number.text.strip()) and number.tag not in ("mu", "mu2")


def _of_automatic(link: XmlElement, name: str) -> Iterator[Note]:
    """Yield elements that `<inertial auto="true">` makes meaningless."""
    for inertial in link.children:
        if inertial.tag == "inertial" and is_automatic(inertial):
            for part in inertial.children:
                if part.tag in ("pose", "inertia"):
                    yield f"<{part.tag}> of an automatic <inertial>", name


def _of_joint(joint: SdfJoint, mimics: Collection[str]) -> Iterator[Note]:
    if joint.joint is None:
        return
    if joint.joint.kind == "ball":
        for path in ("xyz", "limit", "dynamics/friction", "dynamics/spring_stiffness", "mimic"):
            if joint.element.find(f"axis/{path}") is not None:
                yield f"<{path.rpartition('/')[2]}> of a ball joint", joint.name
        return
    if joint.friction:
        yield "dry friction", joint.name
    if joint.name in mimics:
        yield FREE_MIMIC, joint.name
    if any(one.limits is not None for one in joint.joints):
        yield "limits of position", joint.name
    for key in ("effort", "velocity"):
        values = read_numbers(joint.element.findtext(f"axis/limit/{key}"), 1)
        if values is not None and values[0] > 0:
            yield f"limits of {key}", joint.name


def _unread(element: XmlElement, name: str) -> Iterator[Note]:
    """Yield elements and attributes within this element that have no meaning here."""
    meaningful = _MEANINGFUL_ATTRIBUTES.get(element.tag, ())
    for key, value in element.attributes.items():
        if key not in meaningful and value.strip() and not key.startswith("xmlns"):
            yield f"{key} of <{element.tag}>", name, element.attribute_place(key)
    readable = _READ.get(element.tag)
    for child in element.children:
        if child.tag in _VISUALS or (readable is not None and child.tag in _WHOLE):
            continue
        owner = name or child.attributes.get("name", "")
        if readable is None or child.tag not in readable:
            yield f"<{child.tag}> of <{element.tag}>", owner, child.place
        else:
            yield from _unread(child, owner)


def read_sdf_robot(
    path: Path, *, model: str = "", armatures: Mapping[str, float] = MappingProxyType({})
) -> Robot:
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
        armatures: as in `Document`.
    """
    try:
        document = Document(path)
    except LocationError as error:
        return refused(path, path.stem, [ReadError.unreadable(error, path)])
    document.armatures = armatures
    with np.errstate(all="ignore"):  # overflow is reported
        return read_document(document, model)


def read_document(document: Document, chosen: str = "") -> Robot:
    """Read a parsed file; `chosen` is the `model` of `read_sdf_robot`."""
    path, file = document.path, read_sdf(document, chosen)
    if file is None:
        return refused(path, path.stem, document.obstacles)
    rows = [(each, joint) for joint in file.joints.values() for each in joint.joints]
    single = {each.name for each, _ in rows if each.single}
    mimics = enforceable(file.mimics, single)
    return build_robot(
        document,
        name=file.model.get("name") or path.stem,
        links=file.links,
        joints={**file.joints, **{each.name: joint for each, joint in rows}},
        mimics=mimics,
        bodies_with=lambda still: tuple(_bodies(file, still)),
        left_out=sdf_left_out(file, mimics),
        gravity=file.gravity,
        floats=file.floats,
        stated={**file.stated, **({"model": chosen} if chosen else {})},
    )


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
        moving = tuple(one for one in joint.joints if not {joint.name, one.name} & {*still})
        parent = None if of_world else joint.parent
        yield placed_body(file.links[joint.child].body, parent, place, moving)
        waiting += reversed(below.get(joint.child, []))


_RELEVANT = re.compile(
    r"sdf/(world/)?(gravity|model/(pose|link/(pose|inertial/.*)|frame/pose"
    r"|joint/(pose|(screw_)?thread_pitch|axis2?/(xyz|dynamics/(damping|spring_\w+)|mimic/.*))))"
)
"""Numbers that affect a tree."""

_SHAPES = re.compile(r"sdf/(world/)?model/link/collision/(pose|density|geometry/.*)")
"""Numbers that affect it too if a link's inertia follows from its shapes."""


class SdfNumbers(ModelFile):
    """The numbers of an SDFormat file that has a tree.

    Args:
        path: of the file.
        model: name of one of several moving models; empty for a single one.
        held: joints that are fixed.
        armatures: as in `Document`.

    Attributes:
        numerals: those that do not belong to another model, in order.
    """

    def __init__(
        self,
        path: Path,
        model: str = "",
        held: Collection[str] = (),
        armatures: Mapping[str, float] = MappingProxyType({}),
    ) -> None:
        self._document, self._chosen, self._held = Document(path), model, held
        super().__init__([self._document])
        self._document.armatures = armatures
        model_element, _ = chosen_model(self._document, model)
        self.numerals = tuple(
            one for one in self.numerals if _model_of(one.element) in (None, model_element)
        )

    @cached_property
    def relevant_numbers(self) -> tuple[int, ...]:
        """Indices of the numbers that may affect the tree."""
        return tuple(i for i, one in enumerate(self.numerals) if _is_relevant(one))

    def tree(self, values: Mapping[int, float]) -> Tree | None:
        """Return the tree with other values of some numbers, by index, or None."""
        document = self._document
        count = len(document.obstacles)
        with ExitStack() as restored:
            for index, value in values.items():
                set_temporarily(self.numerals[index], value, restored)
            robot = read_document(document, self._chosen)
        del document.obstacles[count:]
        if not self._held or robot.tree is None or robot.body_model is None:
            return robot.tree
        return assemble(robot.body_model.without(self._held)).tree


def _above(element: XmlElement) -> Iterator[XmlElement]:
    """Yield an element and its ancestors, outwards."""
    above: XmlElement | None = element
    while above is not None:
        yield above
        above = above.parent


def _model_of(element: XmlElement) -> XmlElement | None:
    return next((one for one in [*_above(element)][::-1] if one.tag in ("model", "include")), None)


def _is_relevant(number: Number) -> bool:
    if _RELEVANT.fullmatch(number.path):
        return True
    link = next((above for above in _above(number.element) if above.tag == "link"), None)
    return (
        link is not None
        and _SHAPES.fullmatch(number.path) is not None
        and any(is_automatic(part) for part in link.children)
    )
