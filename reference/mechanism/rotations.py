"""Vectors and rotations over any number type, in batches.

Components come first and the batch after them: a vector is (3, ...), a matrix (3, 3, ...). A batch
is then one array operation. The same code handles doubles, long doubles, mpmath numbers and
symbols. Quaternions have their real part first, and angular velocities are in the body's axes.

A rotation's minimal coordinates are p = 4 tan(angle/4) axis, four times the modified Rodrigues
parameters (Schaub and Junkins, Analytical Mechanics of Space Systems, section 3.6). They are close
to the rotation vector, rational in both directions, and smooth for all angles below a full turn.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

Scalars = NDArray[Any]
"""Numbers, or other objects that support addition and multiplication."""

VANISHING = 1e-300
"""Added to squares to avoid division by zero; negligible beside any nonzero square."""

SMALL = 1e-3
"""Half angle, rad, below which a series is more accurate than the quotient."""

_NEXT, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])


@dataclass(frozen=True)
class Field:
    """A number type with its functions other than arithmetic.

    Attributes:
        dtype: array type.
        sin, cos: elementwise functions of arrays.
        number: conversion from a double.
    """

    dtype: Any
    sin: Callable[[Any], Any]
    cos: Callable[[Any], Any]
    number: Callable[[float], Any]

    def array(self, values: Any) -> Scalars:
        """Return an array of this number type from doubles."""
        plain = np.asarray(values)
        if self.dtype is not object:
            return plain.astype(self.dtype)
        out = np.empty(plain.shape, dtype=object)
        for index in np.ndindex(plain.shape):
            out[index] = self.number(float(plain[index]))
        return out


DOUBLES = Field(dtype=np.float64, sin=np.sin, cos=np.cos, number=float)
LONG_DOUBLES = Field(dtype=np.longdouble, sin=np.sin, cos=np.cos, number=np.longdouble)


def objects(sin: Callable[[Any], Any], cos: Callable[[Any], Any], number: Any) -> Field:
    """Return a field of objects, such as mpmath numbers or symbols, from its sine and cosine."""
    return Field(
        dtype=object,
        sin=np.frompyfunc(sin, 1, 1),
        cos=np.frompyfunc(cos, 1, 1),
        number=number,
    )


def rotate(matrix: Scalars, vector: Scalars) -> Scalars:
    """Return R x: (3, 3, ...) by (3, ...)."""
    result: Scalars = np.einsum("ij...,j...->i...", matrix, vector)
    return result


def rotate_back(matrix: Scalars, vector: Scalars) -> Scalars:
    """Return R^T x."""
    result: Scalars = np.einsum("ij...,i...->j...", matrix, vector)
    return result


def cross(a: Scalars, b: Scalars) -> Scalars:
    """Return the cross product, (3, ...)."""
    result: Scalars = a.take(_NEXT, 0) * b.take(_LAST, 0) - a.take(_LAST, 0) * b.take(_NEXT, 0)
    return result


def weighted(matrix: Scalars, values: Scalars) -> Scalars:
    """Return a matrix times the first axis of values, (rows, ...)."""
    # A fifth of the time of `tensordot` for small arrays.
    flat: Scalars = matrix.dot(values.reshape(len(values), -1))
    return flat.reshape(*matrix.shape[:-1], *values.shape[1:])


def product(a: Scalars, b: Scalars) -> Scalars:
    """Return A B: (3, 3, ...) by (3, 3, ...)."""
    result: Scalars = np.einsum("ij...,jk...->ik...", a, b)
    return result


def about_axis(axis: Scalars, angle: Scalars, field: Field) -> Scalars:
    """Return the rotation by an angle (...) about a unit vector (3,)."""
    return turned_by(turn_parts(axis, field), angle, field)


def turn_parts(axis: Scalars, field: Field) -> Scalars:
    """Return A, B, C of the rotation A + B cos + C sin about a unit vector (3,), (3, 3, 3).

    This is Rodrigues' formula.
    """
    along = axis[:, None] * axis[None]
    return np.stack([along, field.array(np.eye(3)) - along, _skew(axis, field)])


def turned_by(parts: Scalars, angle: Scalars, field: Field) -> Scalars:
    """Return A + B cos + C sin at angles (...), (3, 3, ...)."""
    still, cosine, sine = parts.reshape(3, 3, 3, *(1,) * np.ndim(angle))
    result: Scalars = still + cosine * field.cos(angle) + sine * field.sin(angle)
    return result


def _skew(x: Scalars, field: Field) -> Scalars:
    """Return the matrix that maps y to x cross y."""
    zero = field.number(0.0)
    return np.array([[zero, -x[2], x[1]], [x[2], zero, -x[0]], [-x[1], x[0], zero]])


def from_quaternion(q: Scalars) -> Scalars:
    """Return the rotation of a quaternion (4, ...) of any nonzero length, real part first.

    It is (w^2 - x.x) 1 + 2 x x^T + 2 w [x], divided by the squared length.
    """
    w, x, y, z = q.tolist() if q.ndim == 1 else q  # numbers multiply faster outside an array
    ww, xx, yy, zz = w * w, x * x, y * y, z * z
    xy, xz, yz, wx, wy, wz = x * y, x * z, y * z, w * x, w * y, w * z
    # Nested lists of arrays would take longer.
    matrix: Scalars = np.empty((3, 3, *q.shape[1:]), dtype=np.result_type(q, 1.0))
    matrix[0, 0], matrix[1, 1], matrix[2, 2] = (
        ww + xx - yy - zz,
        ww - xx + yy - zz,
        ww - xx - yy + zz,
    )
    matrix[0, 1], matrix[1, 0] = 2 * (xy - wz), 2 * (xy + wz)
    matrix[0, 2], matrix[2, 0] = 2 * (xz + wy), 2 * (xz - wy)
    matrix[1, 2], matrix[2, 1] = 2 * (yz - wx), 2 * (yz + wx)
    matrix /= ww + xx + yy + zz
    return matrix


def from_rpy(roll: float, pitch: float, yaw: float) -> Array:
    """Return the rotation about the fixed x, then y, then z axis: R = Rz Ry Rx, (3, 3)."""
    (sr, sp, sy), (cr, cp, cy) = np.sin([roll, pitch, yaw]), np.cos([roll, pitch, yaw])
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    result: Array = about_z @ about_y @ about_x
    return result


def to_rpy(rotation: NDArray[np.float64]) -> tuple[float, float, float]:
    """Return roll, pitch and yaw of a rotation, (3, 3); at vertical pitch the yaw is arbitrary."""
    yaw = np.arctan2(rotation[1, 0], rotation[0, 0])
    sine, cosine = np.sin(yaw), np.cos(yaw)
    pitch = np.arctan2(-rotation[2, 0], cosine * rotation[0, 0] + sine * rotation[1, 0])
    across = cosine * rotation[1] - sine * rotation[0]  # the second row, rotated back by the yaw
    return float(np.arctan2(-across[2], across[1])), float(pitch), float(yaw)


def to_quaternion(rotation: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """Return the unit quaternion (w, x, y, z) of a rotation, (3, 3), by its largest component."""
    r = rotation
    products = np.array([
        [1 + r[0, 0] + r[1, 1] + r[2, 2], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
        [r[2, 1] - r[1, 2], 1 + r[0, 0] - r[1, 1] - r[2, 2], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
        [r[0, 2] - r[2, 0], r[0, 1] + r[1, 0], 1 - r[0, 0] + r[1, 1] - r[2, 2], r[1, 2] + r[2, 1]],
        [r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], 1 - r[0, 0] - r[1, 1] + r[2, 2]],
    ])  # fmt: skip
    row = products[np.argmax(np.diagonal(products))]
    w, x, y, z = (row / np.linalg.norm(row)).tolist()
    return w, x, y, z


def quaternion_rate(q: Scalars, angular: Scalars) -> Scalars:
    """Return dq/dt = q (0, w)/2 of a quaternion (4, ...), with w (3, ...) in the body frame.

    The length of q stays constant.
    """
    w, x = q[0], q[1:]
    real = -(x * angular).sum(axis=0)
    return np.concatenate([real[None], w * angular + cross(x, angular)]) / 2


def quaternion_product(a: Scalars, b: Scalars) -> Scalars:
    """Return the quaternion product, (4, ...) each, real part first: first `b`, then `a`."""
    w, x, v, y = a[:1], a[1:], b[:1], b[1:]
    real = w * v - (x * y).sum(axis=0)
    return np.concatenate([real, w * y + v * x + cross(x, y)])


def rotation_vector(q: Scalars) -> Scalars:
    """Return angle times axis, (3, ...), of a quaternion of any length; the angle is at most pi.

    It supports all number types for which NumPy has the arc tangent. It jumps where the real part
    is zero.
    """
    w, x = q[0], q[1:]
    # The quotient has a limit as x vanishes; `VANISHING` avoids 0/0.
    size = ((x * x).sum(axis=0) + VANISHING) ** 0.5
    angle = 2 * np.arctan2(size, abs(w)) * w / abs(w)
    result: Scalars = angle / size * x
    return result


def raw_quaternion(p: Scalars) -> Scalars:
    """Return the quaternion (4, ...) of minimal coordinates (3, ...), of length 1 + p.p/16."""
    s = p / 4
    if s.ndim == 1:
        x, y, z = s.tolist()  # a fourth of the time of arrays
        return np.array([1 - (x * x + y * y + z * z), 2 * x, 2 * y, 2 * z])
    real = 1 - (s * s).sum(axis=0)
    return np.concatenate([real[None], 2 * s])


def unit_quaternion(p: Scalars) -> Scalars:
    """Return the unit quaternion (4, ...) of minimal coordinates (3, ...)."""
    s = p / 4
    result: Scalars = raw_quaternion(p) / (1 + (s * s).sum(axis=0))
    return result


def minimal_coordinates(q: Scalars, near: Scalars) -> Scalars:
    """Return minimal coordinates (3, ...) of a quaternion, with the sign nearer to `near`."""
    q = np.where((q * near).sum(axis=0) < 0, -q, q)
    result: Scalars = 4 * q[1:] / (np.sqrt((q * q).sum(axis=0)) + q[0])
    return result


def coordinate_rate(p: Scalars, angular: Scalars) -> Scalars:
    """Return dp/dt, (3, ...): B w, with s = p/4 and B = (1 - s.s) 1 + 2 [s] + 2 s s^T."""
    s = p / 4
    square, along = (s * s).sum(axis=0), (s * angular).sum(axis=0)
    result: Scalars = (1 - square) * angular + 2 * cross(s, angular) + 2 * s * along
    return result


def angular_velocity(p: Scalars, rate: Scalars) -> Scalars:
    """Return the angular velocity, (3, ...), for dp/dt: B^T dp/dt / (1 + s.s)^2."""
    s = p / 4
    square, along = (s * s).sum(axis=0), (s * rate).sum(axis=0)
    back = (1 - square) * rate - 2 * cross(s, rate) + 2 * s * along
    result: Scalars = back / (1 + square) ** 2
    return result


def exponential(vector: Scalars) -> Scalars:
    """Return the unit quaternion of a rotation vector (3, ...): angle times axis."""
    half = np.sqrt((vector * vector).sum(axis=0)) / 2
    return np.concatenate([np.cos(half)[None], np.sinc(half / np.pi) / 2 * vector])


def exponential_rate(vector: Scalars, angular: Scalars) -> Scalars:
    """Return the rate of the rotation vector, (3, ...), of a body that turned by it.

    This is the inverse differential of the exponential map (Iserles, Munthe-Kaas, Norsett and
    Zanna 2000, Lie-group methods, Acta Numerica 9, section 2): w + T x w / 2 + k T x (T x w).
    """
    half = np.sqrt((vector * vector).sum(axis=0)) / 2
    near = half < SMALL
    safe = np.where(near, 1.0, half)
    share = np.where(near, (1 + half**2 / 15) / 12, (1 - safe / np.tan(safe)) / (2 * safe) ** 2)
    twist = cross(vector, angular)
    result: Scalars = angular + twist / 2 + share * cross(vector, twist)
    return result


def rotation_names(joint: str) -> tuple[str, ...]:
    """Return the names of a joint's three rotation coordinates."""
    return tuple(f"{joint}:r{axis}" for axis in "xyz")


def place_names(joint: str) -> tuple[str, ...]:
    """Return the names of a free joint's three position coordinates."""
    return tuple(f"{joint}:{axis}" for axis in "xyz")


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
