"""MJX with all its forces, for single steps from given states.

MJX documents MuJoCo's law (MuJoCo's documentation, MJX, Feature parity). It chooses otherwise:

- `implicitfast` has the dampers of all joints, tendons and drives, also across branches and at
  limits, and no derivative of inertial forces (`derivative.py`);
- `connect` and `weld` lack the term J-dot v (`constraint.py`);
- friction coefficients of geoms have no lower bound (`collision_driver.py`);
- it detects contacts by functions of its own, and holds a slot for each that may occur.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from types import MappingProxyType
from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.mujoco.whole import MujocoWhole
from physics_crosscheck.harness.engines.protocol import EngineStep, WholeState
from physics_crosscheck.reference.mechanism.laws import ContactPoint, Laws

_EXACT: Mapping[str, float] = MappingProxyType({
    "solver": 2, "tolerance": 0.0, "iterations": 100, "ls_iterations": 50, "jacobian": 0,
})  # fmt: skip
"""Options of an exact solver: Newton's, with dense matrices."""

_EDITS = (
    "solver=Newton", "tolerance=0", "iterations=100", "ls_iterations=50", "jacobian=dense",
    "warmstart=disable",
)  # fmt: skip


class MjxWhole(MujocoWhole):
    """A compiled model that JAX steps in 64 bits; MuJoCo draws its states."""

    peer = "MuJoCo"

    def __init__(self, model: Any) -> None:
        import jax
        from mujoco import mjx

        super().__init__(model)
        self.edits = _EDITS
        for name, value in _EXACT.items():
            setattr(model.opt, name, value)
        with jax.enable_x64(True):
            device = mjx.put_model(model)
            parts, make = jax.tree_util.tree_flatten((device, mjx.make_data(device)))
            self._parts, self._step = tuple(parts), _stepper(make)

    def finds_exactly(self, first: str, other: str) -> bool:
        """Return False for axes of capsules, which are longer, and boxes, which keep four corners.

        Source: `closest_segment_point` in `math.py`, `plane_convex` in `collision_convex.py`.
        """
        kinds = {first, other}
        return kinds <= {"plane", "sphere"} or kinds == {"plane", "capsule"}

    def peer_contacts(self, state: WholeState) -> tuple[ContactPoint, ...]:
        """Return the contacts by MuJoCo's own functions."""
        return super().contacts(state)

    def contacts(self, state: WholeState) -> tuple[ContactPoint, ...]:
        """Return the contacts by MJX."""
        return self.evaluate(state).contacts

    def applied(self, laws: Laws) -> Laws:
        """Return the laws with the choices of MJX."""
        fast = laws.integrator == "implicitfast"
        integrator = "implicit dampers" if fast else laws.integrator
        return replace(laws, integrator=integrator, least_friction=0.0, drift=False)

    def evaluate(self, state: WholeState) -> EngineStep:
        """Return the accelerations, contacts and the next state by MJX."""
        import jax

        start = self._states.qpos(state.z), state.m, state.controls, state.activations
        with jax.enable_x64(True):
            values, touches = jax.device_get(self._step(self._parts, start))
        qpos, velocity, activations, acceleration, unbalanced = map(np.array, values)
        z = np.array(self._states.coordinates_of(qpos, state.z))
        return EngineStep(
            acceleration=acceleration,
            unbalanced=unbalanced,
            contacts=tuple(_contacts(touches)),
            after=WholeState(z, velocity, state.controls, activations),
        )


@cache
def _stepper(make: Any) -> Any:
    """Compile a function that takes a step: the state, accelerations, unbalanced force, contacts.

    Models of the same structure share it. A step keeps the forces of its start, except for RK4,
    whose next state has no rule.
    """
    import jax
    from mujoco import mjx

    def step(parts: Any, start: Any) -> tuple[Any, Any]:
        model, empty = jax.tree_util.tree_unflatten(make, parts)
        qpos, qvel, controls, activations = start
        data = empty.replace(qpos=qpos, qvel=qvel, ctrl=controls, act=activations)
        once = mjx.forward if model.opt.integrator == mjx.IntegratorType.RK4 else mjx.step
        after = once(model, data)
        balance = after.qfrc_smooth + after.qfrc_constraint
        unbalanced = balance - mjx.mul_m(model, after, after.qacc)
        contact = after._impl.contact  # of its own backend, as its tests read it
        touches = contact.geom, contact.dist, contact.includemargin, contact.pos, contact.frame
        return (after.qpos, after.qvel, after.act, after.qacc, unbalanced), touches

    return jax.jit(step)


def _contacts(touches: Any) -> Iterator[ContactPoint]:
    """Yield the contacts within their margins."""
    for geoms, distance, margin, position, frame in zip(*touches, strict=True):
        if distance < margin:
            first, other = map(int, geoms)
            yield ContactPoint(
                surfaces=(first, other),
                distance=float(distance),
                position=np.array(position),
                frame=np.array(frame).reshape(3, 3),
            )
