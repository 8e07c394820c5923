"""Run one case: one model file in one engine and one scenario, from loading to verdict."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import numpy as np
from msgspec import structs

from physics_crosscheck.harness.documents.expanded import has_stand_ins
from physics_crosscheck.harness.engines.protocol import EngineError, LoadedModel
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.jobs.failure import failure_of
from physics_crosscheck.harness.modelfiles.locations import line_of
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.event_runs import lost_contact, phase_spread, study_events
from physics_crosscheck.harness.numerics.forward_dynamics import AccelerationComparison
from physics_crosscheck.harness.numerics.full_run import CompleteRun, why_no_run
from physics_crosscheck.harness.numerics.ladder import EPSILON
from physics_crosscheck.harness.numerics.segments import BlownUpError, Extrapolated, extrapolate
from physics_crosscheck.harness.numerics.step_study import StepStudy, study_step
from physics_crosscheck.harness.numerics.stepping import StepComparison, StepDefects
from physics_crosscheck.harness.records.base import Record, SourceLine
from physics_crosscheck.harness.records.case import Case, CaseKind, SkippedCheck, Stepping
from physics_crosscheck.harness.records.outcome import COARSEST, Outcome
from physics_crosscheck.harness.records.scene import EngineInertia, StateErrors
from physics_crosscheck.harness.results.status import counted, percent
from physics_crosscheck.reference.solving.segments import Motion
from .by_steps import SteppedModel, StepsVerdict, decide_by_steps
from .case_record import (
    SERIES,
    DefectSeries,
    dynamics_record,
    full_run_record,
    segment_defects,
    series_record,
    stepping_record,
    verdict_record,
)
from .planar_step import case_steps
from .poses import case_poses
from .prepare import Prepared, PreparedSystem, PreparedTree
from .scene import body_lines, errors_record, inertia_records
from .task import ModelTask, RefusedError
from .time_step import case_time_step, whole_time_step
from .verdict import (
    CaseJudgement,
    judged,
    with_dynamics,
    with_full_runs,
    with_lost_contact,
    with_spread,
)

MAX_LOSS = 1e-5
"""Largest relative difference that an engine's documented loss of precision excuses."""

POSES_ONLY = "poses only: no link has mass or inertia; 1 kg and 1 kg m^2 stand for each"
"""Reason of a case that tests no masses."""


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

    model: LoadedModel
    map: CoordinateMap
    limits: Extrapolated
    claimed: int


