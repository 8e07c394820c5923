"""Facts about a robot's file that plausibility compares: bodies with hulls, joints, lines."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.documents.document import Document, finite_numbers
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.documents.errors import LocationError, quote
from physics_crosscheck.harness.documents.expanded import locate_file
from physics_crosscheck.harness.documents.reading import USD_SUFFIXES
from physics_crosscheck.harness.documents.usd import UsdStage
from physics_crosscheck.harness.engines.compiled import CompiledTree
from physics_crosscheck.harness.engines.protocol import EngineError
from physics_crosscheck.harness.modelfiles.mesh_files import MeshError, mesh_vertices
from physics_crosscheck.harness.modelfiles.mjcf.read import compiler, parts_of
from physics_crosscheck.harness.modelfiles.robot import LinkPart, PlacedShape, Robot
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.finding import AuditFinding, PlausibilityKind
from physics_crosscheck.harness.results.status import counted
from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.mechanism.bodies import Joint, RigidBody
from physics_crosscheck.reference.mechanism.laws import Laws
from physics_crosscheck.reference.mechanism.rotations import (
    IDENTITY,
    NO_INERTIA,
    Array,
    Place,
    SpatialInertia,
)
from physics_crosscheck.reference.mechanism.tree import WORLD, Tree
from ..findings import finding
from .hull import SOLIDS, Hull, extreme_points, hull_of, placed_points, scaled, solid_points

COMPILED = ".xml"
"""Suffix of the files in which the world has shapes of its own."""

Advice = tuple[float, AuditFinding]
"""How far a number is from plausible, for the order, and its finding; 1 is the threshold."""


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

    @property
    def link(self) -> str:
        """Its heaviest link in words, and how many are welded to it."""
        others = len(self.parts) - 1
        welded = f" with {counted(others, 'welded link')}" if others else ""
        return f"link {quote(self.name)}{welded}"

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
        indices = {part.body for part in self.robot.parts if part.body >= first}
        bodies = (self._body(index) for index in sorted(indices))
        return tuple(body for body in bodies if _is_physical(body.inertia))

    @cached_property
    def body_of(self) -> Mapping[str, WeldedBody]:
        """The body of each link."""
        return {part.name: body for body in self.bodies for part in body.parts}

    def tree_of(self, body: int) -> int:
        """Return the first joint of the tree that carries a body; negative for the world."""
        while body >= 0 and (parent := self.tree.links[body].parent) >= 0:
            body = parent
        return body

    def part(self, link: str) -> LinkPart:
        """Return a link with a body."""
        return next(one for one in self.body_of[link].parts if one.name == link)

    @cached_property
    def links(self) -> tuple[RigidBody, ...]:
        """Links with their joints, as the file describes them."""
        return () if self.robot.body_model is None else self.robot.body_model.bodies

    @cached_property
    def joints(self) -> Mapping[str, Joint]:
        """Joints by name."""
        return {joint.name: joint for link in self.links for joint in link.joints}

    @cached_property
    def compiled(self) -> CompiledTree | None:
        """The file as an engine compiles it; None for a format that is read directly."""
        engine = compiler(self.robot.file.suffix)
        with suppress(EngineError):
            return None if engine is None else engine.compiled(self.robot.file)
        return None

    @cached_property
    def laws(self) -> Laws | None:
        """Its limits, friction, equalities, contacts and drives; None if unknown."""
        return None if self.compiled is None else self.compiled.laws

    @cached_property
    def roots(self) -> tuple[XmlElement, ...]:
        """First elements of the file and its includes, where they are XML."""
        return tuple(roots_of(self.robot.file))

    @cached_property
    def rest(self) -> Mapping[str, float]:
        """Positions of hinges and slides as the file draws them, rad or m."""
        return {name: joint.zero for name, joint in self.joints.items() if joint.single}

    @cached_property
    def drawn(self) -> Array:
        """All coordinates as the file draws them, (nq,)."""
        bodies = () if self.compiled is None else self.compiled.bodies
        free = {one.name: body for body in bodies for one in body.joints if one.kind == "free"}
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
        """Frames in the world as drawn, as `poses_at` returns them."""
        return self.poses_at(self.drawn)

    def poses_at(self, q: Array) -> tuple[Place, ...]:
        """Return the frames of the tree's links in the world, and its own, at coordinates (nq,)."""
        poses = Recursion(self.tree).poses(q)
        return (*(Place(np.asarray(p.rotation), np.asarray(p.origin)) for p in poses), IDENTITY)

    @cached_property
    def places(self) -> Mapping[str, Place]:
        """Frame of each link of the file in the world as drawn."""
        return {part.name: self.place(part.name, self.poses) for part in self.robot.parts}

    def place(self, link: str, poses: Sequence[Place]) -> Place:
        """Return the frame of a link of the file in the world, by `poses_at`."""
        index, place = self.tree.frames.get(link, (WORLD, IDENTITY))
        return poses[index].compose(place)

    @cached_property
    def holding(self) -> Mapping[str, float]:
        """Forces that hold hinges and slides at rest against gravity and springs, N or N m."""
        if not self.tree.nv:
            return {}
        recursion, held = Recursion(self.tree), {}
        force = recursion.bias(self.drawn, np.zeros(self.tree.nv)) - recursion.lift(self.drawn)
        for link, there in zip(self.tree.links, self.tree.velocities, strict=True):
            if link.name in self.rest:
                spring = link.stiffness * (self.rest[link.name] - link.rest[0])
                held[link.name] = float(force[there.start]) + spring
        return held

    @cached_property
    def extent(self) -> float:
        """Diagonal of a box about all links and shapes as drawn, m; 0 if it is unknown."""
        if any(body.has_mesh and body.whole_hull is None for body in self.bodies):
            return 0.0
        hulls = ((self.poses[body.parts[0].body], body.whole_hull) for body in self.bodies)
        points = [placed_points(hull.points, pose) for pose, hull in hulls if hull is not None]
        points += [place.origin[None] for place in self.places.values()]
        span = np.ptp(np.concatenate(points), axis=0)
        return float(np.linalg.norm(span)) if len(self.places) > 1 else 0.0

    @property
    def is_compiled(self) -> bool:
        """True of a file in which shapes can give masses."""
        return self.robot.file.suffix == COMPILED

    @cached_property
    def mass_sources(self) -> Mapping[str, str]:
        """Source of the mass of each body of a compiled file: `stated`, `density` or `default`."""
        if not self.is_compiled:
            return {}
        defaults = [
            geom
            for root in self.roots
            for one in root.findall("default")
            for geom in one.iter("geom")
        ]
        compilers = (one for root in self.roots for one in root.findall("compiler"))
        is_by_shape = any(one.get("inertiafromgeom") == "true" for one in compilers)
        sources = {}
        for body in (one for root in self.roots for one in root.iter("body")):
            geoms = [*body.findall("geom"), *defaults]
            has_mass = any(stated_number(one, "mass") for one in geoms)
            if (body.find("inertial") and not is_by_shape) or has_mass:
                sources[body.get("name")] = "stated"
            elif body.find("geom"):
                has_density = any(one.get("density") for one in geoms)
                sources[body.get("name")] = "density" if has_density else "default"
        return sources

    def line(self, tag: str, name: str, child: str = "") -> SourceLine:
        """Return the line of a named element, or of its child if it has that one."""
        if self.stage is not None:
            paths = (one for one in self.stage.prims if str(one.GetPath()).endswith(f"/{name}"))
            place = self.stage.place(next(paths, self.stage.stage.GetPseudoRoot()))
            return SourceLine(file=str(place.file), line=place.line)
        return element_line(self.roots, tag, name, child) or SourceLine(file=str(self.robot.file))

    @cached_property
    def stage(self) -> UsdStage | None:
        """Stage of a USD robot; None for other files."""
        is_usd = self.robot.file.suffix in USD_SUFFIXES
        return UsdStage(self.robot.file, self.robot.stated) if is_usd else None

    def inertial_line(self, link: str) -> SourceLine:
        """Return the line of a link's `<inertial>`, or of the link."""
        tag = "body" if self.robot.file.suffix == COMPILED else "link"
        return self.line(tag, link, "inertial")

    def advice(
        self,
        kind: PlausibilityKind,
        subject: str | tuple[str, ...],
        message: str,
        expected: float | None = None,
        actual: float | None = None,
        excess: float = 1.0,
        *,
        line: SourceLine | None = None,
    ) -> Advice:
        """Return advice about links or joints, by default at the inertia of the first link."""
        names = (subject,) if isinstance(subject, str) else subject
        place = line or self.inertial_line(names[0])
        return excess, finding(
            kind, names, message, location=place, expected=expected, actual=actual,
            severity="advice",
        )  # fmt: skip

    @cached_property
    def joint_numbers(self) -> Mapping[str, Mapping[str, float]]:
        """Damping, friction, efforts, speeds and gains of joints, by joint and quantity."""
        numbers: dict[str, dict[str, float]] = {}
        for joint, what, value in (*_joint_numbers(self), *_drive_numbers(self)):
            numbers.setdefault(joint, {})[what] = value
        return numbers

    def _body(self, index: int) -> WeldedBody:
        parts = [part for part in self.robot.parts if part.body == index]
        names = [part.name for part in parts]
        frames = {name: self.tree.frames.get(name, (WORLD, IDENTITY))[1] for name in names}
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


