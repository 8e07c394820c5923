"""A Drake plant in one state, with the harness's coordinates.

Drake's coordinates of a free root are its quaternion, real part first, and its position. Velocities
are angular and linear, along the world's axes, and so are forces.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.harness.engines.runge_kutta import place, rates, to_state
from physics_crosscheck.harness.engines.tree_model import FREE, SpringForces, Stepper, Weight
from physics_crosscheck.reference.mechanism.rotations import from_quaternion

QUATERNION = 4


def moving_joints(plant: Any) -> list[Any]:
    """Return the moving joints of a finalized plant in the order of velocities, a floating root
    first.
    """
    joints = [plant.get_joint(i) for i in plant.GetJointIndices()]
    return sorted(
        (j for j in joints if j.num_velocities()),
        key=lambda j: (j.num_velocities() != FREE, int(j.velocity_start())),
    )


def weight_of(body: Any) -> Weight:
    """Return the weight of a body of a finalized plant."""
    centre = tuple(map(float, body.default_com()))
    return Weight(body=body.name(), centre=centre, mass=float(body.default_mass()))


class Plant:
    """A finalized plant with a context.

    Args:
        plant: of slides and hinges, after an optional floating root.
        floats: whether the root floats.
        springs: along slides and hinges.
        lifts: weights that gravity compensation cancels.
        context: of the plant in its diagram; None for a plant alone.
    """

    def __init__(
        self,
        plant: Any,
        floats: bool,
        springs: SpringForces,
        lifts: Sequence[Weight],
        context: Any = None,
    ) -> None:
        self._plant, self._floats, self._springs = plant, floats, springs
        gravity = np.array(plant.gravity_field().gravity_vector())
        self._lifts = [
            (plant.GetBodyByName(one.body), np.array(one.centre), -one.mass * gravity)
            for one in lifts
        ]
        self.context = plant.CreateDefaultContext() if context is None else context
        joints = moving_joints(plant)[1 if floats else 0 :]
        self._q = np.array([joint.position_start() for joint in joints], dtype=int)
        self._v = np.array([joint.velocity_start() for joint in joints], dtype=int)
        if floats:
            root = moving_joints(plant)[0]
            self._root_q, self._root_v = root.position_start(), root.velocity_start()
        self._own_q, self._own_v = np.zeros(plant.num_positions()), np.zeros(plant.num_velocities())
        self._port = plant.get_applied_generalized_force_input_port()

    def set_state(self, x: Array, m: Array) -> None:
        """Set positions and velocities in `RungeKutta`'s convention."""
        joints, speeds = (x[7:], m[FREE:]) if self._floats else (x, m)
        self._own_q[self._q], self._own_v[self._v] = joints, speeds
        if self._floats:
            turn = x[3:7] / np.linalg.norm(x[3:7])
            self._own_q[self._root_q :][:7] = np.concatenate([turn, x[:3]])
            spin = from_quaternion(turn) @ m[3:FREE]
            self._own_v[self._root_v :][:FREE] = np.concatenate([spin, m[:3]])
        self._plant.SetPositions(self.context, self._own_q)
        self._plant.SetVelocities(self.context, self._own_v)

    def state(self) -> tuple[Array, Array]:
        """Return the current positions and velocities."""
        q, v = self._plant.GetPositions(self.context), self._plant.GetVelocities(self.context)
        if not self._floats:
            return q[self._q], v[self._v]
        turn, place = np.split(q[self._root_q :][:7], [QUATERNION])
        x = np.concatenate([place, turn, q[self._q]])
        return x, self.stored(v, x)

    def stored(self, values: Array, x: Array) -> Array:
        """Return Drake's velocities, accelerations or forces in `RungeKutta`'s convention, at
        positions in it.
        """
        joints: Array = values[self._v]
        if not self._floats:
            return joints
        spin, linear = np.split(values[self._root_v :][:FREE], 2)
        return np.concatenate([linear, from_quaternion(x[3:7]).T @ spin, joints])

    def push(self, x: Array, m: Array, f: Array) -> None:
        """Apply forces, springs and gravity compensation in the state that was set."""
        forces = np.zeros_like(self._own_v)
        forces[self._v] = f[FREE:] if self._floats else f
        if not self._springs.empty:
            positions, rates = (x[7:], m[FREE:]) if self._floats else (x, m)
            forces[self._v] += self._springs.forces(positions, rates)
        if self._floats:
            moment = from_quaternion(x[3:7]) @ f[3:FREE]
            forces[self._root_v :][:FREE] = np.concatenate([moment, f[:3]])
        if self._lifts:
            forces += self._lifted()
        self._port.FixValue(self.context, forces)

    @property
    def pulled(self) -> bool:
        """True if forces act that depend on the state."""
        return not self._springs.empty or bool(self._lifts)

    def _lifted(self) -> Array:
        from pydrake.multibody.math import SpatialForce
        from pydrake.multibody.tree import MultibodyForces

        forces = MultibodyForces(self._plant)
        world = self._plant.world_frame()
        for body, centre, force in self._lifts:
            outward = body.EvalPoseInWorld(self.context).rotation().multiply(centre)
            lift = SpatialForce(np.zeros(3), force)
            body.AddInForce(self.context, outward, lift, world, forces)
        result: Array = self._plant.CalcGeneralizedForces(self.context, forces)
        return result

    def accelerations(self, x: Array, m: Array, f: Array) -> Array:
        """Return accelerations of a continuous plant, in `RungeKutta`'s convention."""
        self.set_state(x, m)
        self.push(x, m, f)
        rates = self._plant.EvalTimeDerivatives(self.context).CopyToVector()
        return self.stored(rates[self._plant.num_positions() :], x)

    def mass(self, x: Array) -> Array:
        """Return the mass matrix in the current state, for velocities in `RungeKutta`'s
        convention.
        """
        n = len(self._v) + (FREE if self._floats else 0)
        turned = np.zeros((len(self._own_v), n))
        turned[self._v, np.arange(n - len(self._v), n)] = 1.0
        if self._floats:
            root = turned[self._root_v :]
            root[:3, 3:FREE], root[3:FREE, :3] = from_quaternion(x[3:7]), np.eye(3)
        result: Array = turned.T @ self._plant.CalcMassMatrix(self.context) @ turned
        return result

    def update(self) -> None:
        """Step a discrete plant."""
        self.context.SetDiscreteState(self._plant.EvalUniquePeriodicDiscreteUpdate(self.context))


