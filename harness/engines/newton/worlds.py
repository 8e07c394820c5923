"""A batch of worlds of one model, one per state, stepped together."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.newton.layout import Layout
from physics_crosscheck.harness.engines.protocol import Array, Force, StateForce
from physics_crosscheck.harness.engines.tree_model import SpringForces

KEPT = 8
"""The most batch sizes whose worlds are kept, and step sizes whose launches are kept."""


class Worlds:
    """A model in B worlds.

    Args:
        builder: Newton's `ModelBuilder` of one world.
        layout: of its coordinates.
        springs: added along slides and hinges.
    """

    def __init__(self, builder: Any, layout: Layout, springs: SpringForces) -> None:
        self._builder, self._layout, self._springs = builder, layout, springs
        self._batch = lru_cache(maxsize=KEPT)(self._batch_of)

    def _batch_of(self, count: int) -> _Batch:
        import newton

        builder = newton.ModelBuilder(up_axis=newton.Axis.Z, gravity=self._builder.gravity)
        builder.replicate(self._builder, count)
        return _Batch(builder.finalize(device="cpu", skip_validation_inertia=True))

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """Step all worlds, as in `Model.rollout`."""
        layout, batch = self._layout, self._batch(len(q))
        launch, pushed = batch.step(h), force is not None or not self._springs.empty
        batch.set_state(
            *layout.given(q, v)
        )  # the recording also steps the state, so record before setting it
        out = np.empty((2, len(q), n // every, q.shape[1]))
        near = q
        for i in range(n):
            if pushed:
                near = layout.coordinates_of(batch.q, near)
                batch.push(layout.forces(near, self._forces(batch, near, force, i)))
            launch()
            if (i + 1) % every == 0:
                near = layout.coordinates_of(batch.q, near)
                out[0, :, i // every], out[1, :, i // every] = near, layout.rates(near, batch.v)
        return out[0], out[1]

    def _forces(self, batch: _Batch, z: Array, force: Force, i: int) -> Array:
        """Return the forces of springs and inputs, (B, nz)."""
        if isinstance(force, StateForce):
            rows = zip(z.tolist(), force.inputs[:, i].tolist(), strict=True)
            forces = np.array([force.evaluate(at, u) for at, u in rows], dtype=float)
        else:
            forces = np.zeros_like(z) if force is None else np.array(force[:, i])
        if not self._springs.empty:
            indices = self._layout.singles
            forces[:, indices] += self._springs.forces(z[:, indices], batch.v[:, indices])
        return forces


class _Batch:
    """A finalized model with its solver, state and forces; arrays share their memory."""

    def __init__(self, model: Any) -> None:
        import newton

        self._model = model
        self._solver = newton.solvers.SolverFeatherstone(model)
        self._state, self._control = model.state(), model.control()
        shape = model.world_count, -1
        self.q = self._state.joint_q.numpy().reshape(shape)
        self.v = self._state.joint_qd.numpy().reshape(shape)
        self._force = self._control.joint_f.numpy().reshape(shape)
        self.step = lru_cache(maxsize=KEPT)(self._recorded)

    def set_state(self, q: Array, v: Array) -> None:
        """Set a state, without forces."""
        self.q[:], self.v[:], self._force[:] = q, v, 0.0

    def push(self, force: Array) -> None:
        """Set the forces of the next step."""
        self._force[:] = force

    def _recorded(self, h: float) -> Any:
        """Record the launches of a step of h once, since calls from Python take most of its
        time.
        """
        import warp as wp

        self._once(h)  # allocate memory before the capture
        with wp.ScopedCapture(device="cpu") as capture:
            self._once(h)
        return lambda: wp.capture_launch(capture.graph)

    def _once(self, h: float) -> None:
        self._solver.step(self._state, self._state, self._control, None, h)
