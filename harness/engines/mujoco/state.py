"""Coordinates of a compiled model, one per degree of freedom, and its own qpos and qvel."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from physics_crosscheck.harness.engines.mujoco.pulls import joint_name
from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.reference.mechanism.rotations import (
    angular_velocity,
    coordinate_rate,
    minimal_coordinates,
    place_names,
    rotation_names,
    unit_quaternion,
)


class _RotationSlices(NamedTuple):
    """The indices of a ball or free joint's rotation in qpos and qvel."""

    quaternion: slice
    angular: slice


class States:
    """Coordinates in the order of qvel; a free joint's position precedes its rotation.

    MuJoCo's velocity of a free joint is linear in the world's axes and angular in the body's axes.

    Attributes:
        names: of the coordinates.
        joints: index of the joint that each belongs to, (nv,).
        single: whether it is a slide's or a hinge's, (nv,).
    """

    def __init__(self, model: Any) -> None:
        self._nq, self._nv = int(model.nq), int(model.nv)
        self.names = tuple(name for j in range(model.njnt) for name in _names(model, j))
        self.joints = np.array(model.dof_jntid, dtype=int)
        self._turning = list(_turning(model))
        places = [
            (int(q), int(d))
            for q, d, kind in zip(model.jnt_qposadr, model.jnt_dofadr, model.jnt_type, strict=True)
            for q, d in _straight(int(q), int(d), int(kind))
        ]
        self._qpos = np.array([q for q, _ in places], dtype=int)
        self._dofs = np.array([d for _, d in places], dtype=int)
        kinds = np.array(model.jnt_type, dtype=int)[self.joints]
        self.single = np.isin(kinds, _SINGLE)

    def qpos(self, z: Array) -> Array:
        """Return qpos (..., nq) of coordinates (..., nv)."""
        if not self._turning:
            return z
        out = np.empty((*z.shape[:-1], self._nq))
        out[..., self._qpos] = z[..., self._dofs]
        for turning in self._turning:
            out[..., turning.quaternion] = unit_quaternion(z[..., turning.angular].T).T
        return out

    def qvel(self, z: Array, w: Array) -> Array:
        """Return qvel (..., nv) of coordinates and rates."""
        out = np.array(w, dtype=float)
        for turning in self._turning:
            angular = turning.angular
            out[..., angular] = angular_velocity(z[..., angular].T, w[..., angular].T).T
        return out

    def motion_of(self, qpos: Array, qvel: Array, start: Array) -> tuple[Array, Array]:
        """Return coordinates and rates along motions (B, samples, ...) that begin at qpos (B, nq).

        Each sample's quaternion has the sign that is nearer to the sample before.
        """
        if not self._turning:
            return qpos.copy(), qvel.copy()
        z, w = np.empty_like(qvel), np.array(qvel)
        z[..., self._dofs] = qpos[..., self._qpos]
        for turning in self._turning:
            near = start[:, turning.quaternion]
            for k in range(qpos.shape[1]):
                turn = qpos[:, k, turning.quaternion]
                z[:, k, turning.angular] = minimal_coordinates(turn.T, near.T).T
                near = unit_quaternion(z[:, k, turning.angular].T).T
            w[..., turning.angular] = coordinate_rate(
                z[..., turning.angular].T, qvel[..., turning.angular].T
            ).T
        return z, w

    def coordinates_of(self, qpos: Array, near: Array | None) -> list[float]:
        """Return the coordinates of one qpos as plain numbers, with rotations near to given
        ones.
        """
        if not self._turning:
            return list(qpos.tolist())
        start = (qpos if near is None else self.qpos(near))[None]
        return list(self.motion_of(qpos[None, None], np.zeros((1, 1, self._nv)), start)[0][0, 0])


FREE, BALL = 0, 1
_SINGLE = (2, 3)
"""Values of mjtJoint."""


def _names(model: Any, j: int) -> tuple[str, ...]:
    name, kind = joint_name(model, j), int(model.jnt_type[j])
    if kind == FREE:
        return (*place_names(name), *rotation_names(name))
    return rotation_names(name) if kind == BALL else (name,)


def _straight(q: int, d: int, kind: int) -> Iterator[tuple[int, int]]:
    """Yield the indices of plain coordinates in qpos and in qvel."""
    count = {FREE: 3, BALL: 0}.get(kind, 1)
    return ((q + i, d + i) for i in range(count))


def _turning(model: Any) -> Iterator[_RotationSlices]:
    for q, d, kind in zip(model.jnt_qposadr, model.jnt_dofadr, model.jnt_type, strict=True):
        q, d = int(q), int(d)
        if int(kind) == FREE:
            yield _RotationSlices(slice(q + 3, q + 7), slice(d + 3, d + 6))
        if int(kind) == BALL:
            yield _RotationSlices(slice(q, q + 4), slice(d, d + 3))
