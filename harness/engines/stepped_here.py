"""Trees whose engine has no integrator: the adapter applies Runge-Kutta 4 to its accelerations."""

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from .protocol import Array, DefaultLeftOn, StepRule, UnsupportedError
from .remark import Remark
from .runge_kutta import Accelerations, RungeKutta, SingleAccelerations
from .tree_model import SpringForces, TreeModel
from .urdf_sidecar import ROBOTS

ADDED_HERE: Mapping[str, bool] = MappingProxyType({
    **ROBOTS,
    # Whether dampers are added as forces; the engine's dynamics ignore them.
    "damping": True,
    # Whether mimic joints of a URDF are constrained; the engine ignores them.
    "hold_mimics": True,
})  # fmt: skip
"""Settings of such an engine."""

CAPABILITIES = (
    "joints: slide, hinge, floating root",
    "springs: added by the adapter",
    "mimic: held by the adapter",
    "next state: yes",
    "accelerations: yes",
    "linearization: from steps",
    "steps: RK4 by the adapter, order 4",
    "whole step: not judged",
)
"""Features of such an engine."""


class SteppedHere(TreeModel):
    """Such a tree, with joint dampers that the engine reads but ignores, added by the adapter.

    The setting `damping` controls whether they are added.
    """

    integrator = "Runge-Kutta 4"
    steps_itself = False
    _undamped: bool = False

    def dampers(
        self, joints: Sequence[str], damping: Array, sizes: Sequence[int] = ()
    ) -> SpringForces:
        """Set the names as `name` does, and return forces that include joint dampers if they are
        added.
        """
        added = bool(self.settings["damping"])
        self._undamped = not added and bool(damping.any())
        return self.name(joints, damping if added else None, sizes)

    def step_by(self, forward: Accelerations, single: SingleAccelerations | None = None) -> None:
        """Step by accelerations of many states, and optionally a faster function for one.

        Raises:
            UnsupportedError: if accelerations are not finite.
        """
        self.forward, self.stepper = forward, RungeKutta(forward, self.layout, single)
        z = np.zeros((1, len(self.coordinates)))
        if not np.isfinite(forward(*self.layout.to_state(z, z), z)).all():
            raise UnsupportedError(f"{self.path}: a joint moves nothing with inertia")

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        """Return order 4, or 1 if a varying input is held over the step."""
        return (1 if varying_input else 4), 1

    @property
    def step_rule(self) -> StepRule:
        """The rule: all forces at each stage."""
        return StepRule(scheme="Runge-Kutta 4")

    @property
    def undamped(self) -> dict[str, Mapping[str, object]]:
        """The cause of omitted dampers, with the setting that adds them."""
        return {_dampers_of(self.title): {"damping": True}} if self._undamped else {}

    def damping_remarks(self) -> Iterator[Remark]:
        """Yield a remark about omitted dampers."""
        if self._undamped:
            cause = _dampers_of(self.title)
            yield Remark(
                kind="setting",
                message=f"{cause}, by the setting damping: nothing brakes a joint",
                address="sidecar:settings.damping",
                shows_in=("damping",),
            )


def dampers_not_added(title: str) -> DefaultLeftOn:
    """Return the mistake of a user who expects the engine to apply the file's dampers."""
    name = f"{title}'s dampers not added"
    return DefaultLeftOn(name=name, setting="damping", value=False, cause=_dampers_of(title))


def _dampers_of(title: str) -> str:
    return f"{title}'s leaving out of joints' dampers"
