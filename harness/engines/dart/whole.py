"""DART with dry friction of joints, for single steps from given states.

Measured with DART 6.20, and read in `JointCoulombFrictionConstraint.cpp`: friction is a row of a
linear complementarity problem with a softness of 1e-9, which acts on M without the dampers of the
step's end. DART solves the problem exactly. It enforces no limits of a URDF.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from physics_crosscheck.harness.engines.protocol import Array, EngineStep, WholeState
from physics_crosscheck.harness.engines.runge_kutta import rates
from physics_crosscheck.harness.engines.tree_model import FREE, TreeModel, UndrivenWhole
from physics_crosscheck.reference.mechanism.laws import NearRigidRules
from physics_crosscheck.reference.mechanism.rotations import from_quaternion, unit_quaternion

WHOLE_SETTINGS = {"smooth": False, "couplings": False, "bare_links": False, "trimmed_numbers": True}
"""Settings of the adapter: with dry friction, and without DART's own assumptions."""


class DartWhole(UndrivenWhole):
    """A URDF with the dry friction of its joints.

    Args:
        model: the loaded model, with `WHOLE_SETTINGS`.
        steps: its world.
        uncovered: parts of the file that have no law here.
    """

    edits = ("couplings released", "no shapes")

    def __init__(self, model: TreeModel, steps: Any, uncovered: tuple[str, ...]) -> None:
        super().__init__(model, uncovered)
        self._steps, self._floats = steps, model.floats
        self.rules = NearRigidRules(
            step=self.step, damped_mass=False, has_limits=False, dry_friction_share=1e-9
        )

    def moved(self, state: WholeState, steps: int) -> WholeState:
        """Return the state after some steps."""
        self._set(state)
        self._steps.coast(self.step, steps)
        return self._read(state)

    def evaluate(self, state: WholeState) -> EngineStep:
        """Return the mean acceleration of a step, and the next state."""
        self._set(state)
        self._steps.coast(self.step, 1)
        velocities = self._steps.velocities(self._turn(state.z))
        return EngineStep(
            acceleration=(velocities - state.m) / self.step,
            unbalanced=np.zeros_like(state.m),
            contacts=(),
            after=self._read(state),
        )

    def _set(self, state: WholeState) -> None:
        z, m = state.z, state.m
        self._steps.reset(z, rates(z, m) if self._floats else m)

    def _read(self, state: WholeState) -> WholeState:
        z = self._steps.position()
        return state._replace(z=z, m=self._steps.velocities(self._turn(z)))

    def _turn(self, z: Array) -> Array:
        return from_quaternion(unit_quaternion(z[3:FREE])) if self._floats else np.eye(3)
