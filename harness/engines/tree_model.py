"""A tree of slides and hinges in an engine with one state at a time, from any format."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from physics_crosscheck.harness.engines.one_by_one import Stepper, rollout
from physics_crosscheck.harness.engines.protocol import (
    Array,
    EngineError,
    Force,
    Model,
    ModelSpec,
    Spring,
)
from physics_crosscheck.harness.engines.runge_kutta import Accelerations, RungeKutta, to_state
from physics_crosscheck.harness.engines.source import engine_errors
from physics_crosscheck.harness.engines.springs import SpringForces
from physics_crosscheck.harness.engines.urdf import Mimic
from physics_crosscheck.reference.mechanism.rotations import place_names, rotation_names

FREE = 6
"""Number of coordinates of a floating root; they come first."""


@dataclass(frozen=True, kw_only=True)
class Weight:
    """A weight that gravity compensation cancels on an engine's body.

    Attributes:
        body: its name in the engine.
        centre: point of application, m in the body's frame.
        mass: kg; negative to add weight.
    """

    body: str
    centre: tuple[float, ...]
    mass: float


class TreeModel(Model):
    """A tree, fixed or floating; a subclass reads it and creates the `stepper`.

    Args:
        spec: the file, with step and gravity among its settings.
        title: of the engine.
        settings: all of them, including defaults.

    Attributes:
        floats: whether the first six coordinates are those of a free root.
        root: the name of its joint.
        springs: of the file and of its sidecar.
        mimics: joints that follow others.
        pushes: constant forces on joints, by name, N or N m.
        lifts: weights that gravity compensation cancels.
    """

    stepper: Stepper | RungeKutta
    forward: Accelerations | None = None
    """The engine's accelerations, if no soft constraint acts on joints."""
    floats: bool = False
    root: str = ""
    springs: tuple[Spring, ...] = ()
    mimics: tuple[Mimic, ...] = ()
    pushes: Mapping[str, float] = {}
    lifts: tuple[Weight, ...] = ()

    def __init__(self, spec: ModelSpec, title: str, settings: Mapping[str, object]) -> None:
        self.path, self.title, self.settings = spec.path, title, dict(settings)
        self.step = float(settings["step"])  # type: ignore[arg-type]  # checked
        self.gravity = tuple(map(float, settings["gravity"]))  # type: ignore[call-overload]

    def name(self, joints: Sequence[str], damping: Array | None = None) -> SpringForces:
        """Set the names of slides and hinges, in the engine's order.

        Args:
            joints: their names.
            damping: of each, if the spring forces include it.

        Returns:
            The forces of springs and constant inputs along them.
        """
        free = (*place_names(self.root), *rotation_names(self.root)) if self.floats else ()
        self.coordinates = (*free, *joints)
        if not self.coordinates:
            raise EngineError(f"{self.path}: it has no moving joint")
        pushed = np.array([self.pushes.get(joint, 0.0) for joint in joints])
        return SpringForces(self.springs, tuple(joints), self.path, damping, pushed)

    @property
    def stated_limits(self) -> Array:
        """Position limits of the file, (nz, 2); infinite for joints without one."""
        raise NotImplementedError

    def accelerations(self, z: Array, w: Array, force: Array) -> Array | None:
        """Return accelerations by the engine's forward dynamics."""
        if self.forward is None:
            return None
        with engine_errors(self.path, self.title), np.errstate(all="ignore"):
            return self.forward(*(to_state(z, w) if self.floats else (z, w)), force)

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """Step through a rollout: one state after the other, or all together with RK4."""
        with engine_errors(self.path, self.title):
            if isinstance(self.stepper, RungeKutta):
                return self.stepper.rollout(q, v, h, n, force, every)
            return rollout(self.stepper, q, v, h, n, force, every)
