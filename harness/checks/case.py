"""Run one case: one model file in one engine and one scenario, from loading to verdict."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path

from msgspec import structs

from physics_crosscheck.harness.checks.case_record import (
    dynamics_record,
    full_run_record,
    series_record,
    stepping_record,
    verdict_record,
)
from physics_crosscheck.harness.checks.poses import PoseCheck, check_bodies, with_poses
from physics_crosscheck.harness.checks.prepare import Prepared, PreparedSystem, PreparedTree
from physics_crosscheck.harness.checks.task import ModelTask, RefusedError
from physics_crosscheck.harness.checks.verdict import Verdict, judged, with_dynamics, with_full_runs
from physics_crosscheck.harness.engines.protocol import Model
from physics_crosscheck.harness.jobs.failure import failure_of
from physics_crosscheck.harness.modelfiles.locations import line_of
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.forward_dynamics import (
    AccelerationComparison,
    forward_dynamics,
    mixed,
)
from physics_crosscheck.harness.numerics.full_run import why_no_run
from physics_crosscheck.harness.numerics.segments import BlownUpError, Extrapolated, extrapolate
from physics_crosscheck.harness.numerics.step_study import study_step
from physics_crosscheck.harness.numerics.stepping import step_engine
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.case import Case, Stepping
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.reference.solving.segments import Motion


class StepError(ValueError):
    """A time step in the model file that cannot be run; the message gives file, place and
    remedy.
    """

    kind = "long step"


@dataclass(frozen=True, kw_only=True)
class Followed:
    """Segments of a scenario in an engine.

    Attributes:
        model: the loaded model.
        map: map from the equations' coordinates to the engine's.
        limits: ends of the segments in the engine as h -> 0.
        claimed: order that the engine claims.
    """

    model: Model
    map: CoordinateMap
    limits: Extrapolated
    claimed: int


def follow(
    task: ModelTask[Prepared],
    rungs: tuple[int, ...] = (),
    loaded: tuple[Model, CoordinateMap] | None = None,
) -> Followed:
    """Run every segment in the engine as h -> 0.

    Args:
        task: the task.
        rungs: rungs of the step study; empty: as many as needed.
        loaded: the loaded model and its map; None: load the file here.

    Raises:
        EngineError, SidecarError, BlownUpError: naming the file.
    """
    model, coordinates = loaded or task.load()
    segments = task.target.segments(task.scenario)
    try:
        if rungs:
            limits = extrapolate(model, coordinates, segments, rungs=rungs)
        else:
            limits = extrapolate(model, coordinates, segments, resolution=task.resolution)
    except BlownUpError as error:
        raise BlownUpError(_with_warnings(str(error), task, model)) from None
    claimed = model.exponents(segments.varying)[0]
    return Followed(model=model, map=coordinates, limits=limits, claimed=claimed)


def run_case(task: ModelTask[Prepared]) -> Case:
    """Run and judge one case.

    A robot file that an engine refuses becomes a REFUSED case, since other engines may judge it.

    Raises:
        EngineError, SidecarError, BlownUpError, StepError: the case is then FAILED with that
            message.
    """
    began = time.perf_counter()
    try:
        model, coordinates = task.load()
    except RefusedError as error:
        refusal = failure_of(error)
        return structs.replace(
            _case(task, Outcome.REFUSED, refusal.about(task.file)),
            locations=refusal.locations,
            kind=refusal.kind,
            seconds=time.perf_counter() - began,
        )
    motion, why = _motion(task, model)
    if why and isinstance(task.target, PreparedSystem):
        raise StepError(f"{_place_of_step(task)}: {why}")
    # Now: some engines unload this model when another one is loaded.
    poses = _poses(task, model, coordinates)
    shipped, verdict = _judged(task, (model, coordinates))
    stepping = _stepping(task, shipped)  # with the integrator that the file selects
    followed, verdict, dynamics = _decided(task, shipped, verdict)
    if poses is not None:
        verdict = with_poses(verdict, poses)
    outcome, reason, kind = verdict.outcome, verdict.reason, verdict.kind
    full_run, series = None, None
    if why:
        reason = "; ".join(filter(None, (reason, f"no motion from rest: {why}")))
    elif motion is not None:
        amplitude = task.target.amplitude_of(motion)
        study = study_step(
            model,
            coordinates,
            motion,
            power=task.target.power(),
            amplitude=amplitude,
            claimed=shipped.claimed,
            agrees=outcome is Outcome.AGREES,
        )
        outcome, reason, kind = with_full_runs(verdict, study, motion, shipped.claimed)
        if outcome is Outcome.FAILED:
            reason = _with_warnings(reason, task, model)
        full_run = full_run_record(study, model.step, model.integrator)
        if isinstance(task.target, PreparedSystem):
            series = series_record(
                motion,
                shipped.limits,
                study,
                amplitude=amplitude,
                components=task.target.components,
            )
    reason = "; ".join(filter(None, (reason, *followed.model.reservations)))
    return structs.replace(
        _case(task, outcome, reason),
        kind=kind,
        locations=_lines(task, poses) if kind == "pose" and poses is not None else (),
        poses=None if poses is None else poses.record,
        verdict=verdict_record(verdict, followed.limits, followed.claimed),
        full_run=full_run,
        series=series,
        stepping=stepping,
        forward_dynamics=dynamics_record(dynamics, tuple(followed.model.coordinates)),
        seconds=time.perf_counter() - began,
    )


def judge(task: ModelTask[Prepared], loaded: tuple[Model, CoordinateMap] | None = None) -> Verdict:
    """Judge every segment, without a run at the file's own time step.

    Args:
        task: the task.
        loaded: the loaded model and its map, to judge with its own integrator only; None: load
            the file here, and use its accelerations and other integrators too.

    Raises:
        EngineError, SidecarError, BlownUpError: if the engine cannot run it.
    """
    if loaded is not None:
        return _judged(task, loaded)[1]
    return _decided(task, *_judged(task))[1]


def _case(task: ModelTask[Prepared], outcome: Outcome, reason: str) -> Case:
    """Return the record of a case without its numbers."""
    return Case(
        system=task.target.record.name,
        model=task.file.name,
        scenario=task.scenario,
        engine=task.engine,
        folder=str(task.target.place),
        outcome=outcome,
        reason=reason,
    )


def _judged(
    task: ModelTask[Prepared], loaded: tuple[Model, CoordinateMap] | None = None
) -> tuple[Followed, Verdict]:
    """Run every segment in the engine, and derive the verdict."""
    followed = follow(task, loaded=loaded)
    verdict = judged(
        followed.limits,
        task.target.segments(task.scenario),
        components=task.target.components,
        coordinates=tuple(followed.model.coordinates),
        claimed=followed.claimed,
        resolution=task.resolution,
    )
    return followed, verdict


def _decided(
    task: ModelTask[Prepared], followed: Followed, verdict: Verdict
) -> tuple[Followed, Verdict, AccelerationComparison | None]:
    """Refine the verdict with the engine's accelerations, and with another integrator if needed."""
    dynamics, names = _dynamics(task, followed), tuple(followed.model.coordinates)
    if isinstance(task.target, PreparedTree) and verdict.outcome is Outcome.UNRESOLVED:
        followed, verdict = _by_another_integrator(task, followed, verdict)
    return followed, with_dynamics(verdict, dynamics, names, task.resolution), dynamics