def _joint_numbers(facts: RobotFacts) -> Iterator[tuple[str, str, float]]:
    """Yield numbers of joints, and those that a URDF or SDFormat file states for them."""
    for name, joint in facts.joints.items():
        for what in ("damping", "stiffness", "armature"):
            value = getattr(joint, what)
            if isinstance(value, float | int):
                yield name, what, value
    # A file that states transmissions states all of them.
    driven = {one.get("name") for root in facts.roots for one in root.findall("transmission/joint")}
    for element, part in stated_parts(facts, "dynamics", "limit"):
        name = element.get("name")
        for key in ("effort", "friction", "velocity"):
            value = stated_number(part, key)
            is_passive = key == "effort" and bool(driven) and name not in driven
            if value is not None and not is_passive and (value >= 0 or key != "effort"):
                yield name, key, value


def _drive_numbers(facts: RobotFacts) -> Iterator[tuple[str, str, float]]:
    """Yield forces, dry friction and gains of the drives of a compiled file's joints.

    Limits of drives that act on one joint are added.
    """
    if facts.compiled is None or facts.laws is None:
        return
    total: dict[str, float] = {}
    for law in facts.laws.drives:
        limit = np.inf if law.force_range is None else max(map(abs, law.force_range))
        for name, gear in facts.compiled.paths[law.path].joints:
            total[name] = total.get(name, 0.0) + limit * abs(gear)
    yield from ((name, "effort", force) for name, force in total.items() if np.isfinite(force))
    for friction in facts.laws.frictions:
        if friction.joint >= 0:
            yield facts.compiled.joints[friction.joint], "dry friction", friction.force
    for drive in facts.compiled.actuators:
        for what, values in drive.numbers:
            for i, value in enumerate(values):
                yield drive.on, f"{what}[{i}] of its drive", abs(value)


