"""Cases of a sweep in a worker: the segments' verdict, and the error at the shipped step.

What a sweep leaves out beside a run's case: the finer full runs, the next step, accelerations,
series, linearizations, audit and coverage.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from harness.cases.verdict import Verdict, component_scale, filled, judged
from harness.cases.witness import failure
from harness.engines.protocol import Array, EngineError, Force, Model
from harness.files.sidecar import Sidecar
from harness.numerics.convergence import largest
from harness.numerics.coordinates import CoordinateMap
from harness.numerics.full_run import sampled_run, why_no_run
from harness.numerics.segments import Batch, extrapolate
from harness.records.base import number
from harness.records.outcome import FLOOR, Outcome
from harness.records.sweep import SweepRow
from harness.sweep.system import Swept, loaded, swept
from reference.motion import Motion


@dataclass(frozen=True, kw_only=True)
class Planned:
    """A case of the plan.

    Attributes:
        index: its number.
        draw: number of its draw.
        constants: that are varied, by name.
        model, engine, scenario, integrator: the case.
        settings: that choose its integrator.
        step: shipped step, seconds; None: the model's own.
        command: that runs it alone.
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
        folder: of the system.
        content: hash of what is in it.
        system: its name.
        varied: names of all constants that are varied.
        resolution: relative discrepancy to resolve.
        cases: by index.
    """

    folder: str
    content: str
    system: str
    varied: frozenset[str]
    resolution: float
    cases: tuple[Planned, ...]

    def alone(self) -> Iterator[Block]:
        """A block for each of its cases."""
        return (replace(self, cases=(case,)) for case in self.cases)


def run_block(block: Block) -> tuple[SweepRow, ...]:
    """Run some cases; one that can't be run is FAILED, with its reason."""
    folder = swept(block.folder, block.varied, block.content)
    for one in {(case.model, case.engine): case for case in block.cases}.values():
        _prepared(folder, one)
    return tuple(_row(folder, block, case) for case in block.cases)


def _prepared(folder: Swept, case: Planned) -> None:
    """Make what all cases of a model share, so that no row's time has it."""
    _ = folder.declared_motions
    folder.model(case.model, case.engine)


def blank(block: Block, case: Planned, reason: str) -> SweepRow:
    """The row of a case that could not be run."""
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
        reason=reason,
        command=case.command,
    )


def _row(folder: Swept, block: Block, case: Planned) -> SweepRow:
    began = time.process_time()
    known = _Known(blank(block, case, ""))
    try:
        with tempfile.TemporaryDirectory(prefix="drawn-") as place:
            _run(folder, block, case, Path(place), known)
    except Exception as error:
        known.tell(outcome=Outcome.FAILED, reason=_said(error))
    known.tell(seconds=time.process_time() - began)
    return known.row


def _said(error: Exception) -> str:
    ours = type(error).__module__.startswith(("harness.", "reference."))
    said = " ".join(str(error).split())
    return said if ours and said else f"{type(error).__name__}: {said}"


class _Known:
    """What is known of a case so far, however it ends."""

    def __init__(self, row: SweepRow) -> None:
        self.row = row

    def tell(self, **more: Any) -> None:
        """Fields of the row."""
        values = {name: getattr(self.row, name) for name in self.row.__struct_fields__}
        self.row = SweepRow(**{**values, **more})


def _run(folder: Swept, block: Block, case: Planned, place: Path, known: _Known) -> None:
    equations = folder.equations(case.constants)
    began = time.process_time()
    motion = folder.motion(case.draw, equations, case.scenario)
    solved = time.process_time()
    known.tell(reference_seconds=solved - began)
    prepared = folder.model(case.model, case.engine)
    constants = {c.name: c.value for c in equations.system.constants}
    sidecar = prepared.redrawn.at(constants, place)
    model = _Timed(loaded(sidecar, case.engine, case.step, case.settings))
    known.tell(loading_seconds=time.process_time() - solved, step=number(model.step))
    if case.step is not None and model.step != case.step:
        raise EngineError(
            f"{sidecar.model.name}: {case.engine} steps it by {model.step:g} s, where"
            f" {case.step:g} s is asked for"
        )
    if why := why_no_run(motion.duration, model.step):
        raise EngineError(f"{sidecar.model.name}: {why}")
    try:
        coordinates = prepared.coordinates.at(equations.values)
        _judged(folder, block, motion, model, coordinates, sidecar, known)
    finally:
        known.tell(engine_seconds=model.seconds, steps=model.steps)


def _judged(
    folder: Swept,
    block: Block,
    motion: Motion,
    model: _Timed,
    coordinates: CoordinateMap,
    sidecar: Sidecar,
    known: _Known,
) -> None:
    others = [m for name, m in folder.declared_motions.items() if name != known.row.scenario]
    scale = component_scale(motion, others)
    names = [c.name for c in folder.system.coordinates]
    components = (*names, *(f"{name}_dot" for name in names))
    batch = Batch.of(motion, scale)
    found = extrapolate(model, coordinates, batch, resolution=block.resolution)
    verdict = judged(
        found,
        motion,
        scale=scale,
        components=components,
        coordinates=tuple(model.coordinates),
        claimed=model.exponents(motion.varying)[0],
        resolution=block.resolution,
    )
    known.tell(
        outcome=verdict.outcome,
        reason=verdict.reason,
        discrepancy=number(verdict.discrepancy),
        uncertainty=number(verdict.uncertainty),
        digits=number(_digits(verdict)),
        order=number(verdict.order),
    )
    run = sampled_run(model, coordinates, motion, model.step)
    amplitude = filled(np.maximum(motion.amplitude, FLOOR * folder.amplitude))
    error = largest(run, amplitude[: len(names)])
    known.tell(global_error=number(error))
    if why := failure(run, error, motion):
        told = "; the engine warns: ".join((f"{sidecar.model.name}: {why}", *model.warnings))
        known.tell(outcome=Outcome.FAILED, reason=told)


def _digits(verdict: Verdict) -> float:
    """That agree in every component; nan where nothing was judged."""
    worst = max(verdict.largest_discrepancy, verdict.largest_uncertainty)
    if not math.isfinite(worst):
        return math.nan
    return -math.log10(worst) if worst > 0 else 17.0


class _Timed(Model):
    """A model whose stepping is counted and timed."""

    def __init__(self, model: Model) -> None:
        self._model = model
        self.seconds, self.steps = 0.0, 0
        self.coordinates, self.step = model.coordinates, model.step
        self.integrator, self.gravity = model.integrator, model.gravity
        self.epsilon = model.epsilon

    def exponents(self, varying_input: bool) -> tuple[int, int]:
        return self._model.exponents(varying_input)

    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        began = time.process_time()
        found = self._model.rollout(q, v, h, n, force, every)
        self.seconds += time.process_time() - began
        self.steps += n * len(q)
        return found

    @property
    def warnings(self) -> tuple[str, ...]:
        return self._model.warnings
