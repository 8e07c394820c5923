"""A compiled file as bodies with joints and forces, each with its numbers.

Lines of shapes and sites in an MJCF and its includes.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.engines.compiled import (
    CompiledBody,
    CompiledForce,
    CompiledFrame,
    CompiledJoint,
    CompiledLength,
    CompiledTree,
)
from physics_crosscheck.harness.engines.mjcf_source import ORIENTATIONS, read_source_mjcf
from physics_crosscheck.harness.engines.protocol import EngineError
from physics_crosscheck.reference.mechanism.bodies import (
    ZERO,
    Coupling,
    ForceElement,
    Joint,
    Powers,
    Quaternion,
    RigidBody,
    Site,
    Triple,
)
from physics_crosscheck.reference.mechanism.force_paths import CablePath, FrameForce, JointForce
from physics_crosscheck.reference.mechanism.rotations import from_quaternion
from physics_crosscheck.reference.mechanism.spatial_inertia import Place
from physics_crosscheck.reference.mechanism.tree import Fluid, Kind, Tree
from ..robot import BodyModel, LinkPart, Omission, PlacedShape, Robot, home_of
from .classes import StatedClasses

_KINDS = ("geom", "site")


@dataclass(frozen=True, kw_only=True)
class ShapeLines:
    """Lines of a shape: of its element, and of the one that states its size, perhaps a default."""

    file: Path
    line: int = 0
    size: tuple[Path, int]


_Inherited = tuple[XmlElement, str]
"""An element, and the class of its bodies."""


def shape_lines(path: Path, names: Sequence[str]) -> Mapping[str, ShapeLines]:
    """Return the lines of each shape, by its place.

    Args:
        path: of the file.
        names: places of all shapes, in the engine's order: bodies depth first. Those without a name
            are matched by this order, if the file repeats no elements.
    """
    try:
        elements = list(_shapes(Document(path).root, path))
        classes = StatedClasses.from_source(read_source_mjcf(path))
    except (LocationError, EngineError, RecursionError):
        return {}
    chosen: dict[str, _Inherited] = {}
    for kind in _KINDS:
        rows = [one for one in elements if one[0].tag == kind]
        places = [name for name in names if name.startswith(f"{kind}:")]
        if len(rows) == len(places) and all(map(_fits, rows, places)):
            chosen |= dict(zip(places, rows, strict=True))
        else:
            named = {f"{kind}:{one.get('name')}": (one, above) for one, above in rows}
            chosen |= {name: named[name] for name in places if name in named}
    return {name: _lines(classes, path, *row) for name, row in chosen.items()}


def _lines(classes: StatedClasses, path: Path, element: XmlElement, inherited: str) -> ShapeLines:
    chain = classes.chain(element, inherited, (element.tag,)).elements

    def place(*keys: str) -> tuple[Path, int]:
        """Return the place of the first of these attributes that is stated, or of the element."""
        stated = (e.attribute_place(k) for k in keys for e in chain[::-1] if k in e.attributes)
        file, line = next(stated, element.place)
        return file or path, line or 0

    file, line = place("pos", "fromto", *ORIENTATIONS)
    return ShapeLines(file=file, line=line, size=place("size"))


def _fits(row: _Inherited, place: str) -> bool:
    name = place.partition(":")[2]
    return row[0].get("name", name) == name


def _shapes(root: XmlElement, path: Path) -> Iterator[_Inherited]:
    """Yield the shapes of all `<worldbody>` elements, body by body."""
    worlds = [one for one in _children(root, path) if one.tag == "worldbody"]
    yield from _within([row for world in worlds for row in _below(world, "", path)], path)


def _below(element: XmlElement, inherited: str, path: Path) -> Iterator[_Inherited]:
    """Yield the children of an element of a class."""
    inherited = element.get("childclass") or inherited
    yield from ((child, inherited) for child in _children(element, path))


def _within(elements: Sequence[_Inherited], path: Path) -> Iterator[_Inherited]:
    """Yield the shapes of one body, then those of the bodies in it."""
    flat = list(_flat(elements, path))
    yield from (row for row in flat if row[0].tag in _KINDS)
    for element, inherited in flat:
        if element.tag == "body":
            yield from _within(list(_below(element, inherited, path)), path)


def _flat(elements: Sequence[_Inherited], path: Path) -> Iterator[_Inherited]:
    """Yield elements and those within their frames."""
    for element, inherited in elements:
        yield element, inherited
        if element.tag == "frame":
            yield from _flat(list(_below(element, inherited, path)), path)


def _children(element: XmlElement, path: Path) -> Iterator[XmlElement]:
    """Yield children, with those of included files in place of `<include>`."""
    for child in element:
        if child.tag == "include":
            yield from _children(Document(path.parent / child.get("file")).root, path)
        else:
            yield child


KINDS: Mapping[str, Kind] = {
    "hinge": "hinge", "slide": "slide", "ball": "ball", "free": "free"
}  # fmt: skip

SPREAD = (5**0.5 - 1) / 2
"""The step of controls in their ranges; its multiples make all controls differ."""


def compiled_robot(
    compiled: CompiledTree,
    path: Path,
    left_out: tuple[Omission, ...],
    controls: Sequence[float] | None = None,
) -> Robot:
    """Return the robot, with its controls held at given values, or within their ranges.

    Raises:
        TreeError: naming the joint that is not covered.
    """
    controls = held_controls(compiled) if controls is None else tuple(controls)
    body_model = _body_model(compiled, controls)
    whole = body_model.assembled()
    return Robot(
        name=compiled.name or path.stem,
        file=path,
        tree=whole.tree,
        parts=tuple(
            LinkPart(link=body, line=0, body=whole.tree.frames[body.name][0])
            for body in body_model.bodies
        ),
        limits=whole.limits,
        home=home_of(whole.tree, whole.limits),
        left_out=left_out,
        obstacles=(),
        controls=controls,
        body_model=body_model,
        shapes=compiled.shapes,
        placed=tuple(placed_shapes(compiled, path)),
    )


def placed_shapes(compiled: CompiledTree, path: Path) -> Iterator[PlacedShape]:
    """Yield the shapes and sites, with their lines in a file whose elements are not repeated."""
    names = [None, *(body.name for body in compiled_bodies(compiled))]
    lines = shape_lines(path, [shape.name for shape in compiled.placed])
    for shape in compiled.placed:
        frame = shape.frame
        place = lines.get(shape.name, ShapeLines(file=path, size=(path, 0)))
        yield PlacedShape(
            name=shape.name,
            body=names[frame.body],
            place=Place(from_quaternion(np.array(frame.turn)), np.array(frame.position)),
            size=shape.size,
            file=place.file,
            line=place.line,
            size_place=place.size,
            kind=shape.kind,
            visual=shape.visual,
            mesh=shape.mesh,
            scale=shape.scale,
        )


def compiled_tree(
    compiled: CompiledTree, controls: Sequence[float], held: Collection[str] = ()
) -> Tree:
    """Return the tree under held controls, with some joints fixed.

    Raises:
        TreeError: naming the joint that is not covered.
    """
    return _body_model(compiled, controls).without(held).assembled().tree


def _body_model(compiled: CompiledTree, controls: Sequence[float]) -> BodyModel:
    bodies = compiled_bodies(compiled)
    return BodyModel(
        bodies=bodies,
        gravity=compiled.gravity,
        pulls=tuple(_pulls(compiled, bodies, controls)),
        couplings=tuple(_couplings(compiled, bodies)),
        fluid=_fluid(compiled),
    )


def _fluid(compiled: CompiledTree) -> Fluid | None:
    fluid = compiled.fluid
    if fluid is None:
        return None
    return Fluid(density=fluid.density, viscosity=fluid.viscosity, wind=fluid.wind)


def compiled_bodies(compiled: CompiledTree) -> tuple[RigidBody, ...]:
    """Return bodies in the engine's order; unnamed bodies get a name by index."""
    used_names = {body.name for body in compiled.bodies}
    names: list[str | None] = [None]
    bodies: list[RigidBody] = []
    count = 0
    for i, body in enumerate(compiled.bodies, start=1):
        name = body.name or f"body_{i}"
        while not body.name and name in used_names:
            name += "_"
        joints = tuple(_joint(one, count + k) for k, one in enumerate(body.joints))
        count += len(joints)
        bodies.append(_body(body, name, names[body.parent], joints))
        names.append(name)
    return tuple(bodies)


