"""A DART skeleton in a world, with the harness's coordinates."""

from __future__ import annotations

from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.harness.engines.tree_model import FREE, SpringForces, Stepper
from physics_crosscheck.reference.mechanism.rotations import (
    angular_velocity,
    coordinate_rate,
    exponential,
    from_quaternion,
    minimal_coordinates,
    quaternion_product,
    unit_quaternion,
)

INSTANT = 1e-200
"""Seconds."""


class WorldSteps(Stepper):
    """A skeleton in a world.

    DART's coordinates of a free root are its rotation vector and its position. Velocities are
    angular and linear, along the world's axes, and so are forces.

    Args:
        world, body: DART's own objects.
        floats: whether the root floats.
        springs: along slides and hinges.
        exact: whether the adapter rotates a floating root to full precision; DART drops the cubic
            term of rotations below 1e-3 rad per step.
    """

    def __init__(
        self, world: Any, body: Any, floats: bool, springs: SpringForces, exact: bool = False
    ) -> None:
        self._world, self._body, self._floats, self._springs = world, body, floats, springs
        self._turned = exact and floats
        self._near = np.array([1.0, 0.0, 0.0, 0.0])

    def reset(self, q: Array, v: Array) -> None:
        """Set a state, and discard constraint impulses of earlier motions."""
        if self._floats:
            self._near = unit_quaternion(q[3:FREE])
            spin = from_quaternion(self._near) @ angular_velocity(q[3:FREE], v[3:FREE])
            q = np.concatenate([_rotation_vector(self._near), q[:3], q[FREE:]])
            v = np.concatenate([spin, v[:3], v[FREE:]])
        self._set_dart_state(q, v)

    def _set_dart_state(self, q: Array, v: Array) -> None:
        """Set DART's coordinates and velocities."""
        self._body.resetCommands()
        self._body.clearConstraintImpulses()
        self._body.resetAccelerations()
        self._body.setPositions(q)
        self._body.setVelocities(v)

    def position(self) -> Array:
        """Return the position, with rotation coordinates nearer to the last ones."""
        q: Array = self._body.getPositions()
        if not self._floats:
            return q
        turn = exponential(q[:3])
        turned = minimal_coordinates(turn, self._near)
        self._near = unit_quaternion(turned)
        return np.concatenate([q[3:FREE], turned, q[FREE:]])

    def state(self) -> tuple[Array, Array]:
        """Return positions and velocities."""
        z, v = self.position(), self._body.getVelocities()
        if not self._floats:
            return z, v
        spin = from_quaternion(self._near).T @ v[:3]
        return z, np.concatenate([v[3:FREE], coordinate_rate(z[3:FREE], spin), v[FREE:]])

    def step(self, h: float, force: Array | None) -> None:
        """Step the world, whose step is h."""
        if force is not None or not self._springs.empty:
            self._body.setForces(self._pushes(force))
        before = self._body.getPositions()[:3] if self._turned else np.zeros(3)
        self._world.step()
        if self._turned:
            q, spin = self._body.getPositions(), self._body.getVelocities()[:3]
            after = quaternion_product(exponential(h * spin), exponential(before))
            q[:3] = _rotation_vector(after if after[0] >= 0 else -after)
            self._body.setPositions(q)

    def coast(self, h: float, n: int) -> None:
        """Step the world alone if no spring acts."""
        if self._turned or not self._springs.empty:
            super().coast(h, n)
            return
        step = self._world.step
        for _ in range(n):
            step()

    def accelerations(self, x: Array, m: Array, f: Array) -> Array:
        """Return accelerations of positions, velocities and forces in `RungeKutta`'s convention."""
        q, v = x, m
        if self._floats:
            turn = from_quaternion(x[3:7])
            q = np.concatenate([_rotation_vector(x[3:7]), x[:3], x[7:]])
            v = np.concatenate([turn @ m[3:FREE], m[:3], m[FREE:]])
        self._set_dart_state(q, v)
        self._body.setForces(self._pushes(f))
        # DART evaluates dampers at the end of a step, so the step is made negligibly short.
        step = self._body.getTimeStep()
        self._body.setTimeStep(INSTANT)
        self._body.computeForwardDynamics()
        self._body.setTimeStep(step)
        a: Array = self._body.getAccelerations()
        if not self._floats:
            return a
        return np.concatenate([a[3:FREE], turn.T @ a[:3], a[FREE:]])

    def _pushes(self, force: Array | None) -> Array:
        free = FREE if self._floats else 0
        q, v = self._body.getPositions(), self._body.getVelocities()
        pushes = np.zeros(len(v)) if force is None else force.copy()
        if self._floats and force is not None:
            turn = from_quaternion(exponential(q[:3]))
            pushes[:FREE] = np.concatenate([turn @ force[3:FREE], force[:3]])
        if not self._springs.empty:
            pushes[free:] += self._springs.forces(q[free:], v[free:])
        return pushes


def _rotation_vector(turn: Array) -> Array:
    size = np.linalg.norm(turn[1:])
    angle = 2 * np.arctan2(size, turn[0])
    return turn[1:] * (angle / size if size else 2.0)
