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
    StepRule,
)
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.records.base import number
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.sweep import SweepRow


@dataclass(frozen=True, kw_only=True)
class Planned:
    """A planned case.

    Attributes:
        index: its number.
        draw: number of its draw.
        constants: values of varied constants, by name.
        model, engine, scenario, integrator: names of the case.
        settings: settings that select its integrator.
        step: time step, seconds; None: the model's own.
        command: command that runs it alone.
    """

    index: int
    draw: int
    constants: Mapping[str, float]
    model: str
    engine: str
    scenario: str
    integrator: str
    settings: Mapping[str, Any]
    step: float | None
    command: str


@dataclass(frozen=True, kw_only=True)
class Block:
    """Some cases of one system, for one worker.

    Attributes:
        folder: folder of the system, or the robot file.
        content: hash of its content.
        system: its name.
        varied: names of all varied constants.
        resolution: smallest relative discrepancy to detect.
        thorough: whether segments decide even where single steps suffice.
        cases: cases by index.
    """

    folder: str
    content: str
    system: str
    varied: frozenset[str]
    resolution: float
    thorough: bool
    cases: tuple[Planned, ...]

    def single_blocks(self) -> Iterator[Block]:
        """Yield one block per case."""
        return (replace(self, cases=(case,)) for case in self.cases)


def blank(block: Block, case: Planned, failure: Failure) -> SweepRow:
    """Return the row of a case that could not run."""
    return SweepRow(
        index=case.index,
        draw=case.draw,
        system=block.system,
        model=case.model,
        engine=case.engine,
        scenario=case.scenario,
        integrator=case.integrator,
        step=number(case.step),
        constants=dict(case.constants),
        outcome=Outcome.FAILED,
        reason=failure.reason,
        kind=failure.kind,
        command=case.command,
    )


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
    def stepping(self, model: Timed) -> Iterator[None]:
        """Record steps and time of the engine, however the block ends."""
        try:
            yield
        finally:
            self.update(engine_seconds=model.seconds, steps=model.steps)

    def check_step(self, model: LoadedModel, case: Planned) -> None:
        """Set the model's time step.

        Raises:
            EngineError: if another step was requested.
        """
        self.update(step=number(model.step))
        if case.step is not None and model.step != case.step:
            raise EngineError(
                f"{case.model}: {case.engine} steps it by {model.step:g} s, where"
                f" {case.step:g} s is asked for"
            )


def _digits(verdict: CaseJudgement) -> float:
    """Return the number of digits that agree in every component; nan without a judged one."""
    worst = max(verdict.largest_discrepancy, verdict.largest_uncertainty)
    if not math.isfinite(worst):
        return math.nan
    return -math.log10(worst) if worst > 0 else 17.0


class Timed(LoadedModel):
    """A model that counts and times its steps."""

    def __init__(self, model: LoadedModel) -> None:
        self._model = model
        self.seconds, self.steps = 0.0, 0
        self.coordinates, self.step = model.coordinates, model.step
        self.integrator, self.gravity = model.integrator, model.gravity
        self.epsilon = model.epsilon

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        """Return the model's exponents."""
        return self._model.exponents(varying_input)

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """Run the model, timed and counted."""
        began = time.process_time()
        states = self._model.rollout(q, v, h, n, force, every)
        self.seconds += time.process_time() - began
        self.steps += n * len(q)
        return states

    def accelerations(self, z: Array, w: Array, force: Array) -> Array | None:
        """Return the model's accelerations."""
        return self._model.accelerations(z, w, force)

    def equality_errors(self, z: Array) -> Array | None:
        """Return the model's distance from its equalities."""
        return self._model.equality_errors(z)

    @property
    def step_rule(self) -> StepRule | None:
        """The model's rule."""
        return self._model.step_rule

    @property
    def integrators(self) -> Mapping[str, Mapping[str, object]]:
        """The model's other integrators."""
        return self._model.integrators

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of the model."""
        return self._model.warnings