def stated_parts(facts: RobotFacts, *tags: str) -> Iterator[tuple[XmlElement, XmlElement]]:
    """Yield joints of a URDF or SDFormat file, each with its first part of a tag."""
    roots = () if facts.robot.file.suffix == COMPILED else facts.roots
    for joint in (one for root in roots for one in root.iter("joint")):
        parts = (joint.find(tag) or joint.find(f"axis/{tag}") for tag in tags)
        yield from ((joint, part) for part in parts if part is not None)


def stated_number(element: XmlElement, key: str) -> float | None:
    """Return the finite number of an attribute or a child, or None."""
    values = finite_numbers(element.get(key) or element.findtext(key))
    return values[0] if values and len(values) == 1 else None


def _points(shape: PlacedShape, frame: Place) -> Array | None:
    """Return points of a shape in its body's frame; None if they can't be read."""
    if shape.kind != "mesh":
        points = solid_points(shape.kind, shape.size)
        return placed_points(points, frame.compose(shape.place))
    file = locate_file(shape.file, shape.mesh)
    with suppress(MeshError):
        if file is not None:
            points = scaled(_mesh_corners(file), shape.scale)
            return placed_points(points, frame.compose(shape.place))
    return None


def solid_hull(shape: PlacedShape, frame: Place) -> Hull | None:
    """Return the hull of a shape on a link with a frame; None if it can't be read."""
    points = _points(shape, frame) if _is_solid(shape) else None
    return None if points is None else hull_of(points)


@lru_cache(maxsize=512)
def _mesh_corners(file: Path) -> Array:
    return extreme_points(mesh_vertices(file))


def line_of(element: XmlElement) -> SourceLine:
    """Return the line of an element of a file."""
    file, line = element.place
    return SourceLine(file=str(file), line=line)


def element_line(
    roots: Iterable[XmlElement], tag: str, name: str, child: str = ""
) -> SourceLine | None:
    """Return the line of a named element, or of its child if it has that one; None without it."""
    for element in (one for root in roots for one in root.iter(tag)):
        if element.get("name") == name:
            return line_of(element.find(child) or element.find(f"axis/{child}") or element)
    return None


def roots_of(file: Path) -> Iterator[XmlElement]:
    """Yield the first elements of a file and its includes, where they are XML."""
    paths: tuple[Path, ...] = (file,)
    if file.suffix == COMPILED:
        with suppress(EngineError):
            paths = parts_of(file)
    for path in paths:
        with suppress(LocationError):
            yield Document(path).root
