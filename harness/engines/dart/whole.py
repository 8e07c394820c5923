"""DART with dry friction of joints, for single steps from given states.

Measured with DART 6.20, and read in `JointCoulombFrictionConstraint.cpp`: friction is a row of a
linear complementarity problem with a softness of 1e-9, which acts on M without the dampers of the
step's end. DART solves the problem exactly. It enforces no limits of a URDF.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.protocol import (
    Array,
    EngineStep,
    LoadedModel,
    WholeModel,
    WholeState,
)
from physics_crosscheck.harness.engines.tree_model import FREE
from physics_crosscheck.reference.mechanism.laws import NearRigidRules
from physics_crosscheck.reference.mechanism.rotations import (
    coordinate_rate,
    from_quaternion,
    unit_quaternion,
)

WHOLE_SETTINGS = {"smooth": False, "couplings": False, "bare_links": False, "trimmed_numbers": True}
"""Settings of the adapter: with dry friction, and without DART's own assumptions."""


class DartWhole(WholeModel):
    """A URDF with the dry friction of its joints.

    Args:
        model: the loaded model, with `WHOLE_SETTINGS`.
        steps: its world.
        uncovered: parts of the file that have no law here.
    """

    controls = activations = 0
    edits = ("couplings released", "no shapes")
    speed = 0.4

    def __init__(self, model: LoadedModel, steps: Any, uncovered: tuple[str, ...]) -> None:
        self._model, self._steps, self.uncovered = model, steps, uncovered
        self.coordinates, self.step = model.coordinates, model.step
        self._free = FREE if steps.floats else 0
        self.rules = NearRigidRules(step=self.step, damped=False, stops=False, dry_share=1e-9)

    @property
    def starts(self) -> Iterator[WholeState]:
        """The drawn configuration."""
        home = self._model.home
        yield WholeState(home, np.zeros(len(home)), home[:0], home[:0])

    @property
    def ranges(self) -> tuple[Array, Array]:
        """No limits, and no controls."""
        return self._model.limits, np.zeros((0, 2))

    def moved(self, state: WholeState, steps: int) -> WholeState:
        """Return the state after some steps."""
        self._set(state)
        self._steps.coast(self.step, steps)
        return self._read(state)

    def evaluate(self, state: WholeState) -> EngineStep:
        """Return the mean acceleration of a step, and the next state."""
        turn = self._set(state)
        self._steps.coast(self.step, 1)
        velocities = self._steps.velocities(turn)
        return EngineStep(
            acceleration=(velocities - state.m) / self.step,
            unbalanced=np.zeros_like(state.m),
            contacts=(),
            after=self._read(state),
        )

    def _set(self, state: WholeState) -> Array:
        """Set a state; return the rotation of the root, (3, 3)."""
        rates = state.m.copy()
        if not self._free:
            self._steps.reset(state.z, rates)
            return np.eye(3)
        rates[3:FREE] = coordinate_rate(state.z[3:FREE], state.m[3:FREE])
        self._steps.reset(state.z, rates)
        return from_quaternion(unit_quaternion(state.z[3:FREE]))

    def _read(self, state: WholeState) -> WholeState:
        """Return the current state."""
        z = self._steps.position()
        turn = from_quaternion(unit_quaternion(z[3:FREE])) if self._free else np.eye(3)
        return state._replace(z=z, m=self._steps.velocities(turn))
