"""Facts about a robot's file that plausibility compares: bodies with hulls, joints, lines."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.documents.document import Document, finite_numbers
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.expanded import locate_file
from physics_crosscheck.harness.engines.compiled import CompiledTree
from physics_crosscheck.harness.engines.protocol import EngineError
from physics_crosscheck.harness.modelfiles.mesh_files import (
    MeshError,
    mesh_vertices,
)
from physics_crosscheck.harness.modelfiles.mjcf.read import compiler, parts_of
from physics_crosscheck.harness.modelfiles.robot import LinkPart, PlacedShape, Robot
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.finding import PlausibilityKind
from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.mechanism.bodies import Joint
from physics_crosscheck.reference.mechanism.rotations import (
    IDENTITY,
    NO_INERTIA,
    Array,
    Place,
    SpatialInertia,
)
from physics_crosscheck.reference.mechanism.tree import WORLD, Tree, TreeLink
from .hull import SOLIDS, Hull, extreme_points, hull_of, placed_points, scaled, solid_points

COMPILED = ".xml"
"""Suffix of the files in which the world has shapes of its own."""


@dataclass(frozen=True, kw_only=True)
class Advice:
    """An implausible number.

    Attributes:
        kind: of the finding.
        subject: names of links or joints.
        message: the number, what would be expected, and what to do.
        line: of the file.
        expected, actual: the numbers; None without one.
        excess: how far it is from plausible, for the order; 1 is the threshold.
    """

    kind: PlausibilityKind
    subject: tuple[str, ...]
    message: str
    line: SourceLine
    expected: float | None = None
    actual: float | None = None
    excess: float = 1.0


@dataclass(frozen=True, eq=False)
class WeldedBody:
    """Links that move as one body.

    Attributes:
        parts: its links, heaviest first.
        joint: name of the joint that moves it; empty for a body that is fixed to the world.
        inertia: its mass, center and moments of inertia, in the body's frame.
        shapes: of its links.
        frames: of its links, in the body's.
    """

    parts: tuple[LinkPart, ...]
    joint: str
    inertia: SpatialInertia
    shapes: tuple[PlacedShape, ...]
    frames: Mapping[str, Place]

    @property
    def name(self) -> str:
        """Name of its heaviest link."""
        return self.parts[0].name

    @property
    def has_mesh(self) -> bool:
        """True if a shape is a mesh."""
        return any(shape.kind == "mesh" for shape in self.shapes)

    @cached_property
    def hull(self) -> Hull | None:
        """Hull of the shapes that collide, or of all without any, in the body's frame."""
        return self._hull([one for one in self.shapes if not one.visual]) or self.whole_hull

    @cached_property
    def whole_hull(self) -> Hull | None:
        """Hull of all shapes; None without a volume, or if a shape can't be read."""
        return self._hull(self.shapes)

    def solids(self, link: str) -> Sequence[PlacedShape]:
        """Return the different shapes of a link; none if one is a mesh."""
        shapes = [shape for shape in self.shapes if shape.body == link]
        keys = [(one.kind, one.size, str(one.place)) for one in shapes]
        is_exact = all(shape.kind != "mesh" for shape in shapes)
        return list(dict(zip(keys, shapes, strict=True)).values()) if is_exact else []

    def _hull(self, shapes: Sequence[PlacedShape]) -> Hull | None:
        points = [_points(shape, self.frames[shape.body or ""]) for shape in shapes]
        read = [rows for rows in points if rows is not None]
        is_whole = bool(read) and len(read) == len(points)
        return hull_of(np.concatenate(read)) if is_whole else None


