"""Distances and surfaces of primitive shapes in closed form.

Any direction n bounds the distance of two convex shapes from below, by the gap between their
supporting planes along n. Source: Ericson, Real-Time Collision Detection, chapters 3 to 5 and 9.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import nnls

from physics_crosscheck.reference.mechanism.numeric import Array

KINDS = "plane", "sphere", "capsule", "ellipsoid", "cylinder", "box"
"""Kinds with a support function; a plane is the ground below it."""

ROUND = "sphere", "capsule"

STEPS, NEAR = 30, 1e-3
"""Steps of a search for a common point, and the distance that ends it, relative to the shapes."""

UNIQUE = 1e-6
"""Smallest difference, relative to a shape, that makes a normal unique."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Solid:
    """A shape in the world.

    Attributes:
        kind: one of `KINDS`.
        size: radius; half edges; radius and half length along z; half axes, m.
        rotation, origin: its frame, (3, 3) and (3,).
    """

    kind: str
    size: tuple[float, ...]
    rotation: Array
    origin: Array

    @property
    def axis(self) -> Array:
        """The z axis, (3,)."""
        axis: Array = self.rotation[:, 2]
        return axis

    @cached_property
    def extent(self) -> float:
        """Largest distance of a point from the origin, m."""
        if self.kind in ROUND:
            return float(sum(self.size))
        return np.inf if self.kind == "plane" else float(np.linalg.norm(self.size))

    @property
    def half_length(self) -> float:
        """Half the distance between the centres of a capsule's ends, m; 0 for a sphere."""
        return self.size[1] if self.kind == "capsule" else 0.0

    def scaled(self, factor: float) -> Solid:
        """Return the shape with other sizes."""
        return replace(self, size=tuple(factor * one for one in self.size))

    def support(self, direction: Array) -> Array:
        """Return the farthest point along a unit vector, (3,)."""
        u = self.rotation.T @ direction
        ends = np.where(u < 0, -1.0, 1.0)
        if self.kind == "box":
            local = ends * self.size
        elif self.kind == "ellipsoid":
            stretched = np.asarray(self.size) * u
            local = np.array(self.size) * stretched / np.linalg.norm(stretched)
        elif self.kind == "cylinder":
            radial = np.hypot(u[0], u[1])
            rim = self.size[0] * u[:2] / radial if radial > 0 else np.zeros(2)
            local = np.array([*rim, ends[2] * self.size[1]])
        else:
            local = self.size[0] * u + np.array([0.0, 0.0, ends[2] * self.half_length])
        point: Array = self.origin + self.rotation @ local
        return point

    def height(self, point: Array) -> tuple[float, Array | None]:
        """Return the signed distance of a point and its gradient, (3,), or None if not unique.

        An ellipsoid has none: its distance is NaN.
        """
        p = self.rotation.T @ (point - self.origin)
        if self.kind == "plane":
            return float(p[2]), self.axis
        if self.kind == "ellipsoid":
            return np.nan, None
        if self.kind in ROUND:
            apart = p - [0.0, 0.0, np.clip(p[2], -self.half_length, self.half_length)]
            far = float(np.linalg.norm(apart))
            return far - self.size[0], self._outwards(apart, far)
        if self.kind == "box":
            beyond, ways = np.abs(p) - self.size, np.diag(np.where(p < 0, -1.0, 1.0))
        else:
            radial = float(np.hypot(p[0], p[1]))
            beyond = np.array([radial - self.size[0], abs(p[2]) - self.size[1]])
            out = p[:2] / radial if radial > UNIQUE * self.extent else np.full(2, np.nan)
            ways = np.array([[*out, 0.0], [0.0, 0.0, -1.0 if p[2] < 0 else 1.0]])
        if np.max(beyond) > 0:
            outside = beyond > 0
            apart = beyond[outside] @ ways[outside]
            far = float(np.linalg.norm(beyond[outside]))
            return far, self._outwards(apart, far)
        *_, second, largest = np.sort(beyond)
        way = (
            ways[int(np.argmax(beyond))] if largest - second > UNIQUE * self.extent else ways[0] * 0
        )
        return float(largest), self._outwards(way, float(np.linalg.norm(way)))

    def _outwards(self, apart: Array, size: float) -> Array | None:
        """Return a unit vector in the world; None for one that is too short, or unknown."""
        if not size > UNIQUE * self.extent and not np.isclose(size, 1.0):
            return None
        way: Array = self.rotation @ (apart / size)
        return way if np.isfinite(way).all() else None


