"""Rotations as three coordinates whose rates are velocities, for engines that keep quaternions.

p = 4 tan(angle/4) times the axis, four times the modified Rodrigues parameters (Schaub and Junkins,
Analytical Mechanics of Space Systems, section 3.6). Quaternions have their real part first; angular
velocities are in the axes of what turns. All arrays may have leading dimensions.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from physics_crosscheck.harness.engines.protocol import Array

AXES = ("x", "y", "z")


def rotation_names(joint: str) -> tuple[str, ...]:
    """Of the three coordinates of a joint."""
    return tuple(f"{joint}:r{axis}" for axis in AXES)


def place_names(joint: str) -> tuple[str, ...]:
    """Of the place of what a free joint carries."""
    return tuple(f"{joint}:{axis}" for axis in AXES)


def quaternion(p: Array) -> Array:
    """(..., 4) of (..., 3), of length one."""
    s = p / 4
    square = np.sum(s * s, axis=-1, keepdims=True)
    found: Array = np.concatenate([1 - square, 2 * s], axis=-1) / (1 + square)
    return found


def coordinates(q: Array, near: Array) -> Array:
    """(..., 3) of quaternions (..., 4), of the two signs that which is nearer to `near`."""
    towards = np.sum(q * near, axis=-1, keepdims=True)
    q = np.where(towards < 0, -q, q)
    found: Array = 4 * q[..., 1:] / (np.linalg.norm(q, axis=-1, keepdims=True) + q[..., :1])
    return found


def rate(p: Array, angular: Array) -> Array:
    """dp/dt, (..., 3)."""
    s = p / 4
    square, along = _dot(s, s), _dot(s, angular)
    found: Array = (1 - square) * angular + 2 * cross(s, angular) + 2 * s * along
    return found


def angular_velocity(p: Array, rates: Array) -> Array:
    """Of dp/dt, (..., 3)."""
    s = p / 4
    square, along = _dot(s, s), _dot(s, rates)
    found: Array = (1 - square) * rates - 2 * cross(s, rates) + 2 * s * along
    return found / (1 + square) ** 2


def product(one: Array, other: Array) -> Array:
    """Of two quaternions (..., 4): turned by the other first."""
    w, x, v, y = one[..., :1], one[..., 1:], other[..., :1], other[..., 1:]
    found: Array = np.concatenate([w * v - _dot(x, y), w * y + v * x + cross(x, y)], axis=-1)
    return found


def exponential(turned: Array) -> Array:
    """The quaternion of a rotation by so much about an axis, which `turned` (..., 3) is along."""
    half = np.sqrt(_dot(turned, turned)) / 2
    found: Array = np.concatenate([np.cos(half), np.sinc(half / np.pi) / 2 * turned], axis=-1)
    return found


def matrix(q: Array) -> Array:
    """The rotation of a quaternion of any length, (..., 3, 3)."""
    w, x, y, z = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    found: Array = np.empty((*q.shape[:-1], 3, 3))
    found[..., 0, 0] = w * w + x * x - y * y - z * z
    found[..., 1, 1] = w * w - x * x + y * y - z * z
    found[..., 2, 2] = w * w - x * x - y * y + z * z
    found[..., 0, 1], found[..., 1, 0] = 2 * (x * y - w * z), 2 * (x * y + w * z)
    found[..., 0, 2], found[..., 2, 0] = 2 * (x * z + w * y), 2 * (x * z - w * y)
    found[..., 1, 2], found[..., 2, 1] = 2 * (y * z - w * x), 2 * (y * z + w * x)
    return found / (w * w + x * x + y * y + z * z)[..., None, None]


def from_rpy(rpy: Sequence[float] | Array) -> Array:
    """Rz(yaw) Ry(pitch) Rx(roll), (3, 3), of roll, pitch and yaw; of none the identity."""
    roll, pitch, yaw = rpy if len(rpy) else (0.0, 0.0, 0.0)
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def cross(one: Array, other: Array) -> Array:
    """The cross product, (..., 3); numpy's own costs five times as much for one pair."""
    a, b, c = one[..., 0], one[..., 1], one[..., 2]
    x, y, z = other[..., 0], other[..., 1], other[..., 2]
    found: Array = np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=-1)
    return found


def _dot(one: Array, other: Array) -> Array:
    found: Array = np.sum(one * other, axis=-1, keepdims=True)
    return found


def turned(turn: Array, of: Array) -> Array:
    """Vectors (B, 3), each by its own matrix."""
    found: Array = (turn @ of[..., None])[..., 0]
    return found
