"""Spatial inertia of welded bodies: mass, center and inertia by the parallel axis theorem."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .rotations import Array


class Place(NamedTuple):
    """A frame in another: its axes as columns, (3, 3), and its origin, m, (3,)."""

    rotation: Array
    origin: Array

    def compose(self, inner: Place) -> Place:
        """Return the pose of a frame given in this one."""
        return Place(self.rotation @ inner.rotation, self.transform(inner.origin))

    def transform(self, point: Array) -> Array:
        """Return a point (3,) of this frame in the outer frame."""
        return self.origin + self.rotation @ point


IDENTITY = Place(np.eye(3), np.zeros(3))


class SpatialInertia(NamedTuple):
    """A rigid body: mass in kg, center in m, (3,), central inertia in kg m^2, (3, 3)."""

    mass: float
    center: Array
    inertia: Array

    def in_frame(self, place: Place) -> SpatialInertia:
        """Return the same body in the outer frame."""
        rotation = place.rotation
        return SpatialInertia(
            self.mass, place.transform(self.center), rotation @ self.inertia @ rotation.T
        )

    def combined(self, other: SpatialInertia) -> SpatialInertia:
        """Return both bodies welded together; their masses must not cancel."""
        if other.mass == 0.0:  # so that adding nothing changes no digit
            return self._replace(inertia=self.inertia + other.inertia)
        if self.mass == 0.0:
            return other._replace(inertia=self.inertia + other.inertia)
        mass = self.mass + other.mass
        apart = other.center - self.center
        center = self.center + other.mass / mass * apart
        spread = (
            self.mass * other.mass / mass * (apart @ apart * np.eye(3) - np.outer(apart, apart))
        )
        return SpatialInertia(mass, center, self.inertia + other.inertia + spread)


NO_INERTIA = SpatialInertia(0.0, np.zeros(3), np.zeros((3, 3)))
