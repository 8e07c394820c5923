"""A spherical joint of a URDF, a type that only PyBullet defines.

PyBullet expresses its rotation, angular velocity and torque in the axes of the link's inertial
frame, not of the link; quaternions have their real part last. A position motor without force
disables its default motor, as `VELOCITY_CONTROL` does for other joints.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.harness.engines.pybullet.base import real_first
from physics_crosscheck.reference.mechanism.rotations import (
    angular_velocity,
    coordinate_rate,
    from_quaternion,
    minimal_coordinates,
    rotation_names,
    unit_quaternion,
)

COUNT = 3
"""Number of coordinates: the rotation of its link in the joint's frame."""


class Ball:
    """A spherical joint of a loaded body.

    Args:
        body: PyBullet's index of the body.
        joint: PyBullet's index of the joint.
        name: of the joint.
    """

    count = COUNT

    def __init__(self, body: int, joint: int, name: str) -> None:
        import pybullet as p

        self._body, self._joint = body, joint
        self.names = rotation_names(name)
        self._axes = from_quaternion(real_first(p.getDynamicsInfo(body, joint)[4]))
        self._near = np.array([1.0, 0.0, 0.0, 0.0])

    def disable_motor(self) -> None:
        """Disable its motor."""
        import pybullet as p

        none = [0.0, 0.0, 0.0]
        p.setJointMotorControlMultiDof(
            self._body, self._joint, p.POSITION_CONTROL, targetPosition=[0.0, 0.0, 0.0, 1.0],
            targetVelocity=none, positionGain=0.0, velocityGain=1.0, force=none,
        )  # fmt: skip

    def reset(self, z: Array, w: Array) -> None:
        """Set coordinates and their rates, (3,) each."""
        import pybullet as p

        self._near = unit_quaternion(z)
        turn = [*(self._near[1:] @ self._axes), self._near[0]]
        spin = angular_velocity(z, w) @ self._axes
        p.resetJointStateMultiDof(self._body, self._joint, turn, spin.tolist())

    def push(self, force: Sequence[float]) -> None:
        """Apply a moment about the link's axes over a step."""
        import pybullet as p

        torque = (np.array(force) @ self._axes).tolist()
        p.setJointMotorControlMultiDof(self._body, self._joint, p.TORQUE_CONTROL, force=torque)

    def position(self) -> Array:
        """Return its coordinates, (3,), near to the last ones."""
        import pybullet as p

        turn = real_first(p.getJointStateMultiDof(self._body, self._joint)[0])
        turned = minimal_coordinates(np.array([turn[0], *(self._axes @ turn[1:])]), self._near)
        self._near = unit_quaternion(turned)
        return turned

    def rates(self, z: Array) -> Array:
        """Return the rates of its current coordinates z, (3,)."""
        import pybullet as p

        spin = np.array(p.getJointStateMultiDof(self._body, self._joint)[1])
        return coordinate_rate(z, self._axes @ spin)
