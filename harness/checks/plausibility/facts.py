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
from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.mechanism.bodies import Joint
from physics_crosscheck.reference.mechanism.rotations import Array
from physics_crosscheck.reference.mechanism.spatial_inertia import (
    IDENTITY,
    NO_INERTIA,
    Place,
    SpatialInertia,
)
from physics_crosscheck.reference.mechanism.tree import WORLD, Tree, TreeLink
from .hull import SOLIDS, Hull, extreme_points, hull_of, placed_points, scaled, solid_points

COMPILED = ".xml"
"""Suffix of the files in which the world has shapes of its own."""


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
    def holding(self) -> Mapping[str, float]:
        """Forces that hold hinges and slides at rest against gravity and springs, N or N m."""
        tree = self.tree
        if not tree.nv:
            return {}
        recursion = Recursion(tree)
        q = tree.zero[:, None].copy()
        for link, here in zip(tree.links, tree.positions, strict=True):
            if link.name in self.rest:
                q[here] = self.rest[link.name]
        force = np.asarray(recursion.bias(q, np.zeros((tree.nv, 1))), float)[:, 0]
        force = force - np.asarray(recursion.lift(q), float)[:, 0]
        return {
            link.name: float(force[there.start]) + _spring(link, self.rest[link.name])
            for link, there in zip(tree.links, tree.velocities, strict=True)
            if link.name in self.rest
        }

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


def _is_solid(shape: PlacedShape) -> bool:
    return shape.kind == "mesh" or (shape.kind in SOLIDS and min(shape.size) > 0)


def _is_physical(inertia: SpatialInertia) -> bool:
    """Return whether a body has a positive mass, and numbers that its audit does not reject."""
    numbers = [inertia.mass, *inertia.center, *inertia.inertia.ravel()]
    return bool(np.isfinite(numbers).all()) and inertia.mass > 0


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
