"""Conversion between a model's coordinates in the harness and in Newton."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.reference.mechanism.rotations import (
    angular_velocity,
    coordinate_rate,
    cross,
    from_quaternion,
    minimal_coordinates,
    place_names,
    rotate,
    rotate_back,
    rotation_names,
    unit_quaternion,
)
from ..protocol import Array


class _JointSlices(NamedTuple):
    """A ball or free joint: the indices of its position, rotation and quaternion."""

    place: slice
    angular: slice
    origin: slice
    turn: slice
    centre: Array


class Layout:
    """The coordinates of one world, in the order of Newton's nz velocities.

    Newton's velocity of a free joint is that of the centre of mass, and angular, both along the
    world's axes; that of a ball joint is along its parent's. Quaternions have their real part last.

    Args:
        builder: Newton's `ModelBuilder` of one world.
        names: of the slides and hinges of each joint, and of each ball or free joint.
        refs: offsets that Newton's positions lack, (nz,): a joint's value in the drawn
            configuration.

    Attributes:
        names: of the coordinates.
        of_joints: names of each joint.
        refs: as given.
        scalars: names of slides and hinges.
        home: positions of the drawn configuration.
    """

    def __init__(self, builder: Any, names: Sequence[Sequence[str]], refs: Array) -> None:
        import newton

        self._count, self.refs, self.of_joints = len(builder.joint_q), refs, names
        self._single: list[tuple[int, int]] = []
        self._turning: list[_JointSlices] = []
        self.names: list[str] = []
        self.scalars: list[str] = []
        for j, kind in enumerate(builder.joint_type):
            q, v = builder.joint_q_start[j], builder.joint_qd_start[j]
            free = kind == newton.JointType.FREE
            if not free and kind != newton.JointType.BALL:
                self._single += [(q + i, v + i) for i in range(len(names[j]))]
                self.names += names[j]
                self.scalars += names[j]
                continue
            (name,), r, p = names[j], v + 3 * free, q + 3 * free
            centre = np.array(builder.body_com[builder.joint_child[j]], dtype=float)
            turn, place = slice(p, p + 4), slice(v, r)
            self._turning.append(_JointSlices(place, slice(r, r + 3), slice(q, p), turn, centre))
            self.names += [*(place_names(name) if free else ()), *rotation_names(name)]
        self._q, self._v = np.array(self._single, dtype=int).reshape(-1, 2).T
        self.home = self.coordinates_of(np.array([builder.joint_q]), None)[0]

    @property
    def singles(self) -> NDArray[np.intp]:
        """Indices of slides and hinges among the coordinates."""
        return self._v

    def given(self, z: Array, w: Array) -> tuple[Array, Array]:
        """Return Newton's positions and velocities of (B, nz) each."""
        q, v = np.empty((len(z), self._count)), np.array(w, dtype=float)
        q[:, self._q] = z[:, self._v] - self.refs[self._v]
        for slices in self._turning:
            p, rate = z[:, slices.angular].T, w[:, slices.angular].T
            turn = unit_quaternion(p)
            spin = rotate(from_quaternion(turn), angular_velocity(p, rate))
            q[:, slices.origin], q[:, slices.turn] = z[:, slices.place], np.roll(turn, -1, axis=0).T
            v[:, slices.angular] = spin.T
            v[:, slices.place] += self._lever(slices, from_quaternion(turn), spin)
        return q, v

    def coordinates_of(self, q: Array, near: Array | None) -> Array:
        """Return coordinates of Newton's positions (B, nq), with rotations near to given ones."""
        z = np.empty((len(q), len(self.refs)))
        z[:, self._v] = q[:, self._q] + self.refs[self._v]
        for slices in self._turning:
            turn = np.roll(q[:, slices.turn], 1, axis=1).T
            before = turn if near is None else unit_quaternion(near[:, slices.angular].T)
            z[:, slices.place] = q[:, slices.origin]
            z[:, slices.angular] = minimal_coordinates(turn, before).T
        return z

    def rates(self, z: Array, v: Array) -> Array:
        """Return the rates of coordinates from Newton's velocities, (B, nz) each."""
        w = np.array(v, dtype=float)
        for slices in self._turning:
            p, spin = z[:, slices.angular].T, v[:, slices.angular].T
            turn = from_quaternion(unit_quaternion(p))
            w[:, slices.place] -= self._lever(slices, turn, spin)
            w[:, slices.angular] = coordinate_rate(p, rotate_back(turn, spin)).T
        return w

    def forces(self, z: Array, applied: Array) -> Array:
        """Return Newton's forces for forces at a body's origin with moments along the body's
        axes.
        """
        if not self._turning:
            return applied
        f = np.array(applied, dtype=float)
        for slices in self._turning:
            turn = from_quaternion(unit_quaternion(z[:, slices.angular].T))
            moment = rotate(turn, applied[:, slices.angular].T)
            if slices.place.start < slices.place.stop:
                arm = rotate(turn, slices.centre[:, None])
                moment = moment - cross(arm, applied[:, slices.place].T)
            f[:, slices.angular] = moment.T
        return f

    def _lever(self, slices: _JointSlices, turn: Array, spin: Array) -> Array:
        """Return the velocity of the centre of mass relative to the body's origin; empty for a
        ball.
        """
        if slices.place.start == slices.place.stop:
            return np.empty((turn.shape[2], 0))
        return cross(spin, rotate(turn, slices.centre[:, None])).T
