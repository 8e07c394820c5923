"""Records of a case in results.json: the numbers for plots and tables."""

from dataclasses import dataclass

import numpy as np

from physics_crosscheck.harness.numerics.forward_dynamics import (
    AccelerationComparison as FoundDynamics,
)
from physics_crosscheck.harness.numerics.segments import Extrapolated
from physics_crosscheck.harness.numerics.step_study import TARGETS, StepStudy
from physics_crosscheck.harness.numerics.stepping import StepComparison as FoundStepping
from physics_crosscheck.harness.records.base import Numbers, Rows, number, numbers, rounded
from physics_crosscheck.harness.records.case import (
    CheckedStep,
    Convergence,
    EnergySeries,
    ForceTerm,
    ForwardDynamics,
    FullRun,
    Series,
    StepErrors,
    Stepping,
    TargetStep,
    Verdict,
)
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.segments import Motion, even_indices
from .verdict import CaseJudgement as Judgement
from .verdict import component

SERIES = 240
"""Maximum number of samples of a series in results.json, enough for a plot of usual width."""

DIGITS = 12
"""Significant digits of the reference motion and its times, close to its error bound. Plots need
fewer.
"""


def verdict_record(
    judged: Judgement, limits: Extrapolated | None, claimed: int, steps: int
) -> Verdict:
    """Build the record of a verdict.

    Args:
        limits: the segments; None where single steps decide.
        claimed: order that the engine claims.
        steps: number of engine steps.
    """
    return Verdict(
        discrepancy=number(judged.discrepancy),
        uncertainty=number(judged.uncertainty),
        component=judged.component,
        time=number(judged.time),
        largest_discrepancy=number(judged.largest_discrepancy),
        largest_uncertainty=number(judged.largest_uncertainty),
        order=number(judged.order),
        claimed_order=claimed,
        rungs=() if limits is None else tuple(limits.rungs),
        steps=int(steps),
        map_residual=number(judged.map_residual),
        map_uncertainty=number(judged.map_uncertainty),
        resolution=number(judged.resolution),
        decided_by=judged.decided_by,
        excess=number(judged.excess),
    )


def stepping_record(comparison: FoundStepping, components: tuple[str, ...]) -> Stepping:
    """Build the record of a comparison of single steps."""
    judged = comparison.judgement
    return Stepping(
        rule=comparison.rule.name,
        besides=comparison.rule.besides,
        step=number(comparison.step),
        outcome=judged.outcome,
        discrepancy=number(judged.discrepancy),
        uncertainty=number(judged.uncertainty),
        component=components[judged.component],
        digits=number(comparison.digits),
        digits_later=number(comparison.later.digits),
        digits_long=number(comparison.long),
    )


def dynamics_record(
    comparison: FoundDynamics | None, names: tuple[str, ...]
) -> ForwardDynamics | None:
    """Build the record of compared accelerations; `names` are the engine's coordinates."""
    if comparison is None:
        return None
    judged = comparison.judgement
    return ForwardDynamics(
        outcome=judged.outcome,
        discrepancy=number(judged.discrepancy),
        uncertainty=number(judged.uncertainty),
        component=component(names, judged.component),
        states=comparison.states,
        terms=tuple(
            ForceTerm(name=name, discrepancy=number(size))
            for name, size in comparison.force_errors.items()
        ),
    )


def full_run_record(study: StepStudy, time_step: float, integrator: str) -> FullRun:
    """Build the record of a full run: the error at the file's own time step."""
    return FullRun(
        time_step=number(time_step),
        integrator=integrator,
        global_error=number(study.global_error),
        velocity_error=number(study.velocity_error),
        order=number(study.full_run_check.order),
        residual=number(study.full_run_check.residual) if len(study.others) > 1 else None,
        resolved_until=number(study.full_run_check.until),
        decomposition=study.decomposition,
        steps_for=tuple(
            TargetStep(target=target, step=number(step))
            for target, step in zip(TARGETS, study.steps_for, strict=True)
        ),
        checked_step=_checked_step(study),
        energy_error=number(study.base_run.energy),
        constraint_drift=number(study.base_run.drift),
        events=study.events,
    )


def _checked_step(study: StepStudy) -> CheckedStep | None:
    if study.checked is None:
        return None
    target, step, measured = study.checked
    return CheckedStep(target=float(target), step=float(step), measured=number(measured))


@dataclass(frozen=True)
class DefectSeries:
    """Defects for plots, at P times: of segments, or of single steps.

    Attributes:
        t: start times, (P,), s.
        defect, uncertainty: relative, (P, 2n).
        convergence: convergence of the extrapolation; None for steps.
    """

    t: Array
    defect: Array
    uncertainty: Array
    convergence: Convergence | None = None


def segment_defects(motion: Motion, limits: Extrapolated) -> DefectSeries:
    """Return the defects of the segments of a motion."""
    segments = even_indices(len(motion.t), SERIES)
    defect = (limits.limit.value - motion.end) / motion.unit
    uncertainty = (limits.limit.uncertainty + motion.bound) / motion.unit
    raw = np.sqrt(np.mean(((limits.raw - motion.end) / motion.unit) ** 2, axis=1))
    convergence = Convergence(
        rungs=tuple(limits.rungs),
        h=_row(float(np.mean(motion.lengths)) / np.array(limits.rungs), 6),
        defect=_row(np.max(raw, axis=1), 4),
        increments=_row(limits.limit.increments, 4),
    )
    return DefectSeries(motion.t[segments], defect[segments], uncertainty[segments], convergence)


def series_record(
    motion: Motion,
    defects: DefectSeries,
    study: StepStudy,
    *,
    amplitude: Array,
    components: tuple[str, ...],
) -> Series:
    """Build the series for the plots of a case.

    Args:
        motion: the reference motion.
        defects: the defects of segments or steps.
        study: the full runs.
        amplitude: scale of the global errors, (2n,).
        components: names of the state's components.
    """
    shipped, balance = study.base_run, study.base_run.balance
    picked = even_indices(len(shipped.t), SERIES)
    t = shipped.t[picked]
    return Series(
        t=_row(t, DIGITS),
        components=components,
        reference=_rows(motion.states_at(t).T, DIGITS),
        engine=_rows(shipped.states[picked].T, 6),
        error=_rows(shipped.error[picked].T, 4),
        segment_t=_row(defects.t, 6),
        defect=_rows(defects.defect.T, 3),
        defect_uncertainty=_rows(defects.uncertainty.T, 3),
        convergence=defects.convergence,
        full_runs=_step_errors(study, amplitude),
        energy=None
        if balance is None
        else EnergySeries(
            held=_row(balance.held[picked] - balance.held[0], 5),
            supplied=_row(balance.supplied[picked], 5),
            dissipated=_row(balance.dissipated[picked], 5),
        ),
    )


def _step_errors(study: StepStudy, amplitude: Array) -> StepErrors:
    runs, n = (study.base_run, *study.others), len(amplitude) // 2
    errors = [float(np.max(np.abs(run.error[:, :n]) / amplitude[:n])) for run in runs]
    return StepErrors(
        h=numbers(run.h for run in runs),
        error=rounded(errors, 5),
        seconds=rounded([run.seconds for run in runs], 3),
    )


def _row(values: Array, digits: int) -> Numbers:
    return rounded(values.tolist(), digits)


def _rows(values: Array, digits: int) -> Rows:
    return tuple(_row(row, digits) for row in values)
