"""A URDF's spherical joint, a type of PyBullet's own.

PyBullet tells its rotation, its angular velocity and its torque in the axes of the link's inertial
frame, and not of the link; quaternions have their real part last. Its default motor is switched off
by a position motor without force, as `VELOCITY_CONTROL` does it for other joints.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from physics_crosscheck.harness.engines.attitude import (
    angular_velocity,
    coordinates,
    matrix,
    quaternion,
    rate,
    rotation_names,
)
from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.harness.engines.pybullet.base import real_first

COUNT = 3
"""Coordinates: of the rotation of its link in the joint's frame."""


class Ball:
    """A spherical joint of a loaded body.

    Args:
        body: PyBullet's number of it.
        joint: PyBullet's number of the joint.
        name: of the joint.
    """

    count = COUNT

    def __init__(self, body: int, joint: int, name: str) -> None:
        import pybullet as p

        self._body, self._joint = body, joint
        self.names = rotation_names(name)
        self._axes = matrix(real_first(p.getDynamicsInfo(body, joint)[4]))
        self._near = np.array([1.0, 0.0, 0.0, 0.0])

    def let_go(self) -> None:
        """Switch its motor off."""
        import pybullet as p

        none = [0.0, 0.0, 0.0]
        p.setJointMotorControlMultiDof(
            self._body, self._joint, p.POSITION_CONTROL, targetPosition=[0.0, 0.0, 0.0, 1.0],
            targetVelocity=none, positionGain=0.0, velocityGain=1.0, force=none,
        )  # fmt: skip

    def reset(self, z: Array, w: Array) -> None:
        """Put it there: coordinates and their rates, (3,) each."""
        import pybullet as p

        self._near = quaternion(z)
        turn = [*(self._near[1:] @ self._axes), self._near[0]]
        spin = angular_velocity(z, w) @ self._axes
        p.resetJointStateMultiDof(self._body, self._joint, turn, spin.tolist())

    def push(self, force: Sequence[float]) -> None:
        """A moment about the link's own axes, over a step."""
        import pybullet as p

        own = (np.array(force) @ self._axes).tolist()
        p.setJointMotorControlMultiDof(self._body, self._joint, p.TORQUE_CONTROL, force=own)

    def position(self) -> Array:
        """Its coordinates, (3,); of a rotation's two, those nearer to the last."""
        import pybullet as p

        turn = real_first(p.getJointStateMultiDof(self._body, self._joint)[0])
        turned = coordinates(np.array([turn[0], *(self._axes @ turn[1:])]), self._near)
        self._near = quaternion(turned)
        return turned

    def rates(self, z: Array) -> Array:
        """Of its coordinates z, which are those of now, (3,)."""
        import pybullet as p

        spin = np.array(p.getJointStateMultiDof(self._body, self._joint)[1])
        return rate(z, self._axes @ spin)
