"""Joints of several degrees of freedom: the floating base of a URDF, and spherical joints.

PyBullet counts a floating base's position and velocity from the center of mass, rotated by the
inertial frame, in the world's axes; quaternions have their real part last.

Only PyBullet defines spherical joints. It expresses their rotation, angular velocity and torque in
the axes of the link's inertial frame, not of the link. A position motor without force disables
their default motor, as `VELOCITY_CONTROL` does for other joints.
"""

from collections.abc import Sequence

import numpy as np

from physics_crosscheck.reference.mechanism.rotations import (
    angular_velocity,
    coordinate_rate,
    from_quaternion,
    minimal_coordinates,
    place_names,
    quaternion_product,
    rotation_names,
    unit_quaternion,
)
from ..protocol import Array

BALL_COUNT = 3
"""Number of coordinates: the rotation of its link in the joint's frame."""


class Ball:
    """A spherical joint of a loaded body.

    Args:
        body: PyBullet's index of the body.
        joint: PyBullet's index of the joint.
        name: of the joint.
    """

    count = BALL_COUNT

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


COUNT = 6
"""Number of coordinates of a base: the position of its link's origin, in the world, and its
rotation.
"""


class Base:
    """The floating base of a loaded body.

    Args:
        body: PyBullet's index of the body.
        name: of its joint to the world.

    Attributes:
        center: of mass, in the link's frame, m, (3,).
    """

    count = COUNT

    def __init__(self, body: int, name: str) -> None:
        import pybullet as p

        self._body = body
        self.names = (*place_names(name), *rotation_names(name))
        info = p.getDynamicsInfo(body, -1)
        self.center, self._turned = np.array(info[3]), real_first(info[4])
        self._inward = from_quaternion(self._turned).T
        self._near = np.array([1.0, 0.0, 0.0, 0.0])

    def reset(self, z: Array, w: Array) -> None:
        """Set coordinates and their rates, (6,) each."""
        import pybullet as p

        self._near = unit_quaternion(z[3:])
        turn = from_quaternion(self._near)
        center = turn @ self.center
        spin = turn @ angular_velocity(z[3:], w[3:])
        inertial = quaternion_product(self._near, self._turned)
        p.resetBasePositionAndOrientation(self._body, z[:3] + center, [*inertial[1:], inertial[0]])
        p.resetBaseVelocity(self._body, w[:3] + np.cross(spin, center), spin)

    def push(self, force: Sequence[float]) -> None:
        """Apply a force at the link's origin along world axes, and a moment about the link's axes,
        for a step.
        """
        import pybullet as p

        center, inertial = p.getBasePositionAndOrientation(self._body)
        turn, world = np.array(p.getMatrixFromQuaternion(inertial)).reshape(3, 3), p.WORLD_FRAME
        turn = turn @ self._inward
        p.applyExternalForce(self._body, -1, force[:3], center - turn @ self.center, world)
        p.applyExternalTorque(self._body, -1, turn @ force[3:], world)

    def position(self) -> Array:
        """Return its coordinates, (6,), with the rotation near to the last one."""
        origin, turn = self._placed()
        turned = minimal_coordinates(turn, self._near)
        self._near = unit_quaternion(turned)
        return np.concatenate([origin, turned])

    def rates(self, z: Array) -> Array:
        """Return the rates of its current coordinates z, (6,)."""
        import pybullet as p

        linear, spin = map(np.array, p.getBaseVelocity(self._body))
        turn = from_quaternion(unit_quaternion(z[3:]))
        moved = linear - np.cross(spin, turn @ self.center)
        return np.concatenate([moved, coordinate_rate(z[3:], turn.T @ spin)])

    def _placed(self) -> tuple[Array, Array]:
        import pybullet as p

        center, inertial = p.getBasePositionAndOrientation(self._body)
        back = self._turned * [1, -1, -1, -1]
        turn = quaternion_product(real_first(inertial), back)
        return np.array(center) - from_quaternion(turn) @ self.center, turn


def real_first(q: Sequence[float]) -> Array:
    """Return a quaternion (x, y, z, w) as (w, x, y, z)."""
    return np.array([q[3], *q[:3]])
