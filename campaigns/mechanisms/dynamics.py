"""Equations of motion of a mechanism: Newton's and Euler's laws for every body, projected on the
joints by the bodies' Jacobians (Kane).

They share no code with the project's reference, which derives Lagrange's equations from energies as
formulas, nor with the engines' recursions. They use numpy's `longdouble`: 64 bits of mantissa on
x86, three digits more than a double. States lie along the last axis.

Source: Kane and Levinson 1985, Dynamics: Theory and Applications, ch. 4 to 6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from campaigns.mechanisms.mechanism import MJCF, MechanismLink, Numbers, RandomMechanism

Real = NDArray[Any]
Precision = type[Any]
"""`numpy.longdouble`, or `numpy.float64` where its precision suffices."""


@dataclass(frozen=True, kw_only=True)
class _Body:
    """A link's constants, in its body's frame.

    Attributes:
        turn: rotation from its frame to its parent's, 3 x 3.
        about, across: `turn` times the axis's cross matrix K, and times K^2.
        line: `turn` times the motion at joint velocity 1: the unit axis, or the axis as written in
            engines that do not normalize it.
    """

    link: MechanismLink
    position: Real
    turn: Real
    about: Real
    across: Real
    line: Real
    anchor: Real
    centre: Real
    inertia: Real


@dataclass(frozen=True, kw_only=True)
class BodyPoses:
    """Poses of every body in the world, at B states.

    Attributes:
        turns: rotation matrices, (links, 3, 3, B).
        origins: of the bodies' frames, (links, 3, B).
        points: a hinge's anchor or a slide's body frame, (links, 3, B).
        axes: of the joints, (links, 3, B).
        centres: of mass, (links, 3, B).
    """

    turns: Real
    origins: Real
    points: Real
    axes: Real
    centres: Real


class MechanismDynamics:
    """Accelerations, mass matrix and poses of a mechanism, at B states at once."""

    def __init__(self, mechanism: RandomMechanism, dtype: Precision = np.longdouble) -> None:
        self.mechanism, self.dtype = mechanism, dtype
        self._bodies = [_body(link, mechanism, dtype) for link in mechanism.links]
        self._gravity = np.array(mechanism.gravity, dtype=dtype)[:, None]
        links = mechanism.links
        self._chains: list[list[int]] = []
        for i, link in enumerate(links):
            before = self._chains[link.parent] if link.parent >= 0 else []
            self._chains.append([*before, i])
        for name in ("stiffness", "rest", "damping", "armature", "reference"):
            values = np.array([getattr(k, name) for k in links], dtype=dtype)
            setattr(self, f"_{name}", values[:, None])

    _stiffness: Real
    _rest: Real
    _damping: Real
    _armature: Real
    _reference: Real

    def poses(self, q: Real) -> BodyPoses:
        """Return the poses of all bodies at positions (n, B)."""
        count, size = q.shape
        turns = np.empty((count, 3, 3, size), self.dtype)
        origins, points, axes, centres = (np.empty((count, 3, size), self.dtype) for _ in range(4))
        moved = q - self._reference
        sines, cosines = np.sin(moved), 1 - np.cos(moved)
        world = np.broadcast_to(np.eye(3, dtype=self.dtype)[:, :, None], (3, 3, size))
        for i, body in enumerate(self._bodies):
            parent = body.link.parent
            above = turns[parent] if parent >= 0 else world
            origin = _rotate(above, body.position)
            if parent >= 0:
                origin = origin + origins[parent]
            axes[i] = _rotate(above, body.line)
            if body.link.hinge:
                local = (
                    body.turn[:, :, None]
                    + body.about[:, :, None] * sines[i]
                    + body.across[:, :, None] * cosines[i]
                )
                turns[i] = np.einsum("ijb,jkb->ikb", above, local)
                points[i] = origin + _rotate(above, body.turn @ body.anchor)
                origins[i] = points[i] - _rotate(turns[i], body.anchor)
            else:
                turns[i] = np.einsum("ijb,jk->ikb", above, body.turn)
                origins[i] = points[i] = origin + axes[i] * moved[i]
            centres[i] = origins[i] + _rotate(turns[i], body.centre)
        return BodyPoses(turns=turns, origins=origins, points=points, axes=axes, centres=centres)

    def mass_matrix(self, q: Real) -> Real:
        """Return the mass matrices, (B, n, n), at positions (B, n)."""
        still = np.zeros_like(q.T)
        mass, _ = self._mechanics(q.T.astype(self.dtype), still, still)
        return np.moveaxis(mass, -1, 0)

    def static_forces(self, q: Real) -> Real:
        """Return the joint forces of springs and weight at rest, (B, n), at positions (B, n)."""
        still = np.zeros_like(q.T)
        _, force = self._mechanics(q.T.astype(self.dtype), still, still)
        return force.T

    def acceleration(self, t: Real, q: Real, v: Real) -> Real:
        """Return accelerations (n, B) at times (B,), positions and velocities (n, B)."""
        mass, force = self._mechanics(q, v, self.inputs(t, q.shape))
        return solve_symmetric(mass, force)

    def inputs(self, t: Real, shape: tuple[int, ...]) -> Real:
        """Return the forces of the drives, (n, B), at times (B,)."""
        force = np.zeros(shape, self.dtype)
        for drive in self.mechanism.drives:
            number = self.dtype
            wave = np.sin(number(drive.rate) * t + number(drive.phase))
            force[drive.joint] += number(drive.offset) + number(drive.amplitude) * wave
        return force

    def _mechanics(self, q: Real, v: Real, inputs: Real) -> tuple[Real, Real]:
        """Return the mass matrix (n, n, B) and the force (n, B) of mass qdd = force."""
        poses = self.poses(q)
        spins, turning, moving = self._biases(poses, v)
        n, size = q.shape
        mass = np.zeros((n, n, size), self.dtype)
        force = inputs - self._stiffness * (q - self._rest) - self._damping * v
        for i, body in enumerate(self._bodies):
            chain = self._chains[i]
            turns = poses.turns[i]
            inertia = np.einsum(
                "ijb,kjb->ikb", np.einsum("ijb,jk->ikb", turns, body.inertia), turns
            )
            arm = poses.centres[i] - poses.points[i]
            spin, turned = spins[i], turning[i]
            weight = self.dtype(body.link.mass)
            applied = weight * (
                self._gravity - moving[i] - _cross(turned, arm) - _cross(spin, _cross(spin, arm))
            )
            torque = -_multiply(inertia, turned) - _cross(spin, _multiply(inertia, spin))
            linear, angular = self._jacobians(poses, i, chain)
            force[chain] += np.einsum("ajb,jb->ab", linear, applied)
            force[chain] += np.einsum("ajb,jb->ab", angular, torque)
            heavy = np.einsum("ijb,ajb->aib", inertia, angular)
            mass[np.ix_(chain, chain)] += weight * np.einsum("ajb,djb->adb", linear, linear)
            mass[np.ix_(chain, chain)] += np.einsum("ajb,djb->adb", angular, heavy)
        mass[np.arange(n), np.arange(n)] += self._armature
        return mass, force

    def _biases(self, poses: BodyPoses, v: Real) -> tuple[Real, Real, Real]:
        """Return angular velocities, and at qdd = 0 angular and joint-point accelerations."""
        spins, turning, moving = (np.zeros_like(poses.points) for _ in range(3))
        for i, body in enumerate(self._bodies):
            parent = body.link.parent
            rate = poses.axes[i] * v[i]
            if parent >= 0:
                spin, turned = spins[parent], turning[parent]
                arm = poses.points[i] - poses.points[parent]
                spins[i], turning[i] = spin, turned
                moving[i] = moving[parent] + _cross(turned, arm) + _cross(spin, _cross(spin, arm))
                if body.link.hinge:
                    turning[i] += _cross(spin, rate)
                else:
                    moving[i] += 2 * _cross(spin, rate)
            if body.link.hinge:
                spins[i] += rate
        return spins, turning, moving

    def _jacobians(self, poses: BodyPoses, i: int, chain: list[int]) -> tuple[Real, Real]:
        """Return the linear and angular Jacobians of body i for its chain, (joints, 3, B) each."""
        linear = np.empty((len(chain), *poses.centres[i].shape), self.dtype)
        angular = np.zeros_like(linear)
        for row, j in enumerate(chain):
            if self._bodies[j].link.hinge:
                angular[row] = poses.axes[j]
                linear[row] = _cross(poses.axes[j], poses.centres[i] - poses.points[j])
            else:
                linear[row] = poses.axes[j]
        return linear, angular


def _body(link: MechanismLink, mechanism: RandomMechanism, dtype: Precision) -> _Body:
    def vector(numbers: Numbers) -> Real:
        return np.array(numbers, dtype=dtype)

    quaternions = mechanism.format == MJCF
    turn = rotation(link.turn, quaternions, dtype)
    axis = vector(link.axis)
    unit = axis / np.sqrt(np.sum(axis**2))
    cross = np.array(
        [[0, -unit[2], unit[1]], [unit[2], 0, -unit[0]], [-unit[1], unit[0], 0]], dtype=dtype
    )
    moments = np.diag(vector(link.inertia[:3]))
    for (i, j), value in zip(((0, 1), (0, 2), (1, 2)), vector(link.inertia[3:]), strict=False):
        moments[i, j] = moments[j, i] = value
    inertial = rotation(link.inertial_turn, quaternions, dtype)
    # Bullet normalizes axes of rotation, but not the axes along which links move.
    line = axis if mechanism.engine == "pybullet" else unit
    return _Body(
        link=link,
        position=vector(link.position),
        turn=turn,
        about=turn @ cross,
        across=turn @ cross @ cross,
        line=turn @ line,
        anchor=vector(link.anchor),
        centre=vector(link.centre),
        inertia=inertial @ moments @ inertial.T,
    )


def rotation(turn: Numbers, quaternions: bool, dtype: Precision) -> Real:
    """Return the matrix of a quaternion (w, x, y, z) of any length, or of roll, pitch and yaw."""
    numbers = np.array(turn, dtype=dtype)
    if not turn:
        return np.eye(3, dtype=dtype)
    if quaternions:
        w, x, y, z = numbers / np.sqrt(np.sum(numbers**2))
        rows = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
        return np.array(rows, dtype=dtype)
    (a, b, c), (d, e, f) = np.cos(numbers), np.sin(numbers)
    about_x = np.array([[1, 0, 0], [0, a, -d], [0, d, a]], dtype=dtype)
    about_y = np.array([[b, 0, e], [0, 1, 0], [-e, 0, b]], dtype=dtype)
    about_z = np.array([[c, -f, 0], [f, c, 0], [0, 0, 1]], dtype=dtype)
    matrix: Real = about_z @ about_y @ about_x
    return matrix


def solve_symmetric(mass: Real, force: Real) -> Real:
    """Solve mass x = force for x (n, B) by L D L^T; numpy has no solver for `longdouble`."""
    n = len(force)
    lower = mass.copy()
    x = force.copy()
    for j in range(n):
        for i in range(j + 1, n):
            factor = lower[i, j] / lower[j, j]
            lower[i, j + 1 :] -= factor * lower[j, j + 1 :]
            x[i] -= factor * x[j]
    for i in reversed(range(n)):
        for j in range(i + 1, n):
            x[i] -= lower[i, j] * x[j]
        x[i] /= lower[i, i]
    return x


def _rotate(turns: Real, vector: Real) -> Real:
    """Return matrices (3, 3, B) times a constant vector (3,), as (3, B)."""
    product: Real = np.einsum("ijb,j->ib", turns, vector)
    return product


def _multiply(matrices: Real, vectors: Real) -> Real:
    """Return matrices (3, 3, B) times vectors (3, B), as (3, B)."""
    product: Real = np.einsum("ijb,jb->ib", matrices, vectors)
    return product


def _cross(a: Real, b: Real) -> Real:
    """Return cross products along the first axis."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape), np.result_type(a, b))
    np.subtract(a[1] * b[2], a[2] * b[1], out=out[0])
    np.subtract(a[2] * b[0], a[0] * b[2], out=out[1])
    np.subtract(a[0] * b[1], a[1] * b[0], out=out[2])
    return out
