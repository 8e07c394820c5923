"""What adapters of engines that take a URDF, and have one state at a time, have in common."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from physics_crosscheck.harness.engines.installed import version_of
from physics_crosscheck.harness.engines.mjcf_source import with_options
from physics_crosscheck.harness.engines.protocol import (
    Array,
    Engine,
    EngineError,
    Model,
    ModelSpec,
    Sample,
    within,
)
from physics_crosscheck.harness.engines.remark import Remark
from physics_crosscheck.harness.engines.sdf_sidecar import MODEL, declared_sdf, stated
from physics_crosscheck.harness.engines.source import engine_errors
from physics_crosscheck.harness.engines.tree_model import TreeModel
from physics_crosscheck.harness.engines.urdf import IDLE, SETTINGS, UrdfReader, sample_urdf
from physics_crosscheck.harness.engines.urdf_copy import Change
from physics_crosscheck.harness.engines.urdf_sidecar import (
    DeclaredUrdf,
    check_settings,
    declared_urdf,
)

SDF = ".sdf"
MJCF = ".xml"
CONTROLS = "controls"
"""At which actuators are held."""

_STATED: Mapping[str, Callable[[ModelSpec], ModelSpec]] = MappingProxyType(
    {SDF: stated, MJCF: with_options}
)
"""What formats say themselves of what is a setting elsewhere."""


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
    idle: Mapping[str, str] = IDLE
    package: str
    defaults: Mapping[str, float | bool | str]
    words: Mapping[str, Sequence[str]] = MappingProxyType({})

    def version(self) -> str | None:
        """Version of the installed package, or None."""
        return version_of(self.package, self.distribution)

    def load(self, spec: ModelSpec) -> Model:
        """Load a file, with the settings that it states itself."""
        if own := _STATED.get(spec.path.suffix):
            spec = own(spec)
        others = self.switches & {CONTROLS} | ({MODEL} if spec.path.suffix == SDF else set())
        check_settings(spec, self.title, self.unstated, self.defaults, self.words, others)
        if spec.path.suffix != MJCF and spec.settings.get(CONTROLS):
            told = f"[settings] controls is {spec.settings[CONTROLS]!r}"
            raise EngineError(
                f"{spec.path}.toml: {told}, but the adapter reads no actuators from it"
            )
        with engine_errors(spec.path, self.title):
            return self.loaded(spec)

    @abstractmethod
    def loaded(self, spec: ModelSpec) -> Model:
        """The model of a file whose settings are in order."""

    def settings_for(self, suffix: str) -> Mapping[str, object]:
        """Step and gravity, which an MJCF states."""
        return {} if suffix == MJCF else SETTINGS

    def samples(self) -> tuple[Sample, ...]:
        """A URDF."""
        return (sample_urdf(),)


class UrdfModel(TreeModel):
    """A URDF or an SDFormat file in an engine; a subclass loads it, and makes the `stepper`.

    Args:
        spec: the file.
        title: of the engine.
        reader: how the engine reads URDFs.
        defaults: of the engine's settings.
        further: what is changed in the file besides.
    """

    def __init__(
        self,
        spec: ModelSpec,
        title: str,
        reader: UrdfReader,
        defaults: Mapping[str, float | bool | str],
        further: Sequence[Change],
    ) -> None:
        self._reader = reader
        declare = declared_sdf if spec.path.suffix == SDF else declared_urdf
        self.declared: DeclaredUrdf = declare(spec, further)
        super().__init__(spec, title, {**defaults, **spec.settings})
        self.floats = bool(self.settings["floating"])
        self.root = self.declared.base
        self.springs, self.mimics = self.declared.springs, self.declared.mimics

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