def distance(first: Solid, other: Solid) -> tuple[float, Array | None] | None:
    """Return the signed distance of two shapes and the normal from the first to the other one.

    A normal with several directions is left out, and all without a closed form.
    """
    if first.kind == other.kind == "capsule":
        mine, theirs = _closest(first, other)
        far = float(np.linalg.norm(theirs - mine))
        unique = far > UNIQUE * first.size[0]
        return far - first.size[0] - other.size[0], (theirs - mine) / far if unique else None
    if first.kind == "plane" or other.kind == "sphere":
        return _from(first, other)
    if other.kind == "plane" or first.kind == "sphere":
        back = _from(other, first)
        return back and (back[0], None if back[1] is None else -back[1])
    return None


def _from(first: Solid, other: Solid) -> tuple[float, Array | None] | None:
    """Return the distance of a plane and any other shape, or of any shape and a sphere."""
    if first.kind == "plane":
        point = other.support(-first.axis)
        return float(first.axis @ (point - first.origin)), first.axis
    height, normal = first.height(other.origin)
    return None if np.isnan(height) else (height - other.size[0], normal)


def _closest(first: Solid, other: Solid) -> tuple[Array, Array]:
    """Return the closest points of two capsules' axes, (3,) each."""
    ends, cosine = (first.half_length, other.half_length), float(first.axis @ other.axis)
    apart = other.origin - first.origin
    along, back = float(apart @ first.axis), float(apart @ other.axis)
    sine = 1 - cosine**2
    s = float(np.clip((along - cosine * back) / sine, -ends[0], ends[0])) if sine > 1e-12 else 0.0
    t = float(np.clip(s * cosine - back, -ends[1], ends[1]))
    s = float(np.clip(t * cosine + along, -ends[0], ends[0]))
    return first.origin + s * first.axis, other.origin + t * other.axis


def gap(first: Solid, other: Solid, normal: Array) -> float:
    """Return the distance of the supporting planes along a normal from the first to the other."""
    if first.kind == "plane":
        return float(first.axis @ (other.support(-first.axis) - first.origin))
    if other.kind == "plane":
        return float(other.axis @ (first.support(-other.axis) - other.origin))
    return float(normal @ (other.support(-normal) - first.support(normal)))


def overlap(first: Solid, other: Solid) -> bool | None:
    """Return whether two shapes have a point in common; None if a search does not find out.

    The point of the hull of some differences of their points that is nearest to the origin is
    refined by the supporting point towards the origin (Gilbert, Johnson, Keerthi).
    """
    if "plane" in (first.kind, other.kind):
        return gap(first, other, first.axis) <= 0
    apart, size = other.origin - first.origin, min(first.extent, other.extent)
    corners: list[Array] = []
    for _ in range(STEPS):
        far = float(np.linalg.norm(apart))
        if far <= NEAR * size:
            return True
        way = apart / far
        corners.append(other.support(-way) - first.support(way))
        if float(way @ corners[-1]) > 0:
            return False
        apart = _nearest(np.array(corners).T, size)
    return None


def _nearest(points: Array, size: float) -> Array:
    """Return the point of a hull, (3, n), that is nearest to the origin, (3,)."""
    heavy = 1e3 * size  # makes the shares' sum about one
    rows = np.vstack([points, np.full((1, points.shape[1]), heavy)])
    shares, _ = nnls(rows, np.array([0.0, 0.0, 0.0, heavy]))
    result: Array = points @ shares / np.sum(shares)
    return result