def _by_another_integrator(
    task: ModelTask[Prepared], followed: Followed, verdict: Verdict
) -> tuple[Followed, Verdict]:
    """Judge with another integrator if only that resolves the case; the reason names both.

    A servo that settles within microseconds moves its joint so little that rounding, multiplied by
    the large weights of an extrapolation of order 1, hides the result. Order 4 needs a tenth of
    these weights.
    """
    for name, settings in followed.model.integrators.items():
        other, other_verdict = _judged(task.with_settings(**settings))
        if other_verdict.outcome is not Outcome.UNRESOLVED:
            message = f"stepped by {name}, since by {followed.model.integrator} {verdict.reason}"
            return other, replace(
                other_verdict, reason="; ".join(filter(None, [other_verdict.reason, message]))
            )
    return followed, verdict


def _poses(task: ModelTask[Prepared], model: Model, coordinates: CoordinateMap) -> PoseCheck | None:
    """Compare the poses of a robot file's bodies; those of a folder's model are audited."""
    if task.sidecar is not None or not isinstance(task.target, PreparedTree):
        return None
    return check_bodies(task.target, model, coordinates)


def _lines(task: ModelTask[Prepared], poses: PoseCheck) -> tuple[SourceLine, ...]:
    """Return the lines of the bodies that are elsewhere."""
    assert isinstance(task.target, PreparedTree)
    lines, names = task.target.lines, (name for one in poses.findings for name in one.frames)
    return tuple(
        SourceLine(file=str(task.file), line=lines[name]) for name in names if lines.get(name)
    )


def _motion(task: ModelTask[Prepared], model: Model) -> tuple[Motion | None, str]:
    """Return the motion for full runs, and why it is missing although one is asked for."""
    motion = task.target.motion(task.scenario)
    if isinstance(motion, str):
        return None, motion
    return motion, "" if motion is None else why_no_run(motion.duration, model.step)


def _stepping(task: ModelTask[Prepared], followed: Followed) -> Stepping | None:
    """Compare single steps of the engine."""
    target, stepped = task.target, task.target.stepped
    if stepped is None:
        return None
    stepping = step_engine(
        followed.model,
        followed.map,
        stepped,
        *target.states(task.scenario),
        task.resolution,
        fastest=target.segments(task.scenario).fastest,
        long=isinstance(target, PreparedSystem),
    )
    return None if stepping is None else stepping_record(stepping, target.components)


def _dynamics(task: ModelTask[Prepared], followed: Followed) -> AccelerationComparison | None:
    """Compare the engine's accelerations at those states, and at further states in the same
    positions.
    """
    stepped = task.target.stepped
    if stepped is None:
        return None
    states, inputs = mixed(*task.target.states(task.scenario))
    return forward_dynamics(followed.model, followed.map, stepped, states, inputs, task.resolution)


def _with_warnings(reason: str, task: ModelTask[Prepared], model: Model) -> str:
    """Add the file's name and the engine's warnings, which may explain the failure, to a reason."""
    return "; the engine warns: ".join((f"{task.file}: {reason}", *model.warnings))


def _place_of_step(task: ModelTask[Prepared]) -> SourceLine:
    """Return where the time step of a model is set: a line of its sidecar, or the model file."""
    sidecar, engine = task.declared, task.engine
    if "step" not in task.spec.settings:
        return SourceLine(file=str(task.file))
    is_set = engine in sidecar.engine_settings and "step" in sidecar.engine_settings[engine]
    file = Path(f"{task.file}.toml")
    address = f"settings.{engine}.step" if is_set else "settings.step"
    return SourceLine(file=str(file), line=line_of(file, address))
