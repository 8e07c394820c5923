"""Sources of a sweep's cases, in a worker: a system folder or a robot file, and its last values."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Generic, TypeVar

from physics_crosscheck.harness.engines.registry import engines, engines_reading, engines_to_run
from physics_crosscheck.harness.modelfiles.model_files import (
    UnreadModel,
    chosen_engines,
    model_files,
)
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, SidecarError
from .planned import Block, CaseRecord, Planned

Value = TypeVar("Value")

KEPT = 4
"""Size of a worker's cache."""


class RecentValues(Generic[Value]):
    """The last few results, by their inputs."""

    def __init__(self) -> None:
        self._values: OrderedDict[Hashable, Value] = OrderedDict()

    def get(self, key: Hashable, make: Callable[[], Value]) -> Value:
        """Return a cached result, or make it."""
        if key not in self._values:
            self._values[key] = make()
            while len(self._values) > KEPT:
                self._values.popitem(last=False)
        return self._values[key]


Integrators = tuple[str, Mapping[str, Mapping[str, object]]]
"""A model's own integrator, and others of its engine with the settings that select them."""


class Source(ABC):
    """Models with numbers that can be varied.

    Args:
        place: a system folder, or a robot file.
    """

    signed: bool
    """True if constants keep their declared signs."""

    def __init__(self, place: Path) -> None:
        self._place = place
        self._sidecars: Mapping[str, Sidecar | UnreadModel] = {}
        if place.is_dir():
            self._sidecars = {
                one.model if isinstance(one, UnreadModel) else one.model.name: one
                for one in model_files(place)
            }

    @property
    @abstractmethod
    def name(self) -> str:
        """Name of the system or robot."""

    @abstractmethod
    def varying(self, varied: frozenset[str]) -> Source:
        """Return the source with other varied constants, sharing everything independent of them."""

    @property
    @abstractmethod
    def constants(self) -> Mapping[str, float]:
        """Constants that can be varied, with their declared values."""

    @property
    @abstractmethod
    def scenarios(self) -> tuple[str, ...]:
        """Names of the scenarios."""

    def runs(self, only: Sequence[str]) -> Iterator[tuple[str, str]]:
        """Yield each model with each engine that runs it, installed or not.

        Args:
            only: engines; empty: the default ones.

        Raises:
            SidecarError: if a model can't be read, or names an unknown engine.
        """
        if self._place.is_file():
            for adapter in (engines_reading if only else engines_to_run)(self._place.suffix):
                if not only or adapter.name in only:
                    yield self._place.name, adapter.name
        for name in self._sidecars:
            sidecar = self.sidecar(name)
            for engine in chosen_engines(sidecar, only):
                if engine not in engines():
                    raise SidecarError(f"{sidecar.model}.toml: no engine {engine!r} is known")
                yield name, engine

    def sidecar(self, model: str) -> Sidecar:
        """Return the sidecar of a folder's model.

        Raises:
            SidecarError: if the model can't be read.
        """
        sidecar = self._sidecars[model]
        if isinstance(sidecar, UnreadModel):
            raise SidecarError(sidecar.reason)
        return sidecar

    def follows(self, model: str, engine: str) -> bool:
        """Return whether a model has any of the varied constants, if there are any."""
        return True

    @abstractmethod
    def prepare(self, model: str, engine: str) -> Integrators:
        """Prepare the data that all cases of a model in an engine share, once.

        Raises:
            SidecarError, LocationError, EngineError, RobotError: naming file, place and remedy.
        """

    @abstractmethod
    def run(self, case: Planned, block: Block, place: Path, record: CaseRecord) -> None:
        """Run a case.

        Args:
            case: the case.
            block: its block, with resolution and thoroughness.
            place: an empty folder, for a copy of the model with other numbers.
            record: receives results as they become known.

        Raises:
            Exception: of any kind, with the reason why it can't run.
        """
