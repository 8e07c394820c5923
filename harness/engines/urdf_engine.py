"""The shared base of adapters that read URDFs and have one state at a time."""

from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from physics_crosscheck.harness.documents.reading import STAGE_SETTINGS, USD_SUFFIXES
from .installed import version_of
from .mjcf_source import with_options
from .protocol import (
    ARMATURES,
    Array,
    Engine,
    EngineError,
    LoadedModel,
    ModelSpec,
    Sample,
    clip_ranges,
)
from .remark import Remark
from .sdf_sidecar import MODEL, declared_sdf, stated
from .source import engine_errors, with_stage_settings
from .tree_model import TreeModel
from .urdf import SETTINGS, URDF_NON_PHYSICAL, UrdfReader, sample_urdf
from .urdf_copy import Change
from .urdf_sidecar import Declarations, check_settings, declared_urdf

SDF = ".sdf"
MJCF = ".xml"
CONTROLS = "controls"
"""The setting for held actuator inputs."""

_STATED: Mapping[str, Callable[[ModelSpec], ModelSpec]] = MappingProxyType(
    {SDF: stated, MJCF: with_options, **dict.fromkeys(USD_SUFFIXES, with_stage_settings)}
)
"""Readers of values that these formats state and others need as settings."""


class UrdfEngine(Engine):
    """An engine for URDFs.

    Attributes:
        package: the module that is imported.
        defaults: of its settings.
        words: the accepted words of text settings.
    """

    formats: tuple[str, ...] = (".urdf",)
    takes_springs: tuple[str, ...] = (".urdf",)
    switches = frozenset({"smooth", "couplings", "held"})
    non_physical: Mapping[str, str] = URDF_NON_PHYSICAL
    package: str
    defaults: Mapping[str, float | bool | str]
    words: Mapping[str, Sequence[str]] = MappingProxyType({})

    def version(self) -> str | None:
        """Return the version of the installed package, or None."""
        return version_of(self.package, self.distribution)

    def load(self, spec: ModelSpec) -> LoadedModel:
        """Load a file, with the settings that it states itself."""
        if with_stated := _STATED.get(spec.path.suffix):
            spec = with_stated(spec)
        others = (
            {ARMATURES}
            | self.switches & {CONTROLS}
            | ({MODEL} if spec.path.suffix == SDF else set())
            | (set(STAGE_SETTINGS) if spec.path.suffix in USD_SUFFIXES else set())
        )
        check_settings(
            spec, self.title, self.default_settings_note, self.defaults, self.words, others
        )
        if spec.path.suffix != MJCF and spec.settings.get(CONTROLS):
            problem = f"[settings] controls is {spec.settings[CONTROLS]!r}"
            raise EngineError(
                f"{spec.path}.toml: {problem}, but the adapter reads no actuators from it"
            )
        with engine_errors(spec.path, self.title):
            return self.loaded(spec)

    @abstractmethod
    def loaded(self, spec: ModelSpec) -> LoadedModel:
        """Return the model of a file whose settings are valid."""

    def settings_for(self, suffix: str) -> Mapping[str, object]:
        """Return step and gravity, except for an MJCF, which states them."""
        return {} if suffix == MJCF else SETTINGS

    def samples(self) -> tuple[Sample, ...]:
        """Return a URDF."""
        return (sample_urdf(),)


class UrdfModel(TreeModel):
    """A URDF or an SDFormat file in an engine; a subclass loads it and creates the `stepper`.

    Args:
        spec: the file.
        title: of the engine.
        reader: the engine's behaviour as a URDF reader.
        defaults: of the engine's settings.
        further: the engine's own changes to the file.
    """

    def __init__(
        self,
        spec: ModelSpec,
        title: str,
        reader: UrdfReader,
        defaults: Mapping[str, float | bool | str],
        further: Sequence[Change],
    ) -> None:
        declare = declared_sdf if spec.path.suffix == SDF else declared_urdf
        self.declared: Declarations = declare(spec, further)
        reader.refuse_limits(self.declared.file)
        super().__init__(spec, title, {**defaults, **spec.settings})
        self._reader = replace(reader, stops_turns="") if self.settings.get("smooth") else reader
        self.floats = bool(self.settings["floating"])
        self.root = self.declared.base
        self.springs, self.mimics = self.declared.springs, self.declared.mimics

    @property
    def stated_limits(self) -> Array:
        """Position limits of the file, (nz, 2); infinite for joints without one."""
        result = np.tile([-np.inf, np.inf], (len(self.coordinates), 1))
        for name, bounds in self.declared.bounds(turns=bool(self._reader.stops_turns)).items():
            if name in self.coordinates:
                result[self.coordinates.index(name)] = bounds
        return result

    @property
    def sampling_range(self) -> Array:
        """Sampling range within the file's limits, whether or not they are enforced."""
        return clip_ranges(super().sampling_range, self.stated_limits)

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """Yield remarks about the file."""
        yield from self.declared.remarks(self._reader, self.coordinates, z, w)
