"""DART with dry friction of joints, for single steps from given states.

Measured with DART 6.20, and read in `JointCoulombFrictionConstraint.cpp`: friction is a row of a
linear complementarity problem with a softness of 1e-9, which acts on M without the dampers of the
step's end. DART solves the problem exactly. It enforces no limits of a URDF.
"""

from typing import Any

import numpy as np

from physics_crosscheck.reference.mechanism.laws import NearRigidRules
from ..protocol import EngineStep, WholeState
from ..tree_model import TreeModel, UndrivenWhole

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
        self._steps = steps
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
        velocities = self._steps.velocities(state.z)
        return EngineStep(
            acceleration=(velocities - state.m) / self.step,
            unbalanced=np.zeros_like(state.m),
            contacts=(),
            after=self._read(state),
        )

    def _set(self, state: WholeState) -> None:
        self._steps.reset(state.z, self._steps.layout.rates(state.z, state.m))

    def _read(self, state: WholeState) -> WholeState:
        z = self._steps.position()
        return state._replace(z=z, m=self._steps.velocities(z))
