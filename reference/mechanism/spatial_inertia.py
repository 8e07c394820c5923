"""Bodies welded together as one: mass, center and inertia by Steiner's theorem."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from physics_crosscheck.reference.mechanism.numeric import Array


class Place(NamedTuple):
    """A frame in another: its axes as columns, (3, 3), and its origin, m, (3,)."""

    rotation: Array
    origin: Array

    def of(self, inner: Place) -> Place:
        """Where a frame is that stands in this one."""
        return Place(self.rotation @ inner.rotation, self.at(inner.origin))

    def at(self, point: Array) -> Array:
        """Where a point (3,) of this frame is."""
        return self.origin + self.rotation @ point


HERE = Place(np.eye(3), np.zeros(3))


class Lump(NamedTuple):
    """A rigid body: kg, center of mass in m, (3,), inertia about it in kg m^2, (3, 3)."""

    mass: float
    center: Array
    inertia: Array

    def seen(self, place: Place) -> Lump:
        """The same from the frame in which its own stands."""
        rotation = place.rotation
        return Lump(self.mass, place.at(self.center), rotation @ self.inertia @ rotation.T)

    def with_(self, other: Lump) -> Lump:
        """Both as one; their masses don't cancel."""
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
        return Lump(mass, center, self.inertia + other.inertia + spread)


NOTHING = Lump(0.0, np.zeros(3), np.zeros((3, 3)))