@dataclass(frozen=True, eq=False)
class RobotFacts:
    """All facts about a file.

    Attributes:
        robot: as read.
        tree: its bodies and joints.
    """

    robot: Robot
    tree: Tree

    @cached_property
    def bodies(self) -> tuple[WeldedBody, ...]:
        """Bodies that move, and for a file without shapes of the world, the base."""
        first = 0 if self.robot.file.suffix == COMPILED else WORLD
        bodies = (self._body(i) for i in range(first, len(self.tree.links)))
        return tuple(body for body in bodies if body is not None and _is_physical(body.inertia))

    @cached_property
    def joints(self) -> Mapping[str, Joint]:
        """Joints by name."""
        model = self.robot.body_model
        bodies = () if model is None else model.bodies
        return {joint.name: joint for body in bodies for joint in body.joints}

    @cached_property
    def compiled(self) -> CompiledTree | None:
        """The file as an engine compiles it; None for a format that is read directly."""
        engine = compiler(self.robot.file.suffix)
        try:
            return None if engine is None else engine.compiled(self.robot.file)
        except EngineError:
            return None

    @cached_property
    def documents(self) -> tuple[Document, ...]:
        """The file and its includes, where they are XML."""
        return tuple(documents_of(self.robot.file))

    @cached_property
    def rest(self) -> Mapping[str, float]:
        """Positions of hinges and slides as the file draws them, rad or m."""
        return {name: joint.zero for name, joint in self.joints.items() if joint.single}

    @cached_property
    def drawn(self) -> Array:
        """All coordinates as the file draws them, (nq,)."""
        bodies = () if self.compiled is None else self.compiled.bodies
        free = {
            joint.name: body for body in bodies for joint in body.joints if joint.kind == "free"
        }
        q = self.tree.zero.copy()
        for link, here in zip(self.tree.links, self.tree.positions, strict=True):
            if link.name in self.rest:
                q[here] = self.rest[link.name]
            elif link.name in free:
                body = free[link.name]
                q[here] = [*body.position, *(body.quaternion or (1.0, 0.0, 0.0, 0.0))]
        return q

    @cached_property
    def poses(self) -> tuple[Place, ...]:
        """Frame of each link of the tree in the world as drawn."""
        return self.poses_at(self.drawn)

    def poses_at(self, q: Array) -> tuple[Place, ...]:
        """Return the frame of each link of the tree in the world at coordinates (nq,)."""
        poses = Recursion(self.tree).poses(q[:, None])
        return tuple(
            Place(np.asarray(one.rotation, float)[..., 0], np.asarray(one.origin, float)[:, 0])
            for one in poses
        )

    @cached_property
    def places(self) -> Mapping[str, Place]:
        """Frame of each link of the file in the world as drawn."""
        return {
            part.name: place if index == WORLD else self.poses[index].compose(place)
            for part in self.robot.parts
            for index, place in [self.tree.frames.get(part.name, (WORLD, IDENTITY))]
        }

    @cached_property
    def holding(self) -> Mapping[str, float]:
        """Forces that hold hinges and slides at rest against gravity and springs, N or N m."""
        tree = self.tree
        if not tree.nv:
            return {}
        recursion, q = Recursion(tree), self.drawn[:, None]
        force = np.asarray(recursion.bias(q, np.zeros((tree.nv, 1))), float)[:, 0]
        force = force - np.asarray(recursion.lift(q), float)[:, 0]
        return {
            link.name: float(force[there.start]) + _spring(link, self.rest[link.name])
            for link, there in zip(tree.links, tree.velocities, strict=True)
            if link.name in self.rest
        }

    @cached_property
    def extent(self) -> float:
        """Diagonal of a box about all links and shapes as drawn, m; 0 if it is unknown."""
        if any(body.has_mesh and body.whole_hull is None for body in self.bodies):
            return 0.0
        points = [place.origin[None] for place in self.places.values()]
        for body in self.bodies:
            if body.whole_hull is not None:
                first = body.parts[0].name
                back = self.places[first].rotation @ body.frames[first].rotation.T
                origin = self.places[first].origin - back @ body.frames[first].origin
                points.append(placed_points(body.whole_hull.points, Place(back, origin)))
        span = np.ptp(np.concatenate(points), axis=0) if len(self.places) > 1 else np.zeros(3)
        return float(np.linalg.norm(span))

    @cached_property
    def mass_sources(self) -> Mapping[str, str]:
        """Source of the mass of each body of a compiled file: `stated`, `density` or `default`."""
        if self.robot.file.suffix != COMPILED:
            return {}
        roots = [document.root for document in self.documents]
        defaults = [
            geom for root in roots for part in root.findall("default") for geom in part.iter("geom")
        ]
        is_by_shape = any(
            one.get("inertiafromgeom") == "true"
            for root in roots
            for one in root.findall("compiler")
        )
        sources = {}
        for body in (one for root in roots for one in root.iter("body")):
            geoms = [*body.findall("geom"), *defaults]
            if (body.find("inertial") and not is_by_shape) or any(one.get("mass") for one in geoms):
                sources[body.get("name")] = "stated"
            elif body.find("geom"):
                has_density = any(one.get("density") for one in geoms)
                sources[body.get("name")] = "density" if has_density else "default"
        return sources

    def line(self, tag: str, name: str, child: str = "") -> SourceLine:
        """Return the line of a named element, or of its child if it has that one."""
        return element_line(self.documents, tag, name, child) or SourceLine(
            file=str(self.robot.file), line=None
        )

    def inertial_line(self, link: str) -> SourceLine:
        """Return the line of a link's `<inertial>`, or of the link."""
        tag = "body" if self.robot.file.suffix == COMPILED else "link"
        return self.line(tag, link, "inertial")

    def drive_line(self, joint: str) -> SourceLine:
        """Return the line of the first drive that names a joint, or of the joint."""
        for document in self.documents:
            for drive in document.root.findall("actuator/*"):
                if drive.get("joint") == joint:
                    return SourceLine(file=str(document.path), line=document.line(drive))
        return self.line("joint", joint)

    @cached_property
    def efforts(self) -> Mapping[str, tuple[float, SourceLine]]:
        """Largest force of the drive of each joint, N or N m, with its line."""
        return dict(_efforts(self))

    @cached_property
    def joint_numbers(self) -> Mapping[str, Mapping[str, float]]:
        """Damping, friction, efforts, speeds and gains of joints, by joint and quantity."""
        numbers: dict[str, dict[str, float]] = {}
        for name, joint in self.joints.items():
            values = {"damping": joint.damping, "stiffness": joint.stiffness}
            rows = {what: one for what, one in values.items() if isinstance(one, float | int)}
            numbers[name] = {**rows, "armature": joint.armature}
            if name in self.efforts:
                numbers[name]["effort"] = self.efforts[name][0]
        for document in () if self.robot.file.suffix == COMPILED else self.documents:
            for element in document.root.iter("joint"):
                numbers.setdefault(element.get("name"), {}).update(_joint_values(element))
        return numbers if self.compiled is None else _with_drives(numbers, self.compiled)

    @cached_property
    def carried(self) -> Mapping[str, str]:
        """The link that each joint moves."""
        model = self.robot.body_model
        bodies = () if model is None else model.bodies
        return {joint.name: body.name for body in bodies for joint in body.joints}

    def bodies_of(self, index: int) -> Sequence[LinkPart]:
        """Return the links of one body of the tree."""
        return [part for part in self.robot.parts if part.body == index]

    @property
    def has_keyframes(self) -> bool:
        """True if the file states poses besides the drawn one."""
        return any(document.root.find("keyframe/key") for document in self.documents)

    def _body(self, index: int) -> WeldedBody | None:
        parts = [part for part in self.robot.parts if part.body == index]
        if not parts:
            return None
        frames = {part.name: self._frame(part.name) for part in parts}
        inertia = NO_INERTIA
        for part in parts:
            inertia = inertia.combined(part.inertia.in_frame(frames[part.name]))
        return WeldedBody(
            parts=tuple(sorted(parts, key=lambda part: -part.inertia.mass)),
            joint="" if index == WORLD else self.tree.links[index].name,
            inertia=inertia,
            shapes=tuple(one for one in self.robot.placed if one.body in frames and _is_solid(one)),
            frames=frames,
        )

    def _frame(self, name: str) -> Place:
        return self.tree.frames.get(name, (WORLD, IDENTITY))[1]


