"""What adapters of engines that take a URDF, and have one state at a time, have in common."""

from __future__ import annotations

import importlib.metadata
import importlib.util
from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from xml.etree import ElementTree as ET

import numpy as np

from harness.engines.protocol import Array, Engine, EngineError, Model, ModelSpec, Sample, within
from harness.engines.remark import Remark
from harness.engines.source import engine_errors
from harness.engines.tree_model import TreeModel
from harness.engines.urdf import (
    IDLE,
    SETTINGS,
    UrdfReader,
    base_name,
    sample_urdf,
    urdf_remarks,
)
from harness.engines.urdf_copy import Change
from harness.engines.urdf_sidecar import check_settings, declared_urdf

CONTROLS = "controls"
"""At which actuators are held."""


class UrdfEngine(Engine):
    """An engine for URDFs.

    Attributes:
        package: what is imported.
        defaults: of its settings.
        words: which of those that are words may be.
    """

    formats: tuple[str, ...] = (".urdf",)
    takes_springs = (".urdf",)
    switches = frozenset({"smooth", "couplings", "held"})
    idle = IDLE
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
        """Load a URDF."""
        others = self.switches & {CONTROLS}
        check_settings(spec, self.title, self.unstated, self.defaults, self.words, others)
        if spec.path.suffix == ".urdf" and spec.settings.get(CONTROLS):
            told = f"[settings] controls is {spec.settings[CONTROLS]!r}"
            raise EngineError(f"{spec.path}.toml: {told}, and a URDF has no actuators")
        with engine_errors(spec.path, self.title):
            return self.loaded(spec)

    @abstractmethod
    def loaded(self, spec: ModelSpec) -> Model:
        """The model of a file whose settings are in order."""

    def settings_for(self, suffix: str) -> Mapping[str, object]:
        """Step and gravity."""
        return SETTINGS

    def samples(self) -> tuple[Sample, ...]:
        """A URDF."""
        return (sample_urdf(),)


class UrdfModel(TreeModel):
    """A URDF in an engine; a subclass loads it, and makes the `stepper`.

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
        self.declared = declared_urdf(spec, further)
        super().__init__(spec, title, {**defaults, **spec.settings})
        self.floats = bool(self.settings["floating"])
        self.root = base_name(self.declared.robot)
        self.springs, self.mimics = self.declared.springs, self.declared.mimics

    @property
    def stated_limits(self) -> Array:
        """Between which the file says that positions are, (nz, 2); infinite where it doesn't."""
        found = np.tile([-np.inf, np.inf], (len(self.coordinates), 1))
        for joint in self.declared.robot.findall("joint"):
            limit, name = joint.find("limit"), joint.get("name", "")
            bounds = _bounds(limit) if limit is not None else None
            if bounds and name in self.coordinates and joint.get("type") != "continuous":
                found[self.coordinates.index(name)] = bounds
        return found

    @property
    def reach(self) -> Array:
        """Within the limits that the file states, whether or not anything holds joints there."""
        return within(super().reach, self.stated_limits)

    def remarks(self, z: Array, w: Array) -> Iterator[Remark]:
        """What the URDF says in vain."""
        yield from urdf_remarks(self._reader, self.path, self.coordinates, z, w)


def _bounds(limit: ET.Element) -> tuple[float, float] | None:
    """Those that a file states and that leave something between them."""
    lower, upper = (float(limit.get(key, "nan")) for key in ("lower", "upper"))
    return (lower, upper) if lower < upper else None
