"""Forward kinematics: exact energies of bodies in a tree of slides and hinges.

A frame follows from another by a shift, a fixed rotation, a hinge or a slide. Velocities are
propagated in the frame's own axes (Luh, Walker and Paul 1980, J. Dyn. Sys. Meas. Control 102,
69-76). Each joint's sines and cosines then appear once, and the expressions stay short.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import sympy as sp

from .declaration import Coordinate, Pose

Triple = Sequence[Any]
"""Three numbers or expressions: a position, an axis, or moments of inertia."""

DIGITS = 24
"""Digits of an irrational axis component, kept as a rational: eight more than a double's."""


@dataclass(frozen=True, kw_only=True)
class Frame:
    """A frame fixed to a body.

    Attributes:
        rotation: 3 x 3, from its axes to the ground's.
        origin: position of its origin, in the ground's axes, m.
        velocity: velocity of its origin, in its own axes, m/s.
        spin: its angular velocity, in its own axes, rad/s.
    """

    rotation: sp.ImmutableMatrix
    origin: sp.ImmutableMatrix
    velocity: sp.ImmutableMatrix
    spin: sp.ImmutableMatrix

    def at(self, x: Any, y: Any, z: Any) -> Frame:
        """Return the frame shifted by x, y, z along its own axes, fixed to the same body."""
        shift = _column((x, y, z))
        return Frame(
            rotation=self.rotation,
            origin=_m(self.origin + self.rotation * shift),
            velocity=_m(self.velocity + self.spin.cross(shift)),
            spin=self.spin,
        )

    def turned(self, about: Triple, angle: Any) -> Frame:
        """Return the frame rotated by a fixed angle, rad, about an axis through its origin."""
        return self._into(rotation(about, angle))

    def hinge(self, coordinate: Coordinate, about: Triple, zero: Any = 0) -> Frame:
        """Return the frame after a hinge through the origin; `zero` is its unrotated position."""
        frame = self.turned(about, coordinate.q - sp.sympify(zero))
        spin = _m(frame.spin + _unit(about) * coordinate.v)
        return replace(frame, spin=spin)

    def slide(self, coordinate: Coordinate, along: Triple, zero: Any = 0) -> Frame:
        """Return the frame after a slide; `zero` is its unshifted position."""
        axis = _unit(along)
        frame = self.at(*(axis * (coordinate.q - sp.sympify(zero))))
        velocity = _m(frame.velocity + axis * coordinate.v)
        return replace(frame, velocity=velocity)

    def kinetic(self, mass: Any, moments: Triple, products: Triple = (0, 0, 0)) -> sp.Expr:
        """Return the kinetic energy, J, of a body whose centre of mass is the origin.

        `moments` are Ixx, Iyy, Izz about the centre of mass in the frame's axes. `products` are
        Ixy, Ixz, Iyz, with the sign of the matrix entries, kg*m^2.
        """
        xx, yy, zz = moments
        xy, xz, yz = products
        inertia = sp.Matrix([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        turning = (self.spin.T * inertia * self.spin)[0]
        return sp.sympify(mass) * self.velocity.dot(self.velocity) / 2 + turning / 2

    def weight(self, mass: Any, gravity: Triple) -> sp.Expr:
        """Return the potential energy, J, of a mass at the origin in uniform gravity.

        It is zero at the ground's origin.
        """
        return -sp.sympify(mass) * self.origin.dot(_column(gravity))

    def pose(self, name: str, description: str) -> Pose:
        """Return the frame as a named pose, for a system's `frames`."""
        return Pose(name, tuple(self.origin), description, rotation=self.rotation)

    def _into(self, turn: sp.ImmutableMatrix) -> Frame:
        back = turn.T
        parts = (self.rotation * turn, back * self.velocity, back * self.spin)
        if not turn.free_symbols:
            # Expand numbers, so that a sum of sums becomes one term per velocity again.
            parts = tuple(part.applyfunc(sp.expand) for part in parts)
        return Frame(
            rotation=_m(parts[0]), origin=self.origin, velocity=_m(parts[1]), spin=_m(parts[2])
        )


ground = Frame(
    rotation=sp.ImmutableMatrix.eye(3),
    origin=sp.ImmutableMatrix.zeros(3, 1),
    velocity=sp.ImmutableMatrix.zeros(3, 1),
    spin=sp.ImmutableMatrix.zeros(3, 1),
)
"""The fixed frame."""


def rotation(about: Triple, angle: Any) -> sp.ImmutableMatrix:
    """Return the rotation matrix about an axis of any nonzero length (Rodrigues).

    Raises:
        ValueError: if the axis has zero length.
    """
    x, y, z = axis = _unit(about)
    cross = sp.Matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = _exact(angle)
    c, s = sp.cos(angle), sp.sin(angle)
    if angle.is_number:
        c, s = _short(c), _short(s)
    return _m(c * sp.eye(3) + s * cross + (1 - c) * axis * axis.T)


def _unit(axis: Triple) -> sp.ImmutableMatrix:
    column = _column(axis)
    length = sp.sqrt(column.dot(column))
    if length == 0:
        raise ValueError(f"the axis {tuple(axis)} has no length")
    return _m((column / length).applyfunc(_short))


def _short(number: sp.Expr) -> sp.Expr:
    """Replace roots by rationals of many digits, since simplification with roots is slow."""
    if isinstance(number, sp.Rational):
        return number
    return sp.Rational(str(sp.N(number, DIGITS)))


def _column(three: Triple) -> sp.ImmutableMatrix:
    return sp.ImmutableMatrix([_exact(value) for value in three])


def _exact(value: Any) -> sp.Expr:
    """Return a decimal exactly as written: 0.6 is 3/5."""
    return sp.Rational(repr(value)) if isinstance(value, float) else sp.sympify(value)


def _m(matrix: sp.Matrix) -> sp.ImmutableMatrix:
    return sp.ImmutableMatrix(matrix)