def follow(
    task: ModelTask[Prepared],
    rungs: tuple[int, ...] = (),
    loaded: tuple[LoadedModel, CoordinateMap] | None = None,
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
    time_step = case_time_step(task, model, coordinates)
    parts = {name: check(task, model, coordinates) for name, check in PARTS.items()}
    time_step = whole_time_step(task, time_step)
    inertias = _inertias(task.target, model)
    judged = _judgement(task, (model, coordinates), None if why else motion)
    verdict = _combined(judged.verdict, parts.values())
    study, full_run, series = None, None, None
    if motion is not None and not why:
        study = _study(task, (model, coordinates), motion, judged, verdict)
        if judged.by_steps and not study.full_run_check.conclusive:
            # The steps agree, but the full runs do not converge: segments decide.
            judged = _by_segments(task, (model, coordinates), judged.stepping, judged.dynamics)
            verdict = _combined(judged.verdict, parts.values())
            study = _study(task, (model, coordinates), motion, judged, verdict)
    outcome, reason, kind = verdict.outcome, verdict.reason, verdict.kind
    if why:
        reason = "; ".join(filter(None, (reason, f"no motion from rest: {why}")))
    elif motion is not None and study is not None:
        outcome, reason, kind = with_full_runs(verdict, study, motion, judged.shipped_order)
        if outcome is Outcome.FAILED:
            reason = _with_warnings(reason, task, model)
        full_run = full_run_record(study, model.step, model.integrator)
        series = series_record(
            motion,
            _defects(task, judged, motion),
            study,
            amplitude=task.target.amplitude_of(motion),
            components=task.target.components,
        )
    reason = "; ".join(filter(None, (reason, *judged.model.reservations)))
    is_verdict = outcome is verdict.outcome
    case = structs.replace(
        _case(task, outcome, reason),
        kind=kind,
        locations=next((p.locations for p in parts.values() if p and p.kind == kind), ()),
        **{name: part.record for name, part in parts.items() if part},
        verdict=verdict_record(verdict, judged.limits, judged.order, judged.steps_taken),
        time_step=time_step,
        full_run=full_run,
        series=series,
        by_state=_by_state(task, judged, inertias),
        stepping=judged.stepping_record(task.target.components),
        forward_dynamics=dynamics_record(judged.dynamics, tuple(judged.model.coordinates)),
        skipped=() if task.thorough else tuple(_skipped(judged, study)),
        accepted=_precision_limit(task, model, verdict, parts) if is_verdict else "",
    )
    if has_stand_ins(task.file) and case.outcome is Outcome.AGREES and case.verdict is not None:
        judged_by = structs.replace(case.verdict, decided_by="poses")
        case = structs.replace(case, verdict=judged_by, reason=POSES_ONLY)
    if case.outcome is Outcome.UNRESOLVED:  # a diagnosis names changes only of one that differs
        case = structs.replace(case, reason="; ".join(filter(None, (case.reason, _changes(task)))))
    return structs.replace(case, seconds=time.perf_counter() - began)


def _changes(task: ModelTask[Prepared]) -> str:
    """Return what the engine changes in the file, by a load of its own; "" for nothing."""
    try:
        changes = ", ".join(task.load()[0].corrective_settings)
    except EngineError:
        return ""
    return f"the engine changes the file: {changes}" if changes else ""


def _precision_limit(
    task: ModelTask[Prepared],
    model: LoadedModel,
    verdict: CaseJudgement,
    parts: Mapping[str, CasePart | None],
) -> str:
    """Return the documented loss of precision that causes a motion's whole difference, or ""."""
    limits, off = model.precision_limits, verdict.largest_discrepancy
    if verdict.outcome is not Outcome.DIFFERS or not limits or not off <= MAX_LOSS:
        return ""
    if any(getattr(part.record, "differs", False) for part in parts.values() if part is not None):
        return ""
    settings = {key: value for each in limits.values() for key, value in each.items()}
    try:
        exact = judge(task.with_settings(**settings))
    except (EngineError, BlownUpError):
        return ""
    whose = f"{engines()[task.engine].title}'s own {percent(off)}"
    return f"within {whose}: {'; '.join(limits)}" if exact.outcome is Outcome.AGREES else ""


def _inertias(target: Prepared, model: LoadedModel) -> tuple[EngineInertia, ...]:
    """Return the inertia of an engine's bodies, for pictures; nothing for declared energies."""
    if not isinstance(target, PreparedTree) or target.record.scene is None:
        return ()
    return inertia_records(target.tree, target.record.scene.bodies, model.inertias)


def _by_state(
    task: ModelTask[Prepared], judged: _Judgement, inertias: tuple[EngineInertia, ...]
) -> StateErrors | None:
    """Return the errors of bodies at each state, for pictures; None for declared energies."""
    target = task.target
    if not isinstance(target, PreparedTree):
        return None
    segments, scene, apart = target.segments(task.scenario), target.record.scene, None
    if judged.limits is None:
        assert judged.stepping is not None  # single steps decide
        defects = judged.stepping.defects
    else:
        apart = judged.limits.limit.value - segments.end
        uncertainty = (judged.limits.limit.uncertainty + segments.bound) / segments.unit
        defects = StepDefects(defect=np.abs(apart) / segments.unit, uncertainty=uncertainty)
    record = errors_record(target.tree, segments, target.names, defects, apart, inertias)
    names = [] if scene is None else [body.name for body in scene.bodies]
    return structs.replace(record, lines=body_lines(task.spec.path, names))


def judge(
    task: ModelTask[Prepared], loaded: tuple[LoadedModel, CoordinateMap] | None = None
) -> CaseJudgement:
    """Judge the motion of a model, without a run at the file's own time step.

    Args:
        task: the task.
        loaded: the loaded model and its map, to judge with its own integrator only; None: load
            the file here, and use its accelerations and other integrators too.

    Raises:
        EngineError, SidecarError, BlownUpError: if the engine cannot run it.
    """
    if loaded is not None:
        return _judge_segments(task, loaded)[1]
    return _judgement(task, task.load(), None).verdict


class CasePart(Protocol):
    """The result of a check of a case beside its motion."""

    @property
    def kind(self) -> CaseKind:
        """Kind of a case that differs by it."""

    @property
    def record(self) -> Record:
        """The record in the results."""

    @property
    def locations(self) -> tuple[SourceLine, ...]:
        """Lines of the file that its reason names."""

    def combined(self, verdict: CaseJudgement) -> CaseJudgement:
        """Combine a verdict with this one: a difference in either counts."""


PARTS: Mapping[
    str, Callable[[ModelTask[Prepared], LoadedModel, CoordinateMap], CasePart | None]
] = {
    "poses": case_poses,
    "whole_step": case_steps,
}
"""Every check beside a case's motion, by the field of its record; None if it does not apply."""


def _combined(verdict: CaseJudgement, parts: Iterable[CasePart | None]) -> CaseJudgement:
    """Combine the verdict on a motion with those of the other checks."""
    for part in parts:
        verdict = verdict if part is None else part.combined(verdict)
    return verdict


@dataclass(frozen=True, kw_only=True)
class _Judgement:
    """The verdict on a motion, and the checks behind it."""

    verdict: CaseJudgement
    model: LoadedModel
    order: int
    shipped_order: int
    stepping: StepComparison | None
    dynamics: AccelerationComparison | None
    limits: Extrapolated | None = None
    shipped: Extrapolated | None = None
    by_steps: StepsVerdict | None = None

    @property
    def base_run(self) -> CompleteRun | None:
        """The run at the file's own time step, if single steps needed it."""
        steps = self.by_steps and self.by_steps.motion
        return steps.run if steps else None

    @property
    def steps_taken(self) -> int:
        """Number of engine steps of the check that decides."""
        if self.limits is not None:
            return self.limits.steps
        return self.by_steps.steps if self.by_steps else 0

    def stepping_record(self, components: tuple[str, ...]) -> Stepping | None:
        """Build the record of single steps."""
        return None if self.stepping is None else stepping_record(self.stepping, components)


def _judgement(
    task: ModelTask[Prepared], loaded: tuple[LoadedModel, CoordinateMap], motion: Motion | None
) -> _Judgement:
    """Judge by single steps where they leave no doubt, and by segments otherwise.

    Args:
        motion: the motion of full runs; None without one.
    """
    model, _ = loaded
    compared, stepping, dynamics = stepped_model(task, *loaded), None, None
    if compared is not None:
        states = task.target.states(task.scenario)
        stepping = compared.single_steps(
            *states,
            fastest=task.target.segments(task.scenario).fastest,
            long=task.thorough and isinstance(task.target, PreparedSystem),
        )
        dynamics = compared.accelerations(*states)
    steps = None
    if compared is not None and not task.thorough:
        steps = decide_by_steps(compared, stepping, dynamics, motion)
    if steps is not None:
        order = model.exponents(task.target.segments(task.scenario).varying)[0]
        return _Judgement(
            verdict=steps.verdict,
            model=model,
            order=order,
            shipped_order=order,
            stepping=stepping,
            dynamics=dynamics,
            by_steps=steps,
        )
    judged = _by_segments(task, loaded, stepping, dynamics)
    return _with_steps(task, compared, judged, motion)


def _with_steps(
    task: ModelTask[Prepared],
    compared: SteppedModel | None,
    judged: _Judgement,
    motion: Motion | None,
) -> _Judgement:
    """Let single steps decide what the segments of short numbers leave open, if they do."""
    is_open = judged.verdict.outcome is Outcome.UNRESOLVED
    if compared is None or compared.model.epsilon <= EPSILON or not is_open:
        return judged
    steps = decide_by_steps(compared, judged.stepping, judged.dynamics, motion, COARSEST)
    return judged if steps is None else replace(judged, verdict=steps.verdict)


def stepped_model(
    task: ModelTask[Prepared], model: LoadedModel, coordinates: CoordinateMap
) -> SteppedModel | None:
    """Return the model beside its equations; None if these depend on time."""
    target, stepped = task.target, task.target.stepped
    if stepped is None:
        return None
    return SteppedModel(
        model=model,
        coordinates=coordinates,
        stepped=stepped,
        components=target.components,
        inputs=target.states(task.scenario)[1].shape[1],
        resolution=task.resolution,
        power=target.power(),
    )


def _by_segments(
    task: ModelTask[Prepared],
    loaded: tuple[LoadedModel, CoordinateMap],
    stepping: StepComparison | None,
    dynamics: AccelerationComparison | None,
) -> _Judgement:
    shipped, verdict = _judge_segments(task, loaded)
    followed, verdict = _refined(task, shipped, verdict, dynamics)
    return _Judgement(
        verdict=verdict,
        model=followed.model,
        order=followed.claimed,
        shipped_order=shipped.claimed,
        stepping=stepping,
        dynamics=dynamics,
        limits=followed.limits,
        shipped=shipped.limits,
    )


def _study(
    task: ModelTask[Prepared],
    loaded: tuple[LoadedModel, CoordinateMap],
    motion: Motion,
    judged: _Judgement,
    verdict: CaseJudgement,
) -> StepStudy:
    """Run at the file's own time step and at related steps."""
    amplitude = task.target.amplitude_of(motion)
    if motion.marks is not None:
        return study_events(*loaded, motion, power=task.target.power(), amplitude=amplitude)
    return study_step(
        *loaded,
        motion,
        power=task.target.power(),
        amplitude=amplitude,
        claimed=judged.shipped_order,
        agrees=verdict.outcome is Outcome.AGREES,
        thorough=task.thorough,
        base=judged.base_run,
    )


def _defects(task: ModelTask[Prepared], judged: _Judgement, motion: Motion) -> DefectSeries:
    """Return the defects for plots: of segments, or of the single steps that decide."""
    if isinstance(task.target, PreparedTree):  # judged at sampled states, not along the motion
        none = np.empty((0, len(task.target.components)))
        return DefectSeries(none[:, 0], none, none)
    steps = judged.by_steps and judged.by_steps.motion
    if steps:
        return DefectSeries(*steps.picked(SERIES))
    assert judged.shipped is not None
    return segment_defects(motion, judged.shipped)


def _skipped(judged: _Judgement, study: StepStudy | None) -> Iterator[SkippedCheck]:
    """Yield the checks that did not run, since others decide."""
    steps = judged.by_steps
    if steps is not None:
        reason = f"{counted(steps.steps, 'single step')} of the engine's rule decide"
        yield SkippedCheck(check="segments", reason=reason)
    if study is None:
        return
    if judged.stepping is not None:
        what = "each step of the full run is" if steps else "segments are"
        yield SkippedCheck(check="1000 steps", reason=f"{what} compared")
    if all(run.h >= study.base_run.h for run in study.others):
        reason = "coarser runs show the order and predict the error at dt"
        yield SkippedCheck(check="finer full runs", reason=reason)
    if study.checked is None:
        yield SkippedCheck(check="predicted time step", reason="the full runs predict it")


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


def _judge_segments(
    task: ModelTask[Prepared], loaded: tuple[LoadedModel, CoordinateMap] | None = None
) -> tuple[Followed, CaseJudgement]:
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
    return followed, _with_spread(task, followed, verdict)


def _with_spread(
    task: ModelTask[Prepared], followed: Followed, verdict: CaseJudgement
) -> CaseJudgement:
    """Report a contact that is lost from step to step, or a spread without a limit."""
    motion = task.target.segments(task.scenario)
    if verdict.outcome is Outcome.AGREES or not isinstance(motion, Motion):
        return verdict
    if verdict.outcome is Outcome.UNRESOLVED:
        lost = lost_contact(followed.model, followed.map, motion, verdict.time)
        if lost is not None:
            return with_lost_contact(verdict, lost)
    spread = phase_spread(followed.model, followed.map, motion, verdict.time)
    return verdict if spread is None else with_spread(verdict, spread, task.target.components)


def _refined(
    task: ModelTask[Prepared],
    followed: Followed,
    verdict: CaseJudgement,
    dynamics: AccelerationComparison | None,
) -> tuple[Followed, CaseJudgement]:
    """Refine the verdict with the engine's accelerations, and with another integrator if needed."""
    names = tuple(followed.model.coordinates)
    if isinstance(task.target, PreparedTree) and verdict.outcome is Outcome.UNRESOLVED:
        followed, verdict = _by_another_integrator(task, followed, verdict)
    return followed, with_dynamics(verdict, dynamics, names, task.resolution)


def _by_another_integrator(
    task: ModelTask[Prepared], followed: Followed, verdict: CaseJudgement
) -> tuple[Followed, CaseJudgement]:
    """Judge with another integrator if only that resolves the case; the reason names both.

    A servo that settles within microseconds moves its joint so little that rounding, multiplied by
    the large weights of an extrapolation of order 1, hides the result. Order 4 needs a tenth of
    these weights.
    """
    for name, settings in followed.model.integrators.items():
        other, other_verdict = _judge_segments(task.with_settings(**settings))
        if other_verdict.outcome is not Outcome.UNRESOLVED:
            message = f"stepped by {name}, since by {followed.model.integrator} {verdict.reason}"
            return other, replace(
                other_verdict, reason="; ".join(filter(None, [other_verdict.reason, message]))
            )
    return followed, verdict


def _motion(task: ModelTask[Prepared], model: LoadedModel) -> tuple[Motion | None, str]:
    """Return the motion for full runs, and why it is missing although one is asked for."""
    motion = task.target.motion(task.scenario)
    if isinstance(motion, str):
        return None, motion
    return motion, "" if motion is None else why_no_run(motion.duration, model.step)


def _with_warnings(reason: str, task: ModelTask[Prepared], model: LoadedModel) -> str:
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
