"""A Drake plant in one state, with the harness's coordinates.

Drake's coordinates of a free joint are its quaternion, real part first, and its position.
Velocities are angular and linear, along the world's axes, and so are forces. A ball joint of
SDFormat has roll, pitch and yaw of its frame on the child in that on the parent, and angular
velocities along the axes of the latter.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from physics_crosscheck.reference.mechanism.rotations import (
    from_quaternion,
    from_rpy,
    to_quaternion,
    to_rpy,
)
from ..protocol import Array
from ..runge_kutta import BALL, FREE, JointLayout
from ..tree_model import SpringForces, Stepper, Weight

SIZES = {"quaternion_floating": FREE, "ball_rpy": BALL, "universal": 2}
"""Numbers of coordinates of Drake's types of joints with several."""


def moving_joints(plant: Any) -> list[Any]:
    """Return the moving joints of a finalized plant in the order of velocities."""
    joints = [plant.get_joint(i) for i in plant.GetJointIndices()]
    return sorted((j for j in joints if j.num_velocities()), key=lambda j: int(j.velocity_start()))


class _Turning(NamedTuple):
    """A joint that rotates freely."""

    here: slice
    there: slice
    origin: slice
    origin_x: slice
    q: int
    v: int
    inward: Array

    def axes(self, x: Array) -> Array:
        """Return the child's axes in those of Drake's angular velocity, (3, 3)."""
        axes: Array = self.inward.T @ from_quaternion(x[self.there])
        return axes


def weight_of(body: Any) -> Weight:
    """Return the weight of a body of a finalized plant."""
    centre = tuple(map(float, body.default_com()))
    return Weight(body=body.name(), centre=centre, mass=float(body.default_mass()))


class Plant:
    """A finalized plant with a context.

    Args:
        plant: of slides, hinges, balls and free joints.
        layout: of them.
        springs: along slides and hinges.
        lifts: weights that gravity compensation cancels.
        context: of the plant in its diagram; None for a plant alone.
    """

    def __init__(
        self,
        plant: Any,
        layout: JointLayout,
        springs: SpringForces,
        lifts: Sequence[Weight],
        context: Any = None,
    ) -> None:
        self._plant, self.layout, self._springs = plant, layout, springs
        gravity = np.array(plant.gravity_field().gravity_vector())
        self._lifts = [
            (plant.GetBodyByName(one.body), np.array(one.centre), -one.mass * gravity)
            for one in lifts
        ]
        self.context = plant.CreateDefaultContext() if context is None else context
        joints = moving_joints(plant)
        turning = [one for one in joints if SIZES.get(one.type_name(), 1) >= BALL]
        singles = [one for one in joints if SIZES.get(one.type_name(), 1) < BALL]
        each = [(joint, i) for joint in singles for i in range(joint.num_velocities())]
        self._q = np.array([joint.position_start() + i for joint, i in each], dtype=int)
        self._v = np.array([joint.velocity_start() + i for joint, i in each], dtype=int)
        self._turning = [
            _Turning(
                *turn, *place, joint.position_start(), joint.velocity_start(),
                joint.frame_on_child().GetFixedPoseInBodyFrame().rotation().matrix(),
            )
            for joint, turn, place in zip(turning, layout.turns, layout.origins, strict=True)
        ]  # fmt: skip
        self._own_q, self._own_v = np.zeros(plant.num_positions()), np.zeros(plant.num_velocities())
        self._port = plant.get_applied_generalized_force_input_port()

    def set_state(self, x: Array, m: Array) -> None:
        """Set positions and velocities in `RungeKutta`'s convention."""
        self._own_q[self._q] = x[self.layout.singles_x]
        for joint in self._turning:
            if joint.origin.start < joint.origin.stop:
                self._own_q[joint.q : joint.q + 4] = x[joint.there] / np.linalg.norm(x[joint.there])
                self._own_q[joint.q + 4 : joint.q + 7] = x[joint.origin_x]
            else:
                self._own_q[joint.q : joint.q + 3] = to_rpy(joint.axes(x) @ joint.inward)
        self._plant.SetPositions(self.context, self._own_q)
        self._plant.SetVelocities(self.context, self._given(m, x))

    def state(self) -> tuple[Array, Array]:
        """Return the current positions and velocities."""
        q, v = self._plant.GetPositions(self.context), self._plant.GetVelocities(self.context)
        if not self._turning:
            return q[self._q], v[self._v]
        x = np.empty(len(self._own_v) + len(self._turning))
        x[self.layout.singles_x] = q[self._q]
        for joint in self._turning:
            if joint.origin.start < joint.origin.stop:
                x[joint.there], x[joint.origin_x] = np.split(q[joint.q : joint.q + 7], [4])
            else:
                turn = joint.inward @ from_rpy(*q[joint.q : joint.q + 3]) @ joint.inward.T
                x[joint.there] = to_quaternion(turn)
        return x, self.stored(v, x)

    def stored(self, values: Array, x: Array) -> Array:
        """Return Drake's velocities, accelerations or forces in `RungeKutta`'s convention, at
        positions in it.
        """
        if not self._turning:
            joints: Array = values[self._v]
            return joints
        out = np.empty_like(values)
        out[self.layout.singles] = values[self._v]
        for joint in self._turning:
            out[joint.here] = joint.axes(x).T @ values[joint.v : joint.v + 3]
            out[joint.origin] = values[joint.v + 3 :][: joint.origin.stop - joint.origin.start]
        return out

    def _given(self, values: Array, x: Array) -> Array:
        """Return velocities or forces in `RungeKutta`'s convention in Drake's, at positions x."""
        out = np.empty_like(self._own_v)
        out[self._v] = values[self.layout.singles]
        for joint in self._turning:
            out[joint.v : joint.v + 3] = joint.axes(x) @ values[joint.here]
            out[joint.v + 3 :][: joint.origin.stop - joint.origin.start] = values[joint.origin]
        return out

    def push(self, x: Array, m: Array, f: Array) -> None:
        """Apply forces, springs and gravity compensation in the state that was set."""
        forces, layout = self._given(f, x), self.layout
        if not self._springs.empty:
            forces[self._v] += self._springs.forces(x[layout.singles_x], m[layout.singles])
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
        turned = np.array([self._given(row, x) for row in np.eye(len(self._own_v))])
        result: Array = turned @ self._plant.CalcMassMatrix(self.context) @ turned.T
        return result

    def update(self) -> None:
        """Step a discrete plant."""
        self.context.SetDiscreteState(self._plant.EvalUniquePeriodicDiscreteUpdate(self.context))


class DiscreteSteps(Stepper):
    """A discrete plant, which advances by its own step.

    Args:
        plant: in a context.
        pulled: whether springs act.
    """

    def __init__(self, plant: Plant, pulled: bool) -> None:
        self._plant, self._pulled = plant, pulled
        self._lost = self._pushed = False

    def reset(self, q: Array, v: Array) -> None:
        """Set a state, without forces."""
        x, m = self._plant.layout.to_state(q, v)
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
        z = self._plant.layout.place(x)
        return z, self._plant.layout.rates(z, m)

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
