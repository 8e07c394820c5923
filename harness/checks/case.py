"""Run one case: one model file in one engine and one scenario, from loading to verdict."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.checks.accelerations import with_dynamics
from physics_crosscheck.harness.checks.case_record import (
    dynamics_record,
    full_run_record,
    linearization_record,
    series_record,
    stepping_record,
    verdict_record,
)
from physics_crosscheck.harness.checks.full_run_check import with_full_runs
from physics_crosscheck.harness.checks.prepare import Equilibrium, Prepared
from physics_crosscheck.harness.checks.verdict import judged
from physics_crosscheck.harness.engines.protocol import Model
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.locations import line_of
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.numerics.batch import Batch, even_indices, over
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap, coordinate_map
from physics_crosscheck.harness.numerics.discrete import MAX_PERTURBATION, linearize_step
from physics_crosscheck.harness.numerics.forward_dynamics import (
    AccelerationComparison,
    forward_dynamics,
    mixed,
)
from physics_crosscheck.harness.numerics.full_run import why_no_run
from physics_crosscheck.harness.numerics.linearization import linearize_engine
from physics_crosscheck.harness.numerics.segments import BlownUpError, extrapolate
from physics_crosscheck.harness.numerics.step_study import study_step
from physics_crosscheck.harness.numerics.stepping import step_engine
from physics_crosscheck.harness.numerics.stops import stopped
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.case import Case, CaseId, Stepping
from physics_crosscheck.harness.records.model import EngineLinearization
from physics_crosscheck.harness.records.outcome import FLOOR, Outcome
from physics_crosscheck.reference.mechanism.numeric import Array, NumericFunction
from physics_crosscheck.reference.mechanism.system import System
from physics_crosscheck.reference.solving.motion import Motion
from physics_crosscheck.reference.solving.next_state import SteppedEquations

STEPPED = 100
"""Maximum number of states of a motion from which single steps are taken."""


class StepError(ValueError):
    """A time step in the model file that cannot be run; the message gives file, place and
    remedy.
    """

    kind = "long step"


@dataclass(frozen=True, kw_only=True)
class CaseTask:
    """The inputs that a worker needs for one case; `folder` is the system folder."""

    folder: str
    system: System
    sidecar: Sidecar
    engine: str
    scenario: str
    motion: Motion
    scale: Array
    amplitude: Array
    power: NumericFunction
    stepped: SteppedEquations | None
    components: tuple[str, ...]
    resolution: float

    @property
    def id(self) -> CaseId:
        """Name of the case."""
        return CaseId(
            system=self.system.name,
            model=self.sidecar.model.name,
            scenario=self.scenario,
            engine=self.engine,
        )


@dataclass(frozen=True, kw_only=True)
class LinearizationTask:
    """The inputs that a worker needs for the linearizations of one model in one engine."""

    system: System
    sidecar: Sidecar
    engine: str
    equilibria: tuple[Equilibrium, ...]
    amplitude: Array
    push: Array
    stepped: SteppedEquations | None
    resolution: float


def case_task(
    prepared: Prepared, sidecar: Sidecar, engine: str, scenario: str, resolution: float
) -> CaseTask:
    """Build the task of one case from its prepared system."""
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
        stepped=prepared.stepped,
        components=prepared.components,
        resolution=resolution,
    )


def linearization_task(
    prepared: Prepared, sidecar: Sidecar, engine: str, resolution: float
) -> LinearizationTask:
    """Build the task for the linearizations of one model in one engine."""
    return LinearizationTask(
        system=prepared.system,
        sidecar=sidecar,
        engine=engine,
        equilibria=prepared.equilibria,
        amplitude=prepared.amplitude,
        push=prepared.push,
        stepped=prepared.stepped,
        resolution=resolution,
    )


def load(system: System, sidecar: Sidecar, engine: str) -> tuple[Model, CoordinateMap]:
    """Load a model file, and build the map between its coordinates and the system's.

    Raises:
        EngineError, SidecarError: naming file, place and remedy.
    """
    model = engines()[engine].load(sidecar.spec(engine))
    return model, coordinate_map(system, sidecar, model.coordinates)


def run_case(task: CaseTask) -> Case:
    """Run and judge one case.

    Raises:
        EngineError, SidecarError, BlownUpError, StepError: the case is then FAILED with that
            message.
    """
    began = time.perf_counter()
    model, coordinates = load(task.system, task.sidecar, task.engine)
    motion = task.motion
    if why := why_no_run(motion.duration, model.step):
        raise StepError(f"{_place_of_step(task.sidecar, task.engine)}: {why}")
    claimed = model.exponents(motion.varying)[0]
    batch = Batch.of_motion(motion, task.scale)
    try:
        limits = extrapolate(model, coordinates, batch, resolution=task.resolution)
    except BlownUpError as error:
        raise BlownUpError(_told(str(error), task.sidecar, model)) from None
    verdict = judged(
        limits,
        motion,
        scale=task.scale,
        components=task.components,
        coordinates=tuple(model.coordinates),
        claimed=claimed,
        resolution=task.resolution,
    )
    dynamics = _dynamics(task, model, coordinates)
    verdict = with_dynamics(verdict, dynamics, tuple(model.coordinates), task.resolution)
    amplitude = np.maximum(motion.amplitude, FLOOR * task.amplitude)
    study = study_step(
        model,
        coordinates,
        motion,
        power=task.power,
        amplitude=amplitude,
        claimed=claimed,
        agrees=verdict.outcome is Outcome.AGREES,
    )
    outcome, reason, kind = with_full_runs(verdict, study, motion, claimed)
    if outcome is Outcome.FAILED:
        reason = _told(reason, task.sidecar, model)
    return Case(
        system=task.system.name,
        model=task.sidecar.model.name,
        scenario=task.scenario,
        engine=task.engine,
        folder=task.folder,
        outcome=outcome,
        reason="; ".join(filter(None, (reason, *model.reservations))),
        kind=kind,
        verdict=verdict_record(verdict, limits, claimed),
        full_run=full_run_record(study, model.step, model.integrator),
        series=series_record(
            motion,
            limits,
            study,
            scale=task.scale,
            amplitude=amplitude,
            components=task.components,
        ),
        stepping=_stepping(task, model, coordinates),
        forward_dynamics=dynamics_record(dynamics, tuple(model.coordinates)),
        seconds=time.perf_counter() - began,
    )


def _stepping(task: CaseTask, model: Model, coordinates: CoordinateMap) -> Stepping | None:
    """Compare single steps of the engine, from states spread over the motion."""
    if task.stepped is None:
        return None
    states = _passed(task.motion)
    stepping = step_engine(
        model,
        coordinates,
        task.stepped,
        *states,
        task.resolution,
        fastest=task.motion.fastest,
        long=True,
    )
    return None if stepping is None else stepping_record(stepping, task.components)


def _dynamics(
    task: CaseTask, model: Model, coordinates: CoordinateMap
) -> AccelerationComparison | None:
    """Compare the engine's accelerations at those states, and at further states in the same
    positions.
    """
    if task.stepped is None:
        return None
    states, inputs = mixed(*_passed(task.motion))
    return forward_dynamics(model, coordinates, task.stepped, states, inputs, task.resolution)


def _passed(motion: Motion) -> tuple[Array, Array]:
    """Select states spread over a motion, (B, 2n), and the inputs there, (B, m)."""
    rows = even_indices(len(motion.t), STEPPED)
    return motion.start[rows], over(motion.inputs, motion.t, motion.lengths)(rows, 1)[:, 0]


def _told(reason: str, sidecar: Sidecar, model: Model) -> str:
    """Add the file's name and the engine's warnings, which may explain the failure, to a reason."""
    return "; the engine warns: ".join((f"{sidecar.model}: {reason}", *model.warnings))


def _place_of_step(sidecar: Sidecar, engine: str) -> SourceLine:
    """Return where the time step of a model is set: a line of its sidecar, or the model file."""
    if "step" not in sidecar.spec(engine).settings:
        return SourceLine(file=str(sidecar.model))
    is_set = engine in sidecar.engine_settings and "step" in sidecar.engine_settings[engine]
    file = Path(f"{sidecar.model}.toml")
    address = f"settings.{engine}.step" if is_set else "settings.step"
    return SourceLine(file=str(file), line=line_of(file, address))


def run_linearizations(task: LinearizationTask) -> tuple[EngineLinearization, ...]:
    """Linearize the engine's model about each equilibrium, and compare with Taylor's series.

    There is no linearization where a joint limit acts near the equilibrium, such as a spring that
    presses a joint against its limit.
    """
    model, coordinates = load(task.system, task.sidecar, task.engine)
    moved = 2 * MAX_PERTURBATION * np.minimum(task.amplitude[: coordinates.back.size], 1.0)
    return tuple(
        _linearization(task, model, coordinates, e)
        for e in task.equilibria
        if not stopped(model, coordinates, e.position, moved)
    )


def _linearization(
    task: LinearizationTask, model: Model, coordinates: CoordinateMap, about: Equilibrium
) -> EngineLinearization:
    """Linearize in the limit of a zero step, and for one step at the file's own time step."""
    one_step = linearize_step(
        model,
        coordinates,
        task.stepped,
        position=about.position,
        taylor=about.matrices,
        amplitude=task.amplitude,
        push=task.push,
        resolution=task.resolution,
    )
    linearization = linearize_engine(
        model,
        coordinates,
        equilibrium=about.name,
        position=about.position,
        taylor=about.matrices,
        amplitude=task.amplitude,
        push=task.push,
        resolution=task.resolution,
    )
    return linearization_record(linearization, one_step)
