"""The base of a floating URDF: its link's pose, from PyBullet's pose of its inertial frame.

PyBullet counts a floating base's position and velocity from the center of mass, rotated by the
inertial frame, in the world's axes; quaternions have their real part last.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from physics_crosscheck.harness.engines.protocol import Array
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

COUNT = 6
"""Number of coordinates of a base: the position of its link's origin, in the world, and its
rotation.
"""


class Base:
    """The floating base of a loaded body.

    Args:
        body: PyBullet's index of the body.
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
        """Set coordinates and their rates, (6,) each."""
        import pybullet as p

        self._near = unit_quaternion(z[3:])
        turn = from_quaternion(self._near)
        center = turn @ self._center
        spin = turn @ angular_velocity(z[3:], w[3:])
        inertial = quaternion_product(self._near, self._turned)
        p.resetBasePositionAndOrientation(self._body, z[:3] + center, [*inertial[1:], inertial[0]])
        p.resetBaseVelocity(self._body, w[:3] + np.cross(spin, center), spin)

    def push(self, force: Sequence[float]) -> None:
        """Apply a force at the link's origin along world axes, and a moment about the link's axes,
        for a step.
        """
        import pybullet as p

        origin, turn_quaternion = self._placed()
        turn, world = from_quaternion(turn_quaternion), p.WORLD_FRAME
        p.applyExternalForce(self._body, -1, list(force[:3]), origin, world)
        p.applyExternalTorque(self._body, -1, turn @ np.array(force[3:]), world)

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
        moved = linear - np.cross(spin, turn @ self._center)
        return np.concatenate([moved, coordinate_rate(z[3:], turn.T @ spin)])

    def _placed(self) -> tuple[Array, Array]:
        """Return the link's origin and quaternion."""
        import pybullet as p

        center, inertial = p.getBasePositionAndOrientation(self._body)
        back = self._turned * [1, -1, -1, -1]
        turn = quaternion_product(real_first(inertial), back)
        return np.array(center) - from_quaternion(turn) @ self._center, turn


def real_first(q: Sequence[float]) -> Array:
    """Return a quaternion (x, y, z, w) as (w, x, y, z)."""
    return np.array([q[3], *q[:3]])
