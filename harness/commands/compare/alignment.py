"""Alignment of two trees, joint by joint, so that each difference is reported once, in its place.

Link frames, fixed links and joint zeros are conventions. Each body of B is moved to its place
in A: with its parent, then so that its joint axis lies on that of A, then about that axis where
all that it carries is turned by one angle.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import DOUBLES, about_axis
from physics_crosscheck.reference.mechanism.spatial_inertia import IDENTITY, Place
from .placed import PlacedTree

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
    placed_a: PlacedTree,
    placed_b: PlacedTree,
    pair: LinkPair,
    moved: Place,
    carried: _Carried,
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
