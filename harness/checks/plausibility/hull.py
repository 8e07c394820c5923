"""Convex hulls of shapes, and their mass properties at uniform density."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from physics_crosscheck.harness.documents.sdf.frames import solid
from physics_crosscheck.reference.mechanism.rotations import Array, Place

SOLIDS = ("box", "sphere", "ellipsoid", "cylinder", "capsule")
"""Forms of shapes with a volume, besides meshes."""

_ROUND = 16
"""Number of points on a circle."""


@dataclass(frozen=True, eq=False)
class Hull:
    """A convex hull with a volume.

    Attributes:
        points: its corners, m, (n, 3).
        planes: unit normals that point outwards, and offsets, m, (m, 4).
        volume: m^3.
        area: m^2.
        center: of volume, m, (3,).
        tensor: moments of inertia about the center at uniform density, per kg, m^2, (3, 3).
    """

    points: Array
    planes: Array
    volume: float
    area: float
    center: Array
    tensor: Array

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Lowest and highest corner of its bounding box, m, each (3,)."""
        return self.points.min(axis=0), self.points.max(axis=0)

    @property
    def diagonal(self) -> float:
        """Diagonal of its bounding box, m."""
        return float(np.linalg.norm(self.box[1] - self.box[0]))

    def is_near(self, other: Hull) -> bool:
        """Return whether their bounding boxes overlap."""
        (low, high), (start, end) = self.box, other.box
        return bool((low <= end).all() and (start <= high).all())

    def outside(self, point: Array) -> float:
        """Return the distance of a point from the farthest plane that it is beyond, m."""
        return float(max((self.planes[:, :3] @ point + self.planes[:, 3]).max(), 0.0))

    def farthest(self, point: Array) -> float:
        """Return the largest distance between a point and the hull, m."""
        return float(np.linalg.norm(self.points - point, axis=1).max())

    def moments_about(self, point: Array) -> Array:
        """Return the moments of inertia per kg about a point, m^2, (3, 3)."""
        apart = self.center - point
        return self.tensor + apart @ apart * np.eye(3) - np.outer(apart, apart)


def hull_of(points: Array) -> Hull | None:
    """Return the convex hull of points, (n, 3); None if they lie in a plane."""
    if len(points) < 4:
        return None
    hull = _hull(points)
    if hull is None:
        return None
    corners = points[hull.vertices]
    middle = corners.mean(axis=0)
    triangles = points[hull.simplices] - middle
    volumes = np.abs(np.linalg.det(triangles)) / 6
    volume = float(volumes.sum())
    if not volume > 0:
        return None
    sums = triangles.sum(axis=1)
    center = (volumes[:, None] * sums).sum(axis=0) / 4 / volume
    second = np.einsum("t,tip,tiq->pq", volumes, triangles, triangles)
    second += np.einsum("t,tp,tq->pq", volumes, sums, sums)
    second = second / 20 / volume - np.outer(center, center)
    tensor = np.trace(second) * np.eye(3) - second
    planes = np.array(hull.equations)
    return Hull(corners, planes, volume, float(hull.area), middle + center, tensor)


def extreme_points(points: Array) -> Array:
    """Return the corners of the convex hull of points; all points if they lie in a plane."""
    if len(points) < 64:
        return points
    hull = _hull(points)
    corners: Array = points if hull is None else points[hull.vertices]
    return corners


def _hull(points: Array) -> Any:
    """Return scipy's convex hull; None if the points lie in a plane."""
    # Import late: it takes a tenth of a worker's start, and few targets have shapes.
    from scipy.spatial import ConvexHull, QhullError

    try:
        return ConvexHull(points)
    except (QhullError, ValueError):
        return None


def solid_points(kind: str, sizes: Sequence[float]) -> Array:
    """Return points on a solid whose hull is nearly the solid, in its frame, m, (n, 3).

    Args:
        kind: one of `SOLIDS`.
        sizes: half edges, radii, or a radius and half a length, m.
    """
    if kind == "box":
        corners = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T
        return scaled(corners, sizes)
    if kind == "sphere":
        return _ball() * sizes[0]
    if kind == "ellipsoid":
        return scaled(_ball(), sizes)
    radius, length = sizes
    end = np.array([0.0, 0.0, length])
    if kind == "capsule":
        ball = _ball() * radius
        return np.concatenate([ball + end, ball - end])
    ring = _ring() * radius
    return np.concatenate([ring - end, ring + end])


def uniform(kind: str, sizes: Sequence[float]) -> tuple[float, Array]:
    """Return the volume of a solid, m^3, and its moments per kg at uniform density, m^2, (3,).

    Sizes as in `solid_points`.
    """
    radius, *half = sizes
    if kind != "ellipsoid":
        sizes = [2 * radius if kind == "box" else radius, *(2 * one for one in half)]
    volume, _, moments = solid(kind, sizes)
    return volume, np.array(moments)


def scaled(points: Array, factors: Sequence[float]) -> Array:
    """Return points (n, 3) scaled along each axis."""
    result: Array = points * np.array(factors)
    return result


def placed_points(points: Array, place: Place) -> Array:
    """Return points (n, 3) of a frame in the outer frame."""
    moved: Array = points @ place.rotation.T + place.origin
    return moved


def _ring() -> Array:
    angles = np.linspace(0, 2 * np.pi, _ROUND, endpoint=False)
    ring: Array = np.stack([np.cos(angles), np.sin(angles), np.zeros(_ROUND)], axis=1)
    return ring


def _ball() -> Array:
    """Return points on the unit sphere, nearly evenly."""
    count = 8 * _ROUND
    heights = 1 - 2 * (np.arange(count) + 0.5) / count
    angles = np.pi * (1 + 5**0.5) * np.arange(count)
    radii = np.sqrt(1 - heights**2)
    ball: Array = np.stack([radii * np.cos(angles), radii * np.sin(angles), heights], axis=1)
    return ball
