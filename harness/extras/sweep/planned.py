"""Tasks of a worker, some cases of one system or robot file, and the rows that result."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import msgspec

from physics_crosscheck.harness.checks.verdict import CaseJudgement
from physics_crosscheck.harness.engines.protocol import (
    Array,
    EngineError,
    Force,
    LoadedModel,
)
from physics_crosscheck.harness.jobs.failure import Failure
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