class DiscreteSteps(Stepper):
    """A discrete plant, which advances by its own step.

    Args:
        plant: in a context.
        floats: whether its first coordinates are those of a free root.
        pulled: whether springs act.
    """

    def __init__(self, plant: Plant, floats: bool, pulled: bool) -> None:
        self._plant, self._floats, self._pulled = plant, floats, pulled
        self._lost = self._pushed = False

    def reset(self, q: Array, v: Array) -> None:
        """Set a state, without forces."""
        x, m = to_state(q, v) if self._floats else (q, v)
        self._lost = False
        self._plant.set_state(x, m)
        self._plant.push(x, m, np.zeros_like(m))

    def position(self) -> Array:
        """Return the position."""
        return self.state()[0]

    def state(self) -> tuple[Array, Array]:
        """Return positions and velocities; NaN velocities after Drake has failed."""
        x, m = self._plant.state()
        if self._lost:
            m = np.full_like(m, np.nan)
        if not self._floats:
            return x, m
        z = place(x)
        return z, rates(z, m)

    def step(self, h: float, force: Array | None) -> None:
        """Step by an update of the plant."""
        if force is not None or self._pulled or self._pushed:
            x, m = self._plant.state()
            self._plant.push(x, m, np.zeros_like(m) if force is None else force)
            self._pushed = force is not None
        try:
            self._plant.update()
        except RuntimeError:  # a diverging motion
            self._lost = True
