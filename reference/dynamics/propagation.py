"""Quantities that links of a tree pass to each other: poses, motions, inertias and forces.

As in `reference.dynamics.recursion`, accelerations are the usual ones of points, in each link's own
frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.reference.mechanism.rotations import (
    Field,
    Scalars,
    cross,
    product,
    rotate,
    rotate_back,
    turn_parts,
    weighted,
)
from physics_crosscheck.reference.mechanism.tree import TreeLink

INERTIAS = np.array([
    np.outer(one, other) + (np.outer(other, one) if k > 2 else 0)
    for k, (one, other) in enumerate(
        (np.eye(3)[i], np.eye(3)[j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    )
]).swapaxes(0, 1)  # fmt: skip
"""Basis matrices of an inertia, for xx, yy, zz, xy, xz, yz, (3, 6, 3): rows first."""


class Placement(NamedTuple):
    """A frame in another: its axes as columns, (3, 3, ...), and its origin, (3, ...)."""

    rotation: Scalars
    origin: Scalars


class Moving(NamedTuple):
    """Angular velocity of a link and velocity of its origin, (3, ...) each."""

    angular: Scalars
    linear: Scalars


Acting = tuple[Scalars, Scalars]
"""A force on a link, and its moment about the link's origin, (3, ...) each."""


@dataclass(frozen=True)
class LinkNumbers:
    """A link's constants in the number type of the recursion; scalars are arrays (1,).

    A hinge at an angle has the rotation `turned_by(turned, angle, field)` in its parent's frame.

    Libraries of symbols treat a product of symbol and array in their own way.
    """

    placement: Placement
    axis: Scalars
    turned: Scalars
    turning: Scalars
    sliding: Scalars
    mass: Scalars
    armature: Scalars
    center: Scalars
    inertia: Scalars


class Composite(NamedTuple):
    """Mass, first moment (3, ...) and inertia (3, 3, ...), about a frame's origin."""

    mass: Scalars
    moment: Scalars
    inertia: Scalars

    def momentum(
        self, turning: Scalars, sliding: Scalars, rows: slice, batch: tuple[int, ...]
    ) -> WrenchColumns:
        """Return linear momentum, and angular momentum about the origin, per joint velocity."""
        ones = (1,) * len(batch)
        angular, linear = (part.reshape(3, -1, *ones) for part in (turning, sliding))
        first = self.moment[:, None]
        moment = product(self.inertia, angular) + cross(first, linear)
        force = self.mass * linear + cross(angular, first)
        shape = (3, angular.shape[1], *batch)
        which = np.arange(rows.start, rows.stop)
        return WrenchColumns(np.broadcast_to(force, shape), np.broadcast_to(moment, shape), which)

    def in_frame(self, placed: Placement, field: Field) -> Composite:
        """Return the same body in the outer frame (parallel axis theorem)."""
        r, moment = placed.origin, rotate(placed.rotation, self.moment)
        inertia = self.inertia.reshape(3, 3, *self.inertia.shape[2:] or (1,) * (r.ndim - 1))
        rotated = product(product(placed.rotation, inertia), np.swapaxes(placed.rotation, 0, 1))
        eye = field.array(np.eye(3)).reshape(3, 3, *(1,) * (r.ndim - 1))
        square = self.mass * (r * r).sum(axis=0) + 2 * (r * moment).sum(axis=0)
        mixed = r[:, None] * moment[None]
        whole = rotated + square * eye - self.mass * r[:, None] * r[None]
        return Composite(
            self.mass, moment + self.mass * r, whole - mixed - np.swapaxes(mixed, 0, 1)
        )

    def combined(self, other: Composite) -> Composite:
        """Return the composite of both bodies."""
        inertia_ = self.inertia
        inertia = (
            inertia_.reshape(3, 3, *(1,) * (other.inertia.ndim - 2))
            if inertia_.ndim == 2
            else inertia_
        )
        return Composite(
            self.mass + other.mass, self.moment + other.moment, inertia + other.inertia
        )


