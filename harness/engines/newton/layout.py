"""A model's coordinates, as the harness has them and as Newton has them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.engines.attitude import (
    angular_velocity,
    coordinates,
    place_names,
    quaternion,
    rate,
    rotation_names,
)
from physics_crosscheck.harness.engines.protocol import Array


class _Turning(NamedTuple):
    """A ball or free joint: where its place, its rotation and its quaternion stand."""

    place: slice
    angular: slice
    origin: slice
    turn: slice
    centre: Array


class Layout:
    """Of one world, in the order of Newton's velocities, nz of them.

    Newton's velocity of a free joint is that of the centre of mass, and angular, both along the
    world's axes; that of a ball joint is along its parent's. Quaternions have their real part last.

    Args:
        builder: Newton's `ModelBuilder` of one world.
        names: of the slides and hinges of each joint, and of each ball or free joint.
        refs: what Newton's positions lack, (nz,): a joint's value where the file draws it.

    Attributes:
        names: of the coordinates.
        of_joints: of each joint.
        refs: as given.
        scalars: names of those that are slides or hinges.
        home: where the file draws the mechanism.
    """

    def __init__(self, builder: Any, names: Sequence[Sequence[str]], refs: Array) -> None:
        import newton

        self._count, self.refs, self.of_joints = len(builder.joint_q), refs, names
        self._single: list[tuple[int, int]] = []
        self._turning: list[_Turning] = []
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
            self._turning.append(_Turning(place, slice(r, r + 3), slice(q, p), turn, centre))
            self.names += [*(place_names(name) if free else ()), *rotation_names(name)]
        self._q, self._v = np.array(self._single, dtype=int).reshape(-1, 2).T
        self.home = self.taken(np.array([builder.joint_q]), None)[0]

    @property
    def singles(self) -> NDArray[np.intp]:
        """Where the slides and hinges stand among the coordinates."""
        return self._v

    def given(self, z: Array, w: Array) -> tuple[Array, Array]:
        """Newton's positions and velocities of (B, nz) each."""
        q, v = np.empty((len(z), self._count)), np.array(w, dtype=float)
        q[:, self._q] = z[:, self._v] - self.refs[self._v]
        for one in self._turning:
            turn = quaternion(z[:, one.angular])
            spin = turned(turn, angular_velocity(z[:, one.angular], w[:, one.angular]))
            q[:, one.origin], q[:, one.turn] = z[:, one.place], np.roll(turn, -1, axis=1)
            v[:, one.angular] = spin
            v[:, one.place] += self._lever(one, turn, spin)
        return q, v

    def taken(self, q: Array, near: Array | None) -> Array:
        """Coordinates of Newton's positions (B, nq); of a rotation's two those that are nearer."""
        z = np.empty((len(q), len(self.refs)))
        z[:, self._v] = q[:, self._q] + self.refs[self._v]
        for one in self._turning:
            turn = np.roll(q[:, one.turn], 1, axis=1)
            before = turn if near is None else quaternion(near[:, one.angular])
            z[:, one.place], z[:, one.angular] = q[:, one.origin], coordinates(turn, before)
        return z

    def rates(self, z: Array, v: Array) -> Array:
        """Of coordinates, from Newton's velocities, (B, nz) each."""
        w = np.array(v, dtype=float)
        for one in self._turning:
            turn = quaternion(z[:, one.angular])
            w[:, one.place] -= self._lever(one, turn, v[:, one.angular])
            own = turned(turn * [1, -1, -1, -1], v[:, one.angular])
            w[:, one.angular] = rate(z[:, one.angular], own)
        return w

    def forces(self, z: Array, pull: Array) -> Array:
        """Newton's, of those at a body's origin, with moments along its own axes."""
        if not self._turning:
            return pull
        f = np.array(pull, dtype=float)
        for one in self._turning:
            turn = quaternion(z[:, one.angular])
            f[:, one.angular] = turned(turn, pull[:, one.angular])
            if one.place.start < one.place.stop:
                arm = turned(turn, one.centre[None])
                f[:, one.angular] -= np.cross(arm, pull[:, one.place])
        return f

    def _lever(self, one: _Turning, turn: Array, spin: Array) -> Array:
        """By how much a centre of mass is faster than its body's origin; of a ball nothing."""
        if one.place.start == one.place.stop:
            return np.empty((len(turn), 0))
        return np.cross(spin, turned(turn, one.centre[None]))


def turned(turn: Array, x: Array) -> Array:
    """x, (B, 3) or (1, 3), turned by quaternions (B, 4) of length one."""
    axis = turn[:, 1:]
    twice = 2 * np.cross(axis, np.broadcast_to(x, axis.shape))
    found: Array = x + turn[:, :1] * twice + np.cross(axis, twice)
    return found