# A file is compiled once for each of its numbers, with mostly equal bodies.
@lru_cache(maxsize=1024)
def _body(
    body: CompiledBody, name: str, parent: str | None, joints: tuple[Joint, ...]
) -> RigidBody:
    """Return a body; a free body counts from the world, not from its drawn pose."""
    free = any(joint.kind == "free" for joint in joints)
    xx, yy, zz = body.moments
    return RigidBody(
        name=name,
        parent=parent,
        position=ZERO if free else _triple(body.position),
        quaternion=None if free else _quaternion(body.turn),
        joints=joints,
        mass=body.mass,
        center=_triple(body.centre),
        inertia=(xx, yy, zz, 0.0, 0.0, 0.0),
        inertia_quaternion=_quaternion(body.principal),
        lift=body.lift,
        dragged=body.dragged,
    )


@lru_cache(maxsize=1024)
def _joint(joint: CompiledJoint, index: int) -> Joint:
    kind, name = KINDS[joint.kind], joint.name or f"joint_{index}"
    if kind not in ("hinge", "slide"):
        anchor = _triple(joint.position) if kind == "ball" else ZERO
        return Joint(
            name=name,
            kind=kind,
            at=anchor,
            damping=_powers(joint.damping),
            stiffness=_powers(joint.stiffness),
            armature=joint.armature,
            rest_place=_triple(joint.rest_place),
            rest_turn=_quaternion(joint.rest_turn),
        )
    return Joint(
        name=name,
        kind=kind,
        axis=_triple(joint.axis),
        at=_triple(joint.position),
        zero=joint.zero,
        damping=_powers(joint.damping),
        stiffness=_powers(joint.stiffness),
        rest=joint.rest,
        armature=joint.armature,
        limits=joint.limits,
    )