def moments(tensor: Array) -> Array:
    """Return the principal moments of inertia, ascending, (3,)."""
    values: Array = np.linalg.eigvalsh(tensor).astype(np.float64)
    return values


def vector_text(values: Array) -> str:
    """Return numbers with three digits, separated by spaces."""
    return " ".join(f"{value + 0.0:.3g}" for value in np.round(values, 12).tolist())


def _is_solid(shape: PlacedShape) -> bool:
    return shape.kind == "mesh" or (shape.kind in SOLIDS and min(shape.size) > 0)


def _is_physical(inertia: SpatialInertia) -> bool:
    """Return whether a body has a positive mass, and numbers that its audit does not reject."""
    numbers = [inertia.mass, *inertia.center, *inertia.inertia.ravel()]
    return bool(np.isfinite(numbers).all()) and inertia.mass > 0


def _joint_values(joint: XmlElement) -> Iterator[tuple[str, float]]:
    """Yield the friction and the largest speed of a joint of a URDF or SDFormat file."""
    for path in ("dynamics", "limit", "axis/dynamics", "axis/limit"):
        for part in joint.findall(path):
            for key in ("friction", "velocity"):
                for value in finite_numbers(part.get(key) or part.findtext(key)) or ():
                    yield key, value


def _with_drives(
    numbers: dict[str, dict[str, float]], compiled: CompiledTree
) -> Mapping[str, Mapping[str, float]]:
    """Return numbers of joints with dry friction, and with gains of drives."""
    for friction in () if compiled.laws is None else compiled.laws.frictions:
        if friction.joint >= 0:
            name = compiled.joints[friction.joint]
            numbers.setdefault(name, {})["dry friction"] = friction.force
    for drive in compiled.actuators:
        for what, values in drive.numbers:
            for i, value in enumerate(values):
                numbers.setdefault(drive.on, {})[f"{what}[{i}] of its drive"] = abs(value)
    return numbers


