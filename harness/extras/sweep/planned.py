"""Sources of a sweep's cases in a worker, tasks of some cases of one source, and their rows."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec

from physics_crosscheck.harness.checks.verdict import CaseJudgement
from physics_crosscheck.harness.engines.protocol import Array, EngineError, Force, LoadedModel
from physics_crosscheck.harness.engines.registry import engines, engines_reading, engines_to_run
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.modelfiles.model_files import (
    UnreadModel,
    chosen_engines,
    model_files,
)
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, SidecarError
from physics_crosscheck.harness.records.base import number
from physics_crosscheck.harness.records.sweep import SweepRow


@dataclass(frozen=True, kw_only=True)
class Planned:
    """A planned case.

    Attributes:
        row: its row before it runs; without a step, the model has its own.
        settings: settings that select its integrator.
    """

    row: SweepRow
    settings: Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class Block:
    """Some cases of one system, for one worker.

    Attributes:
        folder: folder of the system, or the robot file.
        content: hash of its content.
        varied: names of all varied constants.
        resolution: smallest relative discrepancy to detect.
        thorough: whether segments decide even where single steps suffice.
        cases: cases by index.
    """

    folder: str
    content: str
    varied: frozenset[str]
    resolution: float
    thorough: bool
    cases: tuple[Planned, ...]

    def single_blocks(self) -> Iterator[Block]:
        """Yield one block per case."""
        return (replace(self, cases=(case,)) for case in self.cases)


def blank(case: Planned, failure: Failure) -> SweepRow:
    """Return the row of a case that could not run."""
    return msgspec.structs.replace(case.row, reason=failure.reason, kind=failure.kind)


class CaseRecord:
    """The known fields of a case, available however it ends."""

    def __init__(self, row: SweepRow) -> None:
        self.row = row

    def update(self, **fields: Any) -> None:
        """Set fields of the row."""
        self.row = msgspec.structs.replace(self.row, **fields)

    def set_verdict(self, verdict: CaseJudgement) -> None:
        """Set the fields that follow from the verdict."""
        self.update(
            decided_by=verdict.decided_by,
            outcome=verdict.outcome,
            reason=verdict.reason,
            kind=verdict.kind,
            discrepancy=number(verdict.discrepancy),
            uncertainty=number(verdict.uncertainty),
            resolution=number(verdict.resolution),
            digits=number(_digits(verdict)),
            order=number(verdict.order),
        )

    @contextmanager
    def timing(self, field: str) -> Iterator[None]:
        """Measure the processor time of a block for a field of the row."""
        began = time.process_time()
        try:
            yield
        finally:
            self.update(**{field: time.process_time() - began})

    @contextmanager
    def stepping(self, clock: StepClock) -> Iterator[None]:
        """Record steps and time of the engine, however the block ends."""
        try:
            yield
        finally:
            self.update(engine_seconds=clock.seconds, steps=clock.steps)

    def check_step(self, model: LoadedModel, case: Planned) -> None:
        """Set the model's time step.

        Raises:
            EngineError: if another step was requested.
        """
        self.update(step=number(model.step))
        wanted = case.row.step
        if wanted is not None and model.step != wanted:
            raise EngineError(
                f"{case.row.model}: {case.row.engine} steps it by {model.step:g} s, where"
                f" {wanted:g} s is asked for"
            )


def _digits(verdict: CaseJudgement) -> float:
    """Return the number of digits that agree in every component; nan without a judged one."""
    worst = max(verdict.largest_discrepancy, verdict.largest_uncertainty)
    if not math.isfinite(worst):
        return math.nan
    return -math.log10(worst) if worst > 0 else 17.0


class StepClock:
    """Processor time and number of the steps that a model takes from now on."""

    def __init__(self, model: LoadedModel) -> None:
        self.seconds, self.steps = 0.0, 0
        rollout = model.rollout

        def timed(
            q: Array, v: Array, h: float, n: int, force: Force, every: int
        ) -> tuple[Array, Array]:
            began = time.process_time()
            states = rollout(q, v, h, n, force, every)
            self.seconds += time.process_time() - began
            self.steps += n * len(q)
            return states

        model.rollout = timed  # type: ignore[method-assign]


KEPT = 4
"""Motions and equations that a worker keeps."""

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