def held_controls(compiled: CompiledTree) -> tuple[float, ...]:
    """Return a value within the range of each control; between 0 and 1 without a range."""
    ranges = {one.control: one.range for one in compiled.pulls if one.control >= 0}
    held = []
    for i in range(compiled.controls):
        low, high = ranges.get(i) or (0.0, 1.0)
        held.append(low + (high - low) * ((i + 1) * SPREAD % 1.0))
    return tuple(held)


def _pulls(
    compiled: CompiledTree, bodies: tuple[RigidBody, ...], controls: Sequence[float]
) -> Iterator[ForceElement]:
    names = tuple(joint.name for body in bodies for joint in body.joints)
    body_names = (None, *(body.name for body in bodies))
    for force in compiled.pulls:
        held = controls[force.control] if force.control >= 0 else 0.0
        yield _force_element(force, names, body_names, held)


def _along(
    length: CompiledLength | None, joints: Sequence[str], bodies: Sequence[str | None]
) -> CablePath[Site] | FrameForce[Site] | JointForce[str] | None:
    """Return a length by the names of the elements that it acts along."""
    if length is None:
        return None
    if length.joint >= 0:
        return JointForce(joint=joints[length.joint], gear=length.gear, in_parent=length.in_parent)

    def site(mark: CompiledFrame) -> Site:
        turn = _quaternion(mark.turn)
        return Site(body=bodies[mark.body], position=_triple(mark.position), quaternion=turn)

    if length.frame is None:
        return CablePath(branches=length.branches).mapped(site)
    return FrameForce(frame=length.frame, gear=length.gear, against=length.against).mapped(site)


def _couplings(compiled: CompiledTree, bodies: tuple[RigidBody, ...]) -> Iterator[Coupling]:
    names = [joint.name for body in bodies for joint in body.joints]
    for coupling in compiled.couplings:
        yield Coupling(
            follower=names[coupling.follower],
            leader=None if coupling.leader is None else names[coupling.leader],
            multiplier=coupling.multiplier,
            offset=coupling.offset,
            others=tuple((names[joint], share) for joint, share in coupling.others),
        )


@lru_cache(maxsize=1024)
def _force_element(
    force: CompiledForce, names: Sequence[str], bodies: Sequence[str | None], control: float
) -> ForceElement:
    return ForceElement(
        name=force.name,
        joints=tuple((names[i], share) for i, share in force.joints),
        bias=force.bias,
        gain=force.gain,
        along=_along(force.along, names, bodies),
        control=control,
        stiffness=_powers(force.stiffness),
        damping=_powers(force.damping),
        rest=force.rest,
        armature=force.armature,
    )


def _powers(values: tuple[float, ...]) -> Powers:
    """Return one number if the higher powers are zero."""
    return values if any(values[1:]) else (values[0] if values else 0.0)


def _triple(values: tuple[float, ...]) -> Triple:
    x, y, z = values
    return x, y, z


def _quaternion(values: tuple[float, ...]) -> Quaternion | None:
    """Return None for the identity."""
    w, x, y, z = values
    return None if (x, y, z) == ZERO else (w, x, y, z)