def _spring(link: TreeLink, position: float) -> float:
    """Return the force of a joint's linear spring at a position."""
    return link.stiffness * (position - link.rest[0])


def _points(shape: PlacedShape, frame: Place) -> Array | None:
    """Return points of a shape in its body's frame; None if they can't be read."""
    if shape.kind != "mesh":
        return placed_points(solid_points(shape.kind, shape.size), frame.compose(shape.place))
    file = locate_file(shape.file, shape.mesh)
    try:
        corners = None if file is None else _mesh_corners(file)
    except MeshError:
        corners = None
    if corners is None:
        return None
    return placed_points(scaled(corners, shape.scale), frame.compose(shape.place))


def solid_hull(shape: PlacedShape, frame: Place) -> Hull | None:
    """Return the hull of a shape on a link with a frame; None if it can't be read."""
    points = _points(shape, frame) if _is_solid(shape) else None
    return None if points is None else hull_of(points)


@lru_cache(maxsize=512)
def _mesh_corners(file: Path) -> Array:
    return extreme_points(mesh_vertices(file))


def element_line(
    documents: Iterable[Document], tag: str, name: str, child: str = ""
) -> SourceLine | None:
    """Return the line of a named element, or of its child if it has that one; None without it."""
    for document in documents:
        for element in document.root.iter(tag):
            if element.get("name") == name:
                place = (element.find(child) if child else None) or element
                return SourceLine(file=str(document.path), line=document.line(place))
    return None


def documents_of(file: Path) -> Iterator[Document]:
    """Yield a file and its includes, where they are XML."""
    try:
        paths = parts_of(file) if file.suffix == COMPILED else (file,)
    except EngineError:
        return
    for path in paths:
        try:
            yield Document(path)
        except LocationError:
            continue


def _efforts(facts: RobotFacts) -> Iterator[tuple[str, tuple[float, SourceLine]]]:
    if facts.robot.file.suffix == COMPILED:
        yield from _compiled_efforts(facts)
        return
    for document in facts.documents:
        driven = {one.get("name") for one in document.root.findall("transmission/joint")}
        for joint in document.root.iter("joint"):
            if driven and joint.get("name") not in driven:
                continue  # a file that states transmissions states all: others are passive
            limit = joint.find("limit") or joint.find("axis/limit")
            if limit is not None and (effort := _effort(limit)) is not None:
                line = SourceLine(file=str(document.path), line=document.line(limit))
                yield joint.get("name"), (effort, line)


def _effort(limit: XmlElement) -> float | None:
    values = finite_numbers(limit.get("effort") or limit.findtext("effort"))
    return values[0] if values and len(values) == 1 and values[0] >= 0 else None


def _compiled_efforts(facts: RobotFacts) -> Iterator[tuple[str, tuple[float, SourceLine]]]:
    """Yield limits of drives that act on one joint, added over drives of the same joint."""
    laws = None if facts.compiled is None else facts.compiled.laws
    if laws is None or facts.compiled is None:
        return
    total: dict[str, float] = {}
    for drive in laws.drives:
        path = facts.compiled.paths[drive.path]
        limit = np.inf if drive.force_range is None else max(map(abs, drive.force_range))
        for name, gear in path.joints:
            total[name] = total.get(name, 0.0) + limit * abs(gear)
    for name, effort in total.items():
        if np.isfinite(effort):
            yield name, (effort, facts.line("joint", name))
