"""Alignment of two trees, joint by joint, so that each difference is reported once, in its place.

Link frames, fixed links and joint zeros are conventions. Each body of B is moved to its place
in A: with its parent, then so that its joint axis lies on that of A, then about that axis where
all that it carries is turned by one angle.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from physics_crosscheck.harness.modelfiles.readers import names_of
from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.mechanism.chart import MinimalCoordinates, coordinate_names
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import (
    DOUBLES,
    IDENTITY,
    Place,
    SpatialInertia,
    about_axis,
)
from physics_crosscheck.reference.mechanism.tree import WORLD, Kind, Tree


@dataclass(frozen=True, kw_only=True, eq=False)
class PlacedTree:
    """The links of a tree at one position, in the world.

    Attributes:
        tree: with n links.
        frames: each link's frame.
        index: of each link, by the name of its joint.
        axes: of the joints; meaningless for a ball and a free joint, (n, 3).
        anchors: points on them, m, (n, 3).
        centers: centres of mass, m, (n, 3).
        size: of the mechanism, m.
    """

    tree: Tree
    frames: tuple[Place, ...]
    index: Mapping[str, int]
    axes: Array
    anchors: Array
    centers: Array
    size: float

    def kind(self, name: str) -> Kind:
        """Return the kind of a joint."""
        return self.tree.links[self.index[name]].kind

    def coordinates(self, name: str) -> tuple[str, ...]:
        """Return coordinate names of a joint: its own name, or those of a ball or free joint."""
        return tuple(one for one, _ in coordinate_names(self.kind(name), name))

    def parent(self, name: str) -> str:
        """Return the joint that carries a joint, or "" for the world."""
        parent = self.tree.links[self.index[name]].parent
        return "" if parent == WORLD else self.tree.links[parent].name

    def body_inertia(self, i: int) -> SpatialInertia:
        """Return a link as a rigid body in the world."""
        link = self.tree.links[i]
        return SpatialInertia(link.mass, link.center, link.inertia).in_frame(self.frames[i])


def placed(tree: Tree, q: Array) -> PlacedTree:
    """Place a tree at positions q, (nq,)."""
    poses = Recursion(tree).poses(q)
    frames = tuple(Place(np.asarray(p.rotation), np.asarray(p.origin)) for p in poses)
    n = len(tree.links)
    rows = list(zip(tree.links, frames, strict=True))
    axes = np.array([frame.rotation @ link.axis for link, frame in rows]).reshape(n, 3)
    anchors = np.array([frame.origin for frame in frames]).reshape(n, 3)
    centers = np.array([frame.transform(link.center) for link, frame in rows]).reshape(n, 3)
    points = np.concatenate([anchors, centers])
    size = float(np.max(np.ptp(points, axis=0), initial=0.0)) if n else 0.0
    return PlacedTree(
        tree=tree,
        frames=frames,
        index={link.name: i for i, link in enumerate(tree.links)},
        axes=axes,
        anchors=anchors,
        centers=centers,
        size=size or 1.0,
    )


def positions(tree: Tree, coordinates: Sequence[str], z: Array) -> Array:
    """Convert positions of an engine's coordinates, (nz,), to a tree's positions, (nq,)."""
    where = {name: i for i, name in enumerate(coordinates)}
    values: Array = MinimalCoordinates(tree, DOUBLES).positions(
        z[[where[name] for name in names_of(tree)]]
    )
    return values


def with_link(tree: Tree, i: int, **changes: object) -> Tree:
    """Return the tree with other values of one link."""
    links = list(tree.links)
    links[i] = replace(links[i], **changes)  # type: ignore[arg-type]
    return replace(tree, links=tuple(links))


def with_joint(placed: PlacedTree, i: int, motion: Place) -> Tree:
    """Return the tree with a joint, and all that it carries, moved in the world."""
    tree, link = placed.tree, placed.tree.links[i]
    outer = IDENTITY if link.parent == WORLD else placed.frames[link.parent]
    place = motion.compose(outer.compose(Place(link.rotation, link.position)))
    rotation = outer.rotation.T
    position = rotation @ (place.origin - outer.origin)
    return with_link(tree, i, rotation=rotation @ place.rotation, position=position)


SAME = 1e-9
"""Tolerance: of angles in rad, of lengths in units of the mechanism's size."""

