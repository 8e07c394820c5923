"""Drake with joint limits, for single steps from given states of a discrete plant with SAP.

Read in Drake 1.51, `sap_driver.cc`: limits have a stiffness of 1e12, a dissipation time of one
step, beta = 0.1, and rows within twice the motion of a step; joint dampers act at the step's end.
Its numbers have no setting in a file. Dry friction of joints has no effect in Drake.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from physics_crosscheck.harness.engines.drake.model import DrakeModel
from physics_crosscheck.harness.engines.protocol import Array, EngineStep, WholeModel, WholeState
from physics_crosscheck.reference.mechanism.laws import NearRigidRules

WHOLE_SETTINGS = {"smooth": False, "couplings": False, "stepping": "sap"}
"""Settings of the adapter: with limits."""

BETA = 0.1
"""Ratio of a limit's shortest period to the step."""


class DrakeWhole(WholeModel):
    """A URDF with a fixed root and its limits.

    Args:
        model: the loaded model, with `WHOLE_SETTINGS`.
        uncovered: parts of the file that have no law here.
    """

    controls = activations = 0
    edits = ("couplings released",)
    speed = 0.4

    def __init__(self, model: DrakeModel, uncovered: tuple[str, ...]) -> None:
        self._model, self._steps = model, model.discrete_steps
        self.coordinates, self.step, self.uncovered = model.coordinates, model.step, uncovered
        self.rules = NearRigidRules(
            step=self.step, share=(BETA / (2 * np.pi)) ** 2, stiffness=1e12,
            dissipation=self.step, window=2.0,
        )  # fmt: skip

    @property
    def starts(self) -> Iterator[WholeState]:
        """The drawn configuration."""
        home = self._model.home
        yield WholeState(home, np.zeros(len(home)), home[:0], home[:0])

    @property
    def ranges(self) -> tuple[Array, Array]:
        """Joint limits, and no controls."""
        return self._model.limits, np.zeros((0, 2))

    def moved(self, state: WholeState, steps: int) -> WholeState:
        """Return the state after some steps."""
        self._steps.reset(state.z, state.m)
        for _ in range(steps):
            self._steps.step(self.step, None)
        z, m = self._steps.state()
        return state._replace(z=z, m=m)

    def evaluate(self, state: WholeState) -> EngineStep:
        """Return the mean acceleration of a step, and the next state."""
        after = self.moved(state, 1)
        return EngineStep(
            acceleration=(after.m - state.m) / self.step,
            # Newton's method on pieces of a parabola ends at the minimum.
            unbalanced=np.zeros_like(state.m),
            contacts=(),
            after=after,
        )
