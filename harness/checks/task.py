"""One model file in one engine, and the prepared equations to check it against."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Generic, TypeVar

from physics_crosscheck.harness.documents.reading import USD_SUFFIXES
from physics_crosscheck.harness.engines.protocol import EngineError, LoadedModel, ModelSpec
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.robot import armatures_of
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap, coordinate_map
from physics_crosscheck.harness.paths import RESOLUTION
from physics_crosscheck.harness.records.baseline import Snapshot
from physics_crosscheck.harness.records.case import CaseId
from physics_crosscheck.reference.mechanism.system import System
from .prepare import Prepared, PreparedSystem, PreparedTree

P = TypeVar("P", bound=Prepared, covariant=True)
Q = TypeVar("Q", bound=Prepared)


class RefusedError(EngineError):
    """An engine that refuses to load a model file."""


@dataclass(frozen=True, kw_only=True)
class ModelTask(Generic[P]):
    """One model file in one engine, and the equations to check it against; picklable.

    Attributes:
        target: the prepared folder or file.
        engine: name of the engine.
        spec: what the engine loads: the file, its settings and springs.
        sidecar: of a folder's model; None for a file alone.
        scenario: name of one scenario; empty for tasks of all.
        resolution: relative discrepancy to resolve.
        thorough: whether every check runs, also those whose answer others imply.
        snapshot: accepted snapshot that a measurement repeats, if any.
    """

    target: P
    engine: str
    spec: ModelSpec
    sidecar: Sidecar | None = None
    scenario: str = ""
    resolution: float = RESOLUTION
    thorough: bool = False
    snapshot: Snapshot | None = None

    @property
    def file(self) -> Path:
        """The model file."""
        return self.spec.path

    @property
    def id(self) -> CaseId:
        """Name of the case."""
        return CaseId(
            system=self.target.record.name,
            model=self.file.name,
            scenario=self.scenario,
            engine=self.engine,
        )

    @property
    def declared(self) -> Sidecar:
        """The sidecar, which each model of a folder has."""
        assert self.sidecar is not None
        return self.sidecar

    def load(self) -> tuple[LoadedModel, CoordinateMap]:
        """Load the file in its engine, and build the map from the equations' coordinates.

        Raises:
            RefusedError: if the engine refuses a robot file, naming file, place and remedy.
            EngineError, SidecarError: if it refuses another, or if the joints are not those of the
                equations.
        """
        try:
            model = engines()[self.engine].load(self.spec)
            return model, self.map(model)
        except EngineError as error:
            if self.sidecar is not None:
                raise
            refused = RefusedError(error.sentence, file=error.file, line=error.line)
            refused.kind = error.kind
            raise refused from error

    def map(self, model: LoadedModel) -> CoordinateMap:
        """Build the map from the equations' coordinates to those of a loaded model."""
        there = tuple(model.coordinates)
        return self.target.coordinates(self.sidecar, self.file, self.engine, there)

    def with_target(self, **changes: Any) -> ModelTask[P]:
        """Return the task with other fields of the prepared target."""
        return replace(self, target=replace(self.target, **changes))

    def with_file(self, file: Path) -> ModelTask[P]:
        """Return the task of a copy of the file."""
        # A layer over a file in USD names it, which was checked before.
        allowed = {"allow_outside": True} if file.suffix in USD_SUFFIXES else {}
        settings = {**self.spec.settings, **allowed}
        return replace(self, spec=replace(self.spec, path=file, settings=settings))

    def with_sidecar(self, sidecar: Sidecar) -> ModelTask[P]:
        """Return the task of another model of the folder."""
        return replace(self, sidecar=sidecar, spec=sidecar.spec(self.engine))

    def with_settings(self, **settings: object) -> ModelTask[P]:
        """Return the task with other settings of the engine."""
        return replace(self, spec=replace(self.spec, settings={**self.spec.settings, **settings}))


SystemTask = ModelTask[PreparedSystem]
"""Task of a folder that declares energies."""

TreeTask = ModelTask[PreparedTree]
"""Task of a folder that declares bodies, or of a robot file."""


def model_task(
    target: Q,
    engine: str,
    sidecar: Sidecar | None = None,
    *,
    scenario: str = "",
    resolution: float = RESOLUTION,
    thorough: bool = False,
    snapshot: Snapshot | None = None,
) -> ModelTask[Q]:
    """Build the task of a model in an engine.

    Raises:
        SidecarError: if the sidecar's settings can't be read.
    """
    spec = target.spec(sidecar, engine)
    if isinstance(target, PreparedTree):
        scenario = target.scenario
        target = target.with_armatures(armatures_of(spec.settings))  # type: ignore[assignment]
    return ModelTask(
        target=target.under_laws(sidecar),
        engine=engine,
        spec=spec,
        sidecar=sidecar,
        scenario=scenario,
        resolution=resolution,
        thorough=thorough,
        snapshot=snapshot,
    )


def load(system: System, sidecar: Sidecar, engine: str) -> tuple[LoadedModel, CoordinateMap]:
    """Load a model of a folder with energies, and build the map between coordinates.

    Raises:
        EngineError, SidecarError: naming file, place and remedy.
    """
    model = engines()[engine].load(sidecar.spec(engine))
    return model, coordinate_map(system, sidecar, model.coordinates)
