"""One case: one model file in one engine in one scenario, from its load to its verdict."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from harness.cases.case_record import (
    full_run_record,
    linearization_record,
    series_record,
    verdict_record,
)
from harness.cases.prepare import Equilibrium, Prepared
from harness.cases.verdict import Verdict, judge
from harness.engines.protocol import Model
from harness.engines.registry import engines
from harness.files.sidecar import Sidecar
from harness.numerics.coordinates import CoordinateMap, coordinate_map
from harness.numerics.full_run import StepStudy, study_step
from harness.numerics.linearization import linearize_engine
from harness.numerics.segments import Batch, BlownUpError, extrapolate
from harness.records.case import Case, CaseId
from harness.records.model import EngineLinearization
from harness.records.outcome import FLOOR, Outcome
from reference.motion import Motion
from reference.numeric import Array, NumericFunction
from reference.system import System

BLOWN_UP = 1e6
"""Global errors beyond so many amplitudes are an instability that ran out of time, not accuracy."""


@dataclass(frozen=True, kw_only=True)
class CaseTask:
    """Everything a worker needs for one case; `folder` is the system's."""

    folder: str
    system: System
    sidecar: Sidecar
    engine: str
    scenario: str
    motion: Motion
    scale: Array
    amplitude: Array
    power: NumericFunction
    components: tuple[str, ...]
    resolution: float

    @property
    def id(self) -> CaseId:
        """The case's name."""
        return CaseId(
            system=self.system.name,
            model=self.sidecar.model.name,
            scenario=self.scenario,
            engine=self.engine,
        )


@dataclass(frozen=True, kw_only=True)
class LinearizationTask:
    """Everything a worker needs for the linearizations of one model in one engine."""

    system: System
    sidecar: Sidecar
    engine: str
    equilibria: tuple[Equilibrium, ...]
    amplitude: Array
    push: Array


def case_task(
    prepared: Prepared, sidecar: Sidecar, engine: str, scenario: str, resolution: float
) -> CaseTask:
    """Gather what one case needs of its prepared system."""
    return CaseTask(
        folder=str(prepared.folder),
        system=prepared.system,
        sidecar=sidecar,
        engine=engine,
        scenario=scenario,
        motion=prepared.motions[scenario],
        scale=prepared.scales[scenario],
        amplitude=prepared.amplitude,
        power=prepared.power,
        components=prepared.components,
        resolution=resolution,
    )


def linearization_task(prepared: Prepared, sidecar: Sidecar, engine: str) -> LinearizationTask:
    """Gather what the linearizations of one model in one engine need."""
    return LinearizationTask(
        system=prepared.system,
        sidecar=sidecar,
        engine=engine,
        equilibria=prepared.equilibria,
        amplitude=prepared.amplitude,
        push=prepared.push,
    )


def load(system: System, sidecar: Sidecar, engine: str) -> tuple[Model, CoordinateMap]:
    """Load a model file and the map between its coordinates and the system's.

    Raises:
        EngineError, SidecarError: naming file, place and remedy.
    """
    model = engines()[engine].load(sidecar.spec(engine))
    return model, coordinate_map(system, sidecar, model.coordinates)


def run_case(task: CaseTask) -> Case:
    """Run and judge one case.

    Raises:
        EngineError, SidecarError, BlownUpError: the case is FAILED with that message.
    """
    began = time.perf_counter()
    model, coordinates = load(task.system, task.sidecar, task.engine)
    motion = task.motion
    claimed = model.exponents(motion.varying)[0]
    batch = Batch.of(motion, task.scale)
    try:
        found = extrapolate(model, coordinates, batch, resolution=task.resolution)
    except BlownUpError as error:
        raise BlownUpError(_warned(str(error), model)) from None
    verdict = judge(found.limit, motion, task.scale, task.components, claimed, task.resolution)
    amplitude = np.maximum(motion.amplitude, FLOOR * task.amplitude)
    study = study_step(
        model, coordinates, motion, power=task.power, amplitude=amplitude, claimed=claimed
    )
    outcome, reason = _with_full_runs(verdict, study, claimed)
    if outcome is Outcome.FAILED:
        reason = _warned(reason, model)
    return Case(
        system=task.system.name,
        model=task.sidecar.model.name,
        scenario=task.scenario,
        engine=task.engine,
        folder=task.folder,
        outcome=outcome,
        reason=reason,
        verdict=verdict_record(verdict, found, claimed),
        full_run=full_run_record(study, model.step, model.integrator),
        series=series_record(
            motion,
            found,
            study,
            scale=task.scale,
            amplitude=amplitude,
            components=task.components,
        ),
        seconds=time.perf_counter() - began,
    )


def _warned(reason: str, model: Model) -> str:
    """A reason with what the engine warned of: it may know why."""
    return "; the engine warns: ".join((reason, *model.warnings))


def _with_full_runs(verdict: Verdict, study: StepStudy, claimed: int) -> tuple[Outcome, str]:
    if not study.shipped.finite:
        bad = study.shipped.t[~np.isfinite(study.shipped.states).all(axis=1)][0]
        return Outcome.FAILED, (
            f"at the shipped step of {study.shipped.h:g} s the motion is no longer finite at"
            f" t = {bad:.4g} s"
        )
    if study.global_error > BLOWN_UP:
        return Outcome.FAILED, (
            f"at the shipped step of {study.shipped.h:g} s the motion blows up, to"
            f" {study.global_error:.0e} of its amplitude; the step is too coarse for it"
        )
    if verdict.outcome is Outcome.AGREES and not study.converges:
        return Outcome.UNRESOLVED, (
            "every segment agrees, but a run from start to end does not converge to the motion"
            f" (order {study.global_order:.2f} where {claimed} is claimed, global error"
            f" {study.global_error:.1e}, {study.global_residual:.1e} of it left as the step falls):"
            " something is carried from step to step"
        )
    return verdict.outcome, verdict.reason


def run_linearizations(task: LinearizationTask) -> tuple[EngineLinearization, ...]:
    """The engine's linearization about every equilibrium, beside Taylor's."""
    model, coordinates = load(task.system, task.sidecar, task.engine)
    return tuple(
        linearization_record(
            linearize_engine(
                model,
                coordinates,
                equilibrium=e.name,
                position=e.position,
                taylor=e.matrices,
                amplitude=task.amplitude,
                push=task.push,
            )
        )
        for e in task.equilibria
    )
