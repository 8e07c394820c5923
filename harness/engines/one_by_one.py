"""Rollouts of engines that have one state at a time."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from physics_crosscheck.harness.engines.protocol import Array, Force, StateForce


class Stepper(ABC):
    """A model in one state, advanced by steps; positions and velocities are (nz,) each."""

    @abstractmethod
    def reset(self, q: Array, v: Array) -> None:
        """Set a state."""

    @abstractmethod
    def position(self) -> Array:
        """Return the position."""

    @abstractmethod
    def state(self) -> tuple[Array, Array]:
        """Return positions and velocities."""

    @abstractmethod
    def step(self, h: float, force: Array | None) -> None:
        """Advance by h seconds, under constant forces on its coordinates."""

    def coast(self, h: float, n: int) -> None:
        """Advance by n steps without such forces."""
        for _ in range(n):
            self.step(h, None)


@np.errstate(all="ignore")  # a diverging motion is returned as it is
def rollout(
    stepper: Stepper, q: Array, v: Array, h: float, n: int, force: Force, every: int
) -> tuple[Array, Array]:
    """Return a rollout as in `Model.rollout`; after a non-finite state the rest is NaN."""
    out_q = np.full((len(q), n // every, q.shape[1]), np.nan)
    out_v = np.full_like(out_q, np.nan)
    for b in range(len(q)):
        if not (np.isfinite(q[b]).all() and np.isfinite(v[b]).all()):
            continue
        stepper.reset(q[b], v[b])
        for row in range(n // every):
            if force is None:
                stepper.coast(h, every)
            else:
                for i in range(row * every, (row + 1) * every):
                    stepper.step(h, held(stepper, force, b, i))
            out_q[b, row], out_v[b, row] = stepper.state()
            if not (np.isfinite(out_q[b, row]).all() and np.isfinite(out_v[b, row]).all()):
                break
    return out_q, out_v


def held(stepper: Stepper, force: Array | StateForce, b: int, i: int) -> Array:
    """Return the forces on state b over step i, (nz,)."""
    if isinstance(force, StateForce):
        position, u = stepper.position().tolist(), force.inputs[b, i].tolist()
        return np.array(force.evaluate(position, u), dtype=float)
    row: Array = force[b, i]
    return row
