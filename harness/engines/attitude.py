"""Rotations as three coordinates whose rates are velocities, for engines that use quaternions.

The coordinates are p = 4 tan(angle/4) times the axis: four times the modified Rodrigues parameters
(Schaub and Junkins, Analytical Mechanics of Space Systems, section 3.6). Quaternions have their
real part first. Angular velocities are in the axes of the rotating body. All arrays may have
leading dimensions.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from physics_crosscheck.harness.engines.protocol import Array

AXES = ("x", "y", "z")


def rotation_names(joint: str) -> tuple[str, ...]:
    """Return the names of a joint's three rotation coordinates."""
    return tuple(f"{joint}:r{axis}" for axis in AXES)


def place_names(joint: str) -> tuple[str, ...]:
    """Return the names of a free joint's three position coordinates."""
    return tuple(f"{joint}:{axis}" for axis in AXES)


def quaternion(p: Array) -> Array:
    """Return the unit quaternions (..., 4) of coordinates (..., 3)."""
    s = p / 4
    square = np.sum(s * s, axis=-1, keepdims=True)
    result: Array = np.concatenate([1 - square, 2 * s], axis=-1) / (1 + square)
    return result


def coordinates(q: Array, near: Array) -> Array:
    """Return the coordinates (..., 3) of quaternions (..., 4), with the sign nearer to `near`."""
    towards = np.sum(q * near, axis=-1, keepdims=True)
    q = np.where(towards < 0, -q, q)
    result: Array = 4 * q[..., 1:] / (np.linalg.norm(q, axis=-1, keepdims=True) + q[..., :1])
    return result


def rate(p: Array, angular: Array) -> Array:
    """Return dp/dt, (..., 3), of an angular velocity."""
    s = p / 4
    square, along = _dot(s, s), _dot(s, angular)
    result: Array = (1 - square) * angular + 2 * cross(s, angular) + 2 * s * along
    return result


def angular_velocity(p: Array, rates: Array) -> Array:
    """Return the angular velocity, (..., 3), of dp/dt."""
    s = p / 4
    square, along = _dot(s, s), _dot(s, rates)
    result: Array = (1 - square) * rates - 2 * cross(s, rates) + 2 * s * along
    return result / (1 + square) ** 2


def product(first: Array, second: Array) -> Array:
    """Multiply two quaternions (..., 4); the second one rotates first."""
    w, x, v, y = first[..., :1], first[..., 1:], second[..., :1], second[..., 1:]
    result: Array = np.concatenate([w * v - _dot(x, y), w * y + v * x + cross(x, y)], axis=-1)
    return result


def exponential(vector: Array) -> Array:
    """Return the quaternion of a rotation vector (..., 3): angle times axis."""
    half = np.sqrt(_dot(vector, vector)) / 2
    result: Array = np.concatenate([np.cos(half), np.sinc(half / np.pi) / 2 * vector], axis=-1)
    return result


def matrix(q: Array) -> Array:
    """Return the rotation matrix, (..., 3, 3), of a quaternion of any length."""
    w, x, y, z = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    result: Array = np.empty((*q.shape[:-1], 3, 3))
    result[..., 0, 0] = w * w + x * x - y * y - z * z
    result[..., 1, 1] = w * w - x * x + y * y - z * z
    result[..., 2, 2] = w * w - x * x - y * y + z * z
    result[..., 0, 1], result[..., 1, 0] = 2 * (x * y - w * z), 2 * (x * y + w * z)
    result[..., 0, 2], result[..., 2, 0] = 2 * (x * z + w * y), 2 * (x * z - w * y)
    result[..., 1, 2], result[..., 2, 1] = 2 * (y * z - w * x), 2 * (y * z + w * x)
    return result / (w * w + x * x + y * y + z * z)[..., None, None]


def from_rpy(rpy: Sequence[float] | Array) -> Array:
    """Return Rz(yaw) Ry(pitch) Rx(roll), (3, 3); an empty `rpy` gives the identity."""
    roll, pitch, yaw = rpy if len(rpy) else (0.0, 0.0, 0.0)
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def cross(first: Array, second: Array) -> Array:
    """Return the cross product, (..., 3); for one pair `numpy.cross` takes five times as long."""
    a, b, c = first[..., 0], first[..., 1], first[..., 2]
    x, y, z = second[..., 0], second[..., 1], second[..., 2]
    result: Array = np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=-1)
    return result


def _dot(first: Array, second: Array) -> Array:
    result: Array = np.sum(first * second, axis=-1, keepdims=True)
    return result


def turned(turn: Array, vectors: Array) -> Array:
    """Rotate vectors (B, 3), each by its own matrix."""
    result: Array = (turn @ vectors[..., None])[..., 0]
    return result
