"""The base of a URDF that floats: where its link is, of what PyBullet tells of its inertial frame.

PyBullet counts a floating base's position and velocity from the center of mass, turned by the
inertial frame, in the world's axes; quaternions have their real part last.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from physics_crosscheck.harness.engines.attitude import (
    angular_velocity,
    coordinates,
    matrix,
    place_names,
    product,
    quaternion,
    rate,
    rotation_names,
)
from physics_crosscheck.harness.engines.protocol import Array

COUNT = 6
"""Coordinates of a base: the place of its link's origin, in the world, and its rotation."""


class Base:
    """The floating base of a loaded body.

    Args:
        body: PyBullet's number of it.
        name: of its joint to the world.
    """

    count = COUNT

    def __init__(self, body: int, name: str) -> None:
        import pybullet as p

        self._body = body
        self.names = (*place_names(name), *rotation_names(name))
        info = p.getDynamicsInfo(body, -1)
        self._center, self._turned = np.array(info[3]), real_first(info[4])
        self._near = np.array([1.0, 0.0, 0.0, 0.0])

    def reset(self, z: Array, w: Array) -> None:
        """Put it there: coordinates and their rates, (6,) each."""
        import pybullet as p

        self._near = quaternion(z[3:])
        turn = matrix(self._near)
        center = turn @ self._center
        spin = turn @ angular_velocity(z[3:], w[3:])
        inertial = product(self._near, self._turned)
        p.resetBasePositionAndOrientation(self._body, z[:3] + center, [*inertial[1:], inertial[0]])
        p.resetBaseVelocity(self._body, w[:3] + np.cross(spin, center), spin)

    def push(self, force: Sequence[float]) -> None:
        """A force at its link's origin along the world's axes, a moment about its own, a step."""
        import pybullet as p

        at, own = self._placed()
        turn, world = matrix(own), p.WORLD_FRAME
        p.applyExternalForce(self._body, -1, list(force[:3]), at, world)
        p.applyExternalTorque(self._body, -1, turn @ np.array(force[3:]), world)

    def position(self) -> Array:
        """Its coordinates, (6,); of a rotation's two, those nearer to the last."""
        at, own = self._placed()
        turned = coordinates(own, self._near)
        self._near = quaternion(turned)
        return np.concatenate([at, turned])

    def rates(self, z: Array) -> Array:
        """Of its coordinates z, which are those of now, (6,)."""
        import pybullet as p

        linear, spin = map(np.array, p.getBaseVelocity(self._body))
        turn = matrix(quaternion(z[3:]))
        moved = linear - np.cross(spin, turn @ self._center)
        return np.concatenate([moved, rate(z[3:], turn.T @ spin)])

    def _placed(self) -> tuple[Array, Array]:
        """The link's origin and quaternion."""
        import pybullet as p

        center, inertial = p.getBasePositionAndOrientation(self._body)
        back = self._turned * [1, -1, -1, -1]
        own = product(real_first(inertial), back)
        return np.array(center) - matrix(own) @ self._center, own


def real_first(q: Sequence[float]) -> Array:
    """A quaternion (x, y, z, w) as (w, x, y, z)."""
    return np.array([q[3], *q[:3]])