class WrenchColumns(NamedTuple):
    """Forces at a link for unit accelerations of some velocities, `which`: (3, columns, ...)."""

    force: Scalars
    moment: Scalars
    which: NDArray[np.intp]

    @staticmethod
    def none(field: Field, batch: tuple[int, ...]) -> WrenchColumns:
        """Return columns of no velocity."""
        empty = field.array(np.zeros((3, 0, *batch)))
        return WrenchColumns(empty, empty, np.arange(0))

    def joined(self, other: WrenchColumns) -> WrenchColumns:
        """Return the columns of both."""
        pairs = zip(self[:2], other[:2], strict=True)
        force, moment = (np.concatenate(pair, axis=1) for pair in pairs)
        return WrenchColumns(force, moment, np.concatenate([self.which, other.which]))

    def in_parent(self, placed: Placement) -> WrenchColumns:
        """Return the same columns in the parent's frame."""
        return WrenchColumns(*carried_down(placed, self.force, self.moment), self.which)


class LinkMotion(NamedTuple):
    """Angular velocity and acceleration of a link, and acceleration of its origin."""

    angular: Scalars
    turning: Scalars
    linear: Scalars

    def wrench(self, link: LinkNumbers) -> tuple[Scalars, Scalars]:
        """Return the force, and moment about the origin, that cause this motion (Newton, Euler)."""
        center = tall(link.center, self.linear.shape[1:])
        w, dw = self.angular, self.turning
        force = link.mass * (self.linear + cross(dw, center) + cross(w, cross(w, center)))
        spin = weighted(link.inertia, w)
        return force, weighted(link.inertia, dw) + cross(w, spin) + cross(center, force)

    def wrench_regressor(self, field: Field) -> tuple[Scalars, Scalars]:
        """Return the derivatives of this wrench by the ten inertial parameters, (3, 10, ...)."""
        w, dw = self.angular[:, None], self.turning[:, None]
        eye = field.array(np.eye(3)).reshape(3, 3, *(1,) * (self.linear.ndim - 1))
        centers = cross(dw, eye) + cross(w, cross(w, eye))
        still, point = 0 * centers, self.linear[:, None]
        inertias = field.array(INERTIAS)
        spun = weighted(inertias, self.angular)
        moments = weighted(inertias, self.turning) + cross(w, spun)
        force = np.concatenate([point, centers, still, still], axis=1)
        return force, np.concatenate([0 * point, cross(eye, point), moments], axis=1)

    def child(
        self, here: Placement, link: LinkNumbers, v: Scalars, a: Scalars | None
    ) -> LinkMotion:
        """Return the motion of a child link; without `a` its joint velocities are constant."""
        w, r = self.angular, here.origin
        carried = rotate_back(here.rotation, w)
        turning, sliding = weighted(link.turning, v), weighted(link.sliding, v)
        point = self.linear + cross(self.turning, r) + cross(w, cross(w, r))
        angular = rotate_back(here.rotation, self.turning) + cross(carried, turning)
        linear = rotate_back(here.rotation, point) + cross(2 * carried + turning, sliding)
        if a is not None:
            angular = angular + weighted(link.turning, a)
            linear = linear + weighted(link.sliding, a)
        return LinkMotion(carried + turning, angular, linear)


def carried_down(placed: Placement, force: Scalars, moment: Scalars) -> tuple[Scalars, Scalars]:
    """Return columns of forces and moments, (3, columns, ...), in the parent's frame."""
    force, moment = (product(placed.rotation, part) for part in (force, moment))
    return force, moment + cross(placed.origin[:, None], force)


def numbers_of(link: TreeLink, field: Field) -> LinkNumbers:
    """Return a link's constants in a number type."""
    turning, sliding = link.motion
    rotation, axis = field.array(link.rotation), field.array(link.axis)
    return LinkNumbers(
        placement=Placement(rotation, field.array(link.position)),
        axis=axis,
        turned=np.stack([product(rotation, part) for part in turn_parts(axis, field)]),
        turning=field.array(turning),
        sliding=field.array(sliding),
        mass=field.array([link.mass]),
        armature=field.array([link.armature]),
        center=field.array(link.center),
        inertia=field.array(link.inertia),
    )


def tall(vector: Scalars, batch: tuple[int, ...]) -> Scalars:
    """Return a vector (3,) shaped to broadcast with a batch, (3, 1, ...)."""
    return vector.reshape(3, *(1,) * len(batch))


def widened(body: Composite, here: Placement) -> Composite:
    """Return a body whose inertia broadcasts with a batch."""
    if body.inertia.ndim > 2 or here.origin.ndim == 1:
        return body
    return body._replace(inertia=body.inertia.reshape(3, 3, *(1,) * (here.origin.ndim - 1)))