LinkPair = tuple[int, int]
"""Indices of a link of A and a link of B."""

MIN_AGREEMENTS = 2
"""Minimum number of things that must agree before a shifted joint zero is inferred."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Aligned:
    """A pair of links, and the transformation applied to B's.

    Attributes:
        a, b: index of the link in either tree.
        moved: maps B's body, in the world, onto that of A.
        opposite: whether its axis points the other way.
        axis_only: whether only the axis differs: what it carries is where it is in A.
        angle: between the axes, rad.
        apart: distance between the axes of hinges, m, combined with the common shift along the
            axis of all that the hinge carries.
        axis: B's axis where its parent's place is that of A, in A's direction, (3,).
        shift: from A's axis to B's, likewise, m, (3,).
        zero: A's position minus B's where both mechanisms coincide, rad or m, about A's axis.
    """

    a: int
    b: int
    moved: Place
    opposite: bool = False
    axis_only: bool = False
    angle: float = 0.0
    apart: float = 0.0
    axis: Array = field(default_factory=lambda: np.zeros(3))
    shift: Array = field(default_factory=lambda: np.zeros(3))
    zero: float = 0.0


def aligned(
    placed_a: PlacedTree, placed_b: PlacedTree, pairs: Sequence[LinkPair]
) -> tuple[Aligned, ...]:
    """Align B's links with those of A.

    Args:
        placed_a, placed_b: A and B, at one position.
        pairs: links of one kind, parents first.
    """
    rows: dict[int, Aligned] = {}
    for a, b in pairs:
        parent = placed_a.tree.links[a].parent
        before = rows[parent].moved if parent in rows else IDENTITY
        rows[a] = _joint(placed_a, placed_b, (a, b), before, pairs)
    return tuple(rows.values())


def _joint(
    placed_a: PlacedTree,
    placed_b: PlacedTree,
    pair: LinkPair,
    before: Place,
    pairs: Sequence[LinkPair],
) -> Aligned:
    a, b = pair
    if placed_a.tree.links[a].kind not in ("hinge", "slide"):
        return Aligned(a=a, b=b, moved=before)
    hinge, size = placed_a.tree.links[a].kind == "hinge", max(placed_a.size, placed_b.size)
    u, p = placed_a.axes[a], placed_a.anchors[a]
    v, r = before.rotation @ placed_b.axes[b], before.transform(placed_b.anchors[b])
    opposite = bool(u @ v < 0)
    v = -v if opposite else v
    across = np.cross(v, u)
    sine = float(np.linalg.norm(across))
    angle = float(np.arctan2(sine, u @ v))
    moved, carried = before, _Carried(placed_a, placed_b, pair, pairs)
    is_axis_only = angle > SAME and 0 < carried.count == carried.alike(before)
    if angle > SAME and not is_axis_only:
        moved = turned_about(r, across / sine, angle).compose(moved)
    shift = (p - r) - u * (u @ (p - r)) if hinge else np.zeros(3)
    apart = float(np.linalg.norm(shift))
    if apart > SAME * size and not is_axis_only:
        moved = Place(np.eye(3), shift).compose(moved)
    zero, along, moved = _zero(placed_a, placed_b, pair, moved, carried)
    return Aligned(
        a=a,
        b=b,
        moved=moved,
        opposite=opposite,
        axis_only=is_axis_only,
        angle=angle,
        apart=float(np.hypot(apart, along)),
        axis=v,
        shift=-shift - along * u,
        zero=zero,
    )


def _zero(
    placed_a: PlacedTree, placed_b: PlacedTree, pair: LinkPair, moved: Place, carried: _Carried
) -> tuple[float, float, Place]:
    """Return B's zero offset, shift along the axis and transformation.

    An offset or shift is returned only if it alone explains the difference of B's load.
    """
    a, _ = pair
    u, p, hinge = placed_a.axes[a], placed_a.anchors[a], placed_a.tree.links[a].kind == "hinge"
    if carried.alike(moved) == carried.count or carried.count < MIN_AGREEMENTS:
        return 0.0, 0.0, moved
    for x, y in carried.points(moved):
        if hinge:
            # Project onto the plane normal to the axis.
            x, y = (w - p - u * (u @ (w - p)) for w in (x, y))
            by = float(np.arctan2(u @ np.cross(y, x), x @ y))
            guess = turned_about(p, u, by).compose(moved)
        else:
            by = float(u @ (x - y))
            guess = Place(np.eye(3), by * u).compose(moved)
        if carried.alike(guess) == carried.count:
            return -by, 0.0, guess
    for x, y in carried.points(moved) if hinge else ():
        along = float(u @ (x - y))
        guess = Place(np.eye(3), along * u).compose(moved)
        if carried.alike(guess) == carried.count:
            return 0.0, along, guess
    return 0.0, 0.0, moved


class _Carried:
    """The load of a pair of joints: body masses, and the axes of child joints."""

    def __init__(
        self, placed_a: PlacedTree, placed_b: PlacedTree, pair: LinkPair, pairs: Sequence[LinkPair]
    ) -> None:
        self.placed_a, self.placed_b = placed_a, placed_b
        self.size = max(placed_a.size, placed_b.size)
        self.bodies = placed_a.body_inertia(pair[0]), placed_b.body_inertia(pair[1])
        self.children = [
            (a, b)
            for a, b in pairs
            if placed_a.tree.links[a].parent == pair[0] and placed_b.tree.links[b].parent == pair[1]
        ]
        self.heavy = self.bodies[0].mass > 0 and self.bodies[1].mass > 0
        self.count = 2 * self.heavy + len(self.children)

    def points(self, moved: Place) -> Iterator[tuple[Array, Array]]:
        """Yield points of A with the corresponding points of B."""
        if self.heavy:
            yield self.bodies[0].center, moved.transform(self.bodies[1].center)
        for a, b in self.children:
            yield self.placed_a.anchors[a], moved.transform(self.placed_b.anchors[b])

    def alike(self, moved: Place) -> int:
        """Count what coincides when B's load is moved."""
        return sum(self._alike(moved))

    def _alike(self, moved: Place) -> Iterator[bool]:
        near = SAME * self.size
        if self.heavy:
            x, y = self.bodies[0], self.bodies[1].in_frame(moved)
            yield bool(np.linalg.norm(x.center - y.center) <= near)
            large = max(np.abs(x.inertia).max(), np.abs(y.inertia).max())
            yield bool(np.abs(x.inertia - y.inertia).max() <= 10 * SAME * large)
        for a, b in self.children:
            u, v = self.placed_a.axes[a], moved.rotation @ self.placed_b.axes[b]
            between = moved.transform(self.placed_b.anchors[b]) - self.placed_a.anchors[a]
            if self.placed_a.tree.links[a].kind != "hinge":
                between = 0 * between
            line = np.linalg.norm(between - u * (u @ between)) <= near
            yield bool(np.linalg.norm(np.cross(u, v)) <= SAME and line)


