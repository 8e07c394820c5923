"""A tree whose engine has no stepper: its accelerations, by the classical rule of order four."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from physics_crosscheck.harness.engines.mistake import DefaultLeftOn
from physics_crosscheck.harness.engines.protocol import Array, UnsupportedError
from physics_crosscheck.harness.engines.remark import Remark
from physics_crosscheck.harness.engines.runge_kutta import (
    Accelerations,
    Alone,
    RungeKutta,
    to_state,
)
from physics_crosscheck.harness.engines.springs import SpringForces
from physics_crosscheck.harness.engines.step_rule import StepRule
from physics_crosscheck.harness.engines.tree_model import TreeModel
from physics_crosscheck.harness.engines.urdf_sidecar import ROBOTS

ADDED_HERE: Mapping[str, bool] = MappingProxyType({
    **ROBOTS,
    # Whether dampers are added, as forces by velocity; the engine's dynamics leave them out.
    "damping": True,
    # Whether a URDF's joints are held to those that they follow; the engine lets them go.
    "hold_mimics": True,
})  # fmt: skip
"""Settings of such an engine."""


class SteppedHere(TreeModel):
    """Such a tree, of joints whose dampers the engine reads and leaves out; they are added here.

    Among its settings is damping, whether they are.
    """

    integrator = "Runge-Kutta 4"
    _undamped: bool = False

    def dampers(self, joints: Sequence[str], damping: Array) -> SpringForces:
        """As `name`: the forces take the dampers of joints along, where they are to."""
        added = bool(self.settings["damping"])
        self._undamped = not added and bool(damping.any())
        return self.name(joints, damping if added else None)

    def step_by(self, forward: Accelerations, alone: Alone | None = None) -> None:
        """Step by accelerations, of many states and where that is quicker of one.

        Raises:
            UnsupportedError: where they are none.
        """
        self.forward, self.stepper = forward, RungeKutta(forward, self.floats, alone)
        z = np.zeros((1, len(self.coordinates)))
        x, m = to_state(z, z) if self.floats else (z, z)
        if not np.isfinite(forward(x, m, z)).all():
            raise UnsupportedError(f"{self.path}: a joint moves nothing with inertia")

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        """Order 4, until an input is held over the step."""
        return (1 if varying_input else 4), 1

    @property
    def step_rule(self) -> StepRule:
        """All forces at each stage."""
        return StepRule(scheme="Runge-Kutta 4")

    @property
    def undamped(self) -> dict[str, Mapping[str, object]]:
        """That dampers are left out, where they are, with what undoes it."""
        return {_dampers_of(self.title): {"damping": True}} if self._undamped else {}

    def damping_remarks(self) -> Iterator[Remark]:
        """Dampers that are left out."""
        if self._undamped:
            left = _dampers_of(self.title)
            yield Remark(
                kind="setting",
                message=f"{left}, by the setting damping: nothing brakes a joint",
                address="sidecar:settings.damping",
                shows_in=("damping",),
            )


def dampers_not_added(title: str) -> DefaultLeftOn:
    """The mistake of an engine's user who relies on the dampers that the file has."""
    name = f"{title}'s dampers not added"
    return DefaultLeftOn(name=name, setting="damping", value=False, cause=_dampers_of(title))


def _dampers_of(title: str) -> str:
    return f"{title}'s leaving out of joints' dampers"
