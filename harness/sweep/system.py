"""A system folder in a worker: its equations and its models, prepared once for all its cases."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp

from harness.engines.protocol import Model
from harness.engines.registry import engines
from harness.files.model_files import UnreadModel, model_files
from harness.files.redrawn import Redrawn, redrawn
from harness.files.sidecar import Sidecar, SidecarError
from harness.numerics.coordinates import CoordinateFamily, coordinate_family
from reference.declaration import Scenario
from reference.derive import derive
from reference.family import DrawnEquations, Family, solve_drawn
from reference.load import load_system
from reference.motion import Motion
from reference.numeric import Array
from reference.system import System

KEPT = 4
"""Motions that a worker holds: cases of one draw and scenario follow each other."""


@dataclass(frozen=True)
class Prepared:
    """A model in an engine, ready for any constants.

    Attributes:
        redrawn: its file.
        coordinates: between the system and the engine.
        integrator: its own, by name.
        integrators: others that the engine offers for it, with the settings that choose them.
    """

    redrawn: Redrawn
    coordinates: CoordinateFamily
    integrator: str
    integrators: Mapping[str, Mapping[str, object]]


class Swept:
    """A system folder, and what its cases share.

    Attributes:
        folder: where it is.
        varied: names of the constants that are varied.
        system: as it is declared.
        family: its equations, for any constants.
    """

    def __init__(self, folder: Path, varied: frozenset[str]) -> None:
        self.folder, self.varied = folder, varied
        self.system: System = load_system(folder)
        self.family = Family.of(derive(self.system))
        self._models: dict[tuple[str, str], Prepared] = {}
        self._motions: OrderedDict[tuple[object, ...], Motion] = OrderedDict()
        self._sidecars = {
            one.model.name if isinstance(one, Sidecar) else one.model: one
            for one in model_files(folder)
        }

    @property
    def own(self) -> frozenset[str]:
        """Those of the varied constants that it has."""
        return self.varied & {c.name for c in self.system.constants}

    @property
    def needed(self) -> frozenset[str]:
        """Those that its accelerations depend on."""
        found = set[sp.Basic]().union(*(e.free_symbols for e in self.family.equations.acceleration))
        return frozenset(c.name for c in self.system.constants if c.symbol in found)

    def sidecars(self) -> Iterator[Sidecar]:
        """Of its models.

        Raises:
            SidecarError: for a model that can't be read.
        """
        for one in self._sidecars.values():
            if isinstance(one, UnreadModel):
                raise SidecarError(one.reason)
            yield one

    def model(self, name: str, engine: str) -> Prepared:
        """A model in an engine, prepared where it is asked for first.

        Raises:
            SidecarError, LocationError, EngineError: naming file, place and remedy.
        """
        if (name, engine) not in self._models:
            sidecar = self._sidecars[name]
            if isinstance(sidecar, UnreadModel):
                raise SidecarError(sidecar.reason)
            loaded = engines()[engine].load(sidecar.spec(engine))
            coordinates = coordinate_family(self.system, sidecar, loaded.coordinates)
            needed = self.needed | coordinates.constants
            found = redrawn(self.system, sidecar, self.own, needed)
            self._models[name, engine] = Prepared(
                found, coordinates, loaded.integrator, loaded.integrators
            )
        return self._models[name, engine]

    def equations(self, constants: Mapping[str, float]) -> DrawnEquations:
        """The equations at drawn constants."""
        return self.family.at(constants)

    def motion(self, draw: int, equations: DrawnEquations, scenario: str) -> Motion:
        """The reference motion of a scenario in a draw.

        Raises:
            DeclarationError, ReferenceError: where there is none.
        """
        key = draw, equations.values, scenario
        if key not in self._motions:
            self._motions[key] = solve_drawn(equations, self.system.scenario(scenario))
            while len(self._motions) > KEPT:
                self._motions.popitem(last=False)
        return self._motions[key]

    @cached_property
    def declared_motions(self) -> Mapping[str, Motion]:
        """Those of all scenarios at the declared constants, for how far components move."""
        equations = self.family.at({})
        scenarios: tuple[Scenario, ...] = self.system.scenarios
        return {one.name: solve_drawn(equations, one) for one in scenarios}

    @cached_property
    def amplitude(self) -> Array:
        """Largest magnitude of each component over all scenarios as declared, (2n,)."""
        found: Array = np.max([m.amplitude for m in self.declared_motions.values()], axis=0)
        return found


@lru_cache(maxsize=16)
def swept(folder: str, varied: frozenset[str], content: str) -> Swept:
    """A folder, prepared once a process.

    Args:
        folder: of the system.
        varied: names of the constants that are varied.
        content: hash of what is in it: a worker that lives on takes no old one for it.

    Raises:
        DeclarationError, SidecarError: naming what is wrong and where.
    """
    return Swept(Path(folder), varied)


def loaded(sidecar: Sidecar, engine: str, step: float | None, settings: Mapping[str, Any]) -> Model:
    """Load a model with another step and integrator, where these are asked for.

    Raises:
        EngineError: naming file, place and remedy.
    """
    own = {**sidecar.engine_settings.get(engine, {}), **settings}
    if step is not None:
        own["step"] = step
    changed = replace(sidecar, engine_settings={**sidecar.engine_settings, engine: own})
    return engines()[engine].load(changed.spec(engine))