def turned_about(point: Array, axis: Array, angle: float) -> Place:
    """Return the rotation about a line."""
    rotation = about_axis(axis, np.array(angle), DOUBLES)
    return Place(rotation, point - rotation @ point)


def angle_of(rotation: Array) -> float:
    """Return the angle of a rotation, rad, accurate for small and large angles."""
    odd = rotation - rotation.T
    sine = float(np.linalg.norm([odd[2, 1], odd[0, 2], odd[1, 0]])) / 2
    return float(np.arctan2(sine, (np.trace(rotation) - 1) / 2))


def paired_links(
    placed_a: PlacedTree, placed_b: PlacedTree, names: Sequence[tuple[str, str]]
) -> tuple[tuple[LinkPair, ...], tuple[tuple[str, str, str], ...]]:
    """Return index pairs of links by their joints' names, parents first, and mismatched pairs.

    A mismatch is the name in A, and phrases for A and B.
    """
    partner = dict(names)
    good: list[LinkPair] = []
    odd: list[tuple[str, str, str]] = []
    for name, its in sorted(names, key=lambda pair: placed_a.index[pair[0]]):
        if placed_a.kind(name) != placed_b.kind(its):
            odd.append((name, f"a {placed_a.kind(name)}", f"a {placed_b.kind(its)}"))
            continue
        carriers = placed_a.parent(name), placed_b.parent(its)
        if partner.get(carriers[0], "") != carriers[1]:
            here, there = (f"on {one}" if one else "on the base" for one in carriers)
            odd.append((name, here, there))
            continue
        good.append((placed_a.index[name], placed_b.index[its]))
    return tuple(good), tuple(odd)
