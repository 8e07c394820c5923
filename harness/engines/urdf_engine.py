"""What adapters of engines that take a URDF, and have one state at a time, have in common."""

from __future__ import annotations

import importlib.metadata
import importlib.util
from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from harness.engines.attitude import place_names, rotation_names
from harness.engines.one_by_one import Stepper, rollout
from harness.engines.protocol import (
    Array,
    Engine,
    EngineError,
    Force,
    Model,
    ModelSpec,
    Sample,
    within,
)
from harness.engines.remark import Remark
from harness.engines.runge_kutta import Accelerations, RungeKutta, to_state
from harness.engines.sdf import SDF_IDLE, sample_sdf
from harness.engines.sdf_sidecar import declared_sdf, stated
from harness.engines.source import engine_errors
from harness.engines.springs import SpringForces
from harness.engines.urdf import IDLE, SETTINGS, UrdfReader, sample_urdf
from harness.engines.urdf_copy import Change
from harness.engines.urdf_sidecar import DeclaredUrdf, check_settings, declared_urdf

SDF = ".sdf"
FREE = 6
"""Coordinates of a root that floats; they come first."""


class UrdfEngine(Engine):
    """An engine for URDFs.

    Attributes:
        package: what is imported.
        defaults: of its settings.
        words: which of those that are words may be.
    """

    formats: tuple[str, ...] = (".urdf",)
    takes_springs: tuple[str, ...] = (".urdf",)
    switches = frozenset({"smooth", "couplings", "held"})
    idle: Mapping[str, str] = MappingProxyType({**IDLE, **SDF_IDLE})
    package: str
    defaults: Mapping[str, float | bool | str]
    words: Mapping[str, Sequence[str]] = MappingProxyType({})

    def version(self) -> str | None:
        """Version of the installed package, or None."""
        if importlib.util.find_spec(self.package) is None:
            return None
        try:
            return importlib.metadata.version(self.distribution)
        except importlib.metadata.PackageNotFoundError:  # from elsewhere, as ROS has it
            return "unknown"

    def load(self, spec: ModelSpec) -> Model:
        """Load a URDF, or an SDFormat file, which may state some settings itself."""
        spec = stated(spec) if spec.path.suffix == SDF else spec
        check_settings(spec, self.title, self.unstated, self.defaults, self.words)
        with engine_errors(spec.path, self.title):
            return self.loaded(spec)

    @abstractmethod
    def loaded(self, spec: ModelSpec) -> Model:
        """The model of a file whose settings are in order."""

    def settings_for(self, suffix: str) -> Mapping[str, object]:
        """Step and gravity."""
        return SETTINGS

    def samples(self) -> tuple[Sample, ...]:
        """A URDF, and an SDFormat file."""
        return (sample_urdf(), *([sample_sdf()] if SDF in self.formats else []))


class UrdfModel(Model):
    """A URDF or an SDFormat file in an engine; a subclass loads it, and makes the `stepper`.

    Args:
        spec: the file.
        title: of the engine.
        reader: how the engine reads URDFs.
        defaults: of the engine's settings.
        further: what is changed in the file besides.
    """

    stepper: Stepper | RungeKutta
    forward: Accelerations | None = None
    """The engine's accelerations, where nothing soft holds joints."""

    def __init__(
        self,
        spec: ModelSpec,
        title: str,
        reader: UrdfReader,
        defaults: Mapping[str, float | bool | str],
        further: Sequence[Change],
    ) -> None:
        self.path, self.title, self._reader = spec.path, title, reader
        self.settings = {**defaults, **spec.settings}
        declare = declared_sdf if spec.path.suffix == SDF else declared_urdf
        self.declared: DeclaredUrdf = declare(spec, further)
        self.floats = bool(self.settings["floating"])
        self.root = self.declared.base
        self.step = float(spec.settings["step"])  # type: ignore[arg-type]  # checked
        self.gravity = tuple(map(float, spec.settings["gravity"]))  # type: ignore[call-overload]

    def name(self, joints: Sequence[str], damping: Array | None = None) -> SpringForces:
        """Take the names of slides and hinges, in the engine's order.

        Args:
            joints: their names.
            damping: of each, where springs are to take it along.

        Returns:
            The springs' forces along them.
        """
        free = (*place_names(self.root), *rotation_names(self.root)) if self.floats else ()
        self.coordinates = (*free, *joints)
        if not self.coordinates:
            raise EngineError(f"{self.path}: it has no moving joint")
        return SpringForces(self.declared.springs, tuple(joints), self.path, damping)

    @property
    def stated_limits(self) -> Array:
        """Between which the file says that positions are, (nz, 2); infinite where it doesn't."""
        found = np.tile([-np.inf, np.inf], (len(self.coordinates), 1))
        for name, bounds in self.declared.bounds.items():
            if name in self.coordinates:
                found[self.coordinates.index(name)] = bounds
        return found

    @property
    def reach(self) -> Array:
        """Within the limits that the file states, whether or not anything holds joints there."""
        return within(super().reach, self.stated_limits)

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """What the file says in vain."""
        yield from self.declared.remarks(self._reader, self.coordinates, z, w)

    def accelerations(self, z: Array, w: Array, force: Array) -> Array | None:
        """By the engine's forward dynamics."""
        if self.forward is None:
            return None
        with engine_errors(self.path, self.title), np.errstate(all="ignore"):
            return self.forward(*(to_state(z, w) if self.floats else (z, w)), force)

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """Step by step; state by state, but where the engine's accelerations are stepped here."""
        with engine_errors(self.path, self.title):
            if isinstance(self.stepper, RungeKutta):
                return self.stepper.rollout(q, v, h, n, force, every)
            return rollout(self.stepper, q, v, h, n, force, every)
