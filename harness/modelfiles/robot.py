"""A robot from its file: a tree of bodies, and the parts of the file that are left out."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.documents.errors import ReadError
from physics_crosscheck.harness.engines.protocol import ARMATURES
from physics_crosscheck.reference.mechanism.bodies import BodyModel, RigidBody
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import Place, SpatialInertia
from physics_crosscheck.reference.mechanism.tree import WORLD, Tree

HELD = "joints that move nothing with inertia (held still)"

LOCKED = "joints that their damping or spring locks (held still)"

CLOSING = "joint that closes a loop"

FREE_MIMIC = "mimic without a gear: the joint is free"

FilePlace = tuple[Path | None, int | None]
"""A file and a line of it, from 1."""

Note = tuple[str, str] | tuple[str, str, FilePlace]
"""The kind, the name of a joint or a link, and its place if no engine reads it."""


@dataclass(frozen=True, kw_only=True)
class Omission:
    """Content of a file that the tree omits.

    Attributes:
        what: the kind, such as "dry friction".
        count: number of occurrences.
        where: names of the joints or links that have one.
        place: of its first occurrence if no engine reads it; None for other content.
    """

    what: str
    count: int
    where: tuple[str, ...]
    place: FilePlace | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class LinkPart:
    """A link of the file, before links on fixed joints are merged.

    Attributes:
        link: with its numbers.
        line: of its element, from 1; 0 if unknown.
        file: with that line, if it is not the robot's.
        body: index of the tree's link that contains it; `WORLD` for fixed parts, and without a
            tree.
        rounding: half units of the last written digits of its tensor, in sum, kg m^2.
    """

    link: RigidBody
    line: int
    body: int = WORLD
    rounding: float = 0.0
    file: Path | None = None

    @property
    def name(self) -> str:
        """Its name in the file."""
        return self.link.name

    @cached_property
    def inertia(self) -> SpatialInertia:
        """Its mass, center of mass and inertia in its own frame; not finite after an overflow."""
        with np.errstate(all="ignore"):
            return self.link.spatial_inertia


@dataclass(frozen=True, kw_only=True, eq=False)
class PlacedShape:
    """A shape or a site of the file.

    Attributes:
        name: its place in engines, as in `Model.shapes`.
        body: name of its body; None for the world.
        place: its frame in the body's.
        size: the numbers that give its extent, in the order of the format, m.
        file, line: of its element; line 0 if unknown.
        size_place: file and line that state its size, if they may be others.
        kind: its form.
        visual: whether it is drawn only.
        mesh: name of the mesh's file, as `expanded.locate_file` takes it; empty without one.
        scale: factors of the mesh's coordinates.
    """

    name: str
    body: str | None
    place: Place
    size: tuple[float, ...]
    file: Path
    line: int = 0
    size_place: tuple[Path, int] | None = None
    kind: str = "mesh"
    visual: bool = False
    mesh: str = ""
    scale: tuple[float, ...] = (1.0, 1.0, 1.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Robot:
    """The content of a file.

    Attributes:
        name: of the robot.
        file: its path.
        tree: its bodies and joints, depth first; None exactly if there are obstacles.
        parts: the file's links, in the file's order.
        limits: lower and upper bound of each velocity's coordinate, infinite without a limit, rad
            or m, each (nv,).
        home: initial coordinates, (nv,).
        left_out: content of the file that the tree omits.
        obstacles: all problems that prevent building a tree.
        controls: held values of its actuators, one per input.
        body_model: input of the tree; None without a tree.
        held: joints that are fixed, since they move nothing that has inertia.
        shapes: file names, as in the model, of meshes that the inertias depend on.
        placed: shapes and sites.
        floats: whether the root link moves freely, which a URDF does not state.
        stated: settings that the file states itself, as in `ModelSpec`.
        repeated: elements without effect, since an earlier one of their tag counts.
        selection: selected variants of the file, in words.
    """

    name: str
    file: Path
    tree: Tree | None
    parts: tuple[LinkPart, ...]
    limits: tuple[Array, Array]
    home: Array
    left_out: tuple[Omission, ...]
    obstacles: tuple[ReadError, ...]
    controls: tuple[float, ...] = ()
    body_model: BodyModel | None = None
    held: tuple[str, ...] = ()
    shapes: tuple[str, ...] = ()
    placed: tuple[PlacedShape, ...] = ()
    floats: bool = False
    stated: Mapping[str, object] = field(default_factory=dict)
    repeated: tuple[ReadError, ...] = ()
    selection: str = ""

    @property
    def lines(self) -> Mapping[str, int]:
        """Lines of links in its file, by name."""
        return {one.name: one.line for one in self.parts if one.file in (None, self.file)}

    @property
    def bodies(self) -> tuple[tuple[str, ...], ...]:
        """The names of the parts that are merged in each link of the tree."""
        count = 0 if self.tree is None else len(self.tree.links)
        return tuple(tuple(p.name for p in self.parts if p.body == i) for i in range(count))


def refused(
    file: Path,
    name: str,
    obstacles: Iterable[ReadError],
    *,
    parts: tuple[LinkPart, ...] = (),
    left_out: tuple[Omission, ...] = (),
) -> Robot:
    """Return a robot without a tree, with its problems sorted by line and without duplicates."""
    none = np.zeros(0)
    return Robot(
        name=name,
        file=file,
        tree=None,
        parts=parts,
        limits=(none, none),
        home=none,
        left_out=left_out,
        obstacles=tuple(dict.fromkeys(sorted(obstacles, key=lambda one: one.line))),
    )


def home_of(tree: Tree, limits: tuple[Array, Array]) -> Array:
    """Return zero for each coordinate, or the middle of its bounds if zero is outside, (nv,)."""
    home = np.zeros(tree.nv)
    for i, (lower, upper) in enumerate(zip(*map(np.ndarray.tolist, limits), strict=True)):
        if not lower <= 0.0 <= upper:
            home[i] = _between(lower, upper)
    return home


def _between(lower: float, upper: float) -> float:
    """Return the middle of two bounds, or the finite one of them."""
    finite = [bound for bound in (lower, upper) if abs(bound) != float("inf")]
    return sum(finite) / len(finite)


def count_notes(notes: Iterable[Note], followers: Collection[str]) -> tuple[Omission, ...]:
    """Count notes by kind, without the mimics of `followers`, which are enforced."""
    counts: dict[str, int] = {}
    places: dict[str, dict[str, None]] = {}
    lines: dict[str, FilePlace] = {}
    for what, where, *place in notes:
        if what == FREE_MIMIC and where in followers:
            continue
        counts[what] = counts.get(what, 0) + 1
        places.setdefault(what, {}).update({where: None} if where else {})
        if place:
            lines.setdefault(what, place[0])
    return tuple(
        Omission(what=what, count=count, where=tuple(places[what]), place=lines.get(what))
        for what, count in counts.items()
    )


def armatures_of(settings: Mapping[str, object]) -> Mapping[str, float]:
    """Return the setting `armatures`; empty without it."""
    given = settings.get(ARMATURES)
    return given if isinstance(given, Mapping) else {}
