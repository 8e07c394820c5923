"""Verdicts from defects: one outcome, the number behind it, and the reason.

The first outcome that applies: ABSENT, FAILED, DIFFERS, UNRESOLVED, AGREES. No tolerance is chosen:
the uncertainty is that of the extrapolation, its rounding and the reference.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from physics_crosscheck.harness.numerics import judgement
from physics_crosscheck.harness.numerics.event_runs import LostContact, PhaseSpread
from physics_crosscheck.harness.numerics.forward_dynamics import EQUALITIES, AccelerationComparison
from physics_crosscheck.harness.numerics.full_run import SampledRun, follows
from physics_crosscheck.harness.numerics.judgement import (
    LimitVerdict,
    UnresolvedReason,
    unresolved_reason,
)
from physics_crosscheck.harness.numerics.ladder import EPSILON, ExtrapolatedLimit
from physics_crosscheck.harness.numerics.residual import Residual
from physics_crosscheck.harness.numerics.segments import Extrapolated
from physics_crosscheck.harness.numerics.step_study import StepStudy
from physics_crosscheck.harness.records.case import CaseKind, DecidedBy, starts_at
from physics_crosscheck.harness.records.outcome import FLOOR, ROUNDED, Outcome
from physics_crosscheck.harness.results.status import counted, percent
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.segments import Motion, Segments


@dataclass(frozen=True, kw_only=True)
class CaseJudgement:
    """The judgement of one case.

    Attributes:
        outcome: see `Outcome`.
        discrepancy: E, the largest defect over the segments, relative to the largest displacement
            of the component over a segment.
        uncertainty: U, on the same scale.
        largest_discrepancy, largest_uncertainty: over all components and segments.
        component: the component they belong to, such as `x` or `theta_dot`.
        time: start of the segment with the largest defect, seconds.
        order: leading order observed in the step study; nan if rounding hides it.
        map_residual, map_uncertainty: largest E and U of the deviation of the engine's coordinates
            from the coordinate map; nan if the map has no redundant coordinates.
        reason: one sentence for each outcome other than AGREES, and for AGREES with a reservation.
        resolution: resolution of the verdict: the requested one, or the one that the engine's
            precision allows.
        kind: kind of the reason for DIFFERS or UNRESOLVED; empty for AGREES.
        decided_by: the check that these numbers come from.
        excess: by how much `component` moves too fast, see `judgement.excess`.
    """

    outcome: Outcome
    discrepancy: float
    uncertainty: float
    largest_discrepancy: float
    largest_uncertainty: float
    component: str
    time: float
    order: float
    map_residual: float
    map_uncertainty: float
    reason: str
    resolution: float
    kind: CaseKind = ""
    decided_by: DecidedBy = "segments"
    excess: float = float("nan")


STILL = 1e-12
"""Share of the largest scale below which a component moves only by rounding."""


def nonzero_scale(sizes: Array) -> Array:
    """Replace zero scales of positions and velocities, (2n,).

    A component that moves only by rounding takes the largest scale of its kind, or 1 if none of
    these moves.
    """
    scales = sizes.copy()
    half = len(scales) // 2
    for part in (slice(0, half), slice(half, None)):
        largest = np.max(scales[part])
        scales[part] = np.where(scales[part] > STILL * largest, scales[part], largest)
    return np.where(scales > 0, scales, 1.0)


def component_scale(motion: Segments, others: Sequence[Segments]) -> Array:
    """Return the scale of each component: its largest displacement over a segment.

    The system's other scenarios give a lower bound. A component that no scenario moves takes the
    largest scale among the positions (or velocities).
    """
    others_scale = np.max([m.movement for m in others], axis=0) if others else motion.movement
    return nonzero_scale(np.maximum(motion.movement, FLOOR * others_scale))


def judged(
    limits: Extrapolated,
    segments: Segments,
    *,
    components: tuple[str, ...],
    coordinates: tuple[str, ...],
    claimed: int,
    resolution: float,
) -> CaseJudgement:
    """Judge extrapolated segments, and their deviation from the coordinate map.

    Args:
        limits: the extrapolated segments.
        segments: the segments in the equations.
        components: names of the state's components, 2n.
        coordinates: names of the engine's coordinates, nz.
        claimed: order that the engine claims.
        resolution: relative discrepancy to resolve.
    """
    held = limits.residual is not None
    verdict = judge(limits.limit, segments, components, claimed, resolution, held)
    if limits.residual is None:
        return verdict
    return with_residual(verdict, limits.residual, segments, coordinates, resolution)


def judge(
    limit: ExtrapolatedLimit,
    segments: Segments,
    names: tuple[str, ...],
    claimed: int,
    resolution: float,
    held: bool = False,
) -> CaseJudgement:
    """Judge the extrapolated segments of one scenario; see `harness.numerics.judgement`.

    `with_residual` judges the deviation of the engine's coordinates from the map. `held` means that
    the engine has more coordinates than the equations.
    """
    scale = segments.unit
    defect = np.abs(limit.value - segments.end) / scale
    # At least the precision of a double: a component at rest at zero has no rounding at all.
    uncertainty = np.maximum((limit.uncertainty + segments.bound) / scale, EPSILON)
    requested, resolution = resolution, judgement.resolvable(limit, scale, resolution)
    judged_limit = judgement.judge(defect, uncertainty, resolution, unresolved_reason(limit))
    time, component = float(segments.t[judged_limit.segment]), names[judged_limit.component]
    place = starts_at(time, judged_limit.segment)
    reason = ""
    if judged_limit.outcome is Outcome.DIFFERS:
        reason = (
            f"{component} is off by {percent(judged_limit.discrepancy)} of its displacement at "
            f"the end of the segment at {place}; the uncertainty there is "
            f"{judged_limit.uncertainty:.1e}"
        )
    elif judged_limit.below_resolution:
        reason = _below(component, place, judged_limit, resolution)
    elif judged_limit.unresolved_reason is not None:
        why = _why_coarse(limit, judged_limit, held)
        reason = _unresolved(judged_limit, limit, place, component, claimed, requested, why)
    elif judged_limit.largest_uncertainty > requested:
        reason = short_numbers(limit.epsilon, judged_limit.largest_uncertainty, requested)
    return CaseJudgement(
        outcome=judged_limit.outcome,
        discrepancy=judged_limit.discrepancy,
        uncertainty=judged_limit.uncertainty,
        largest_discrepancy=judged_limit.largest_discrepancy,
        largest_uncertainty=judged_limit.largest_uncertainty,
        component=component,
        time=time,
        order=limit.order,
        map_residual=float("nan"),
        map_uncertainty=float("nan"),
        reason=reason,
        resolution=resolution,
        kind=_kind(judged_limit, limit),
        excess=_excess(limit, segments, judged_limit),
    )


def _excess(limit: ExtrapolatedLimit, segments: Segments, judged_limit: LimitVerdict) -> float:
    """Return by how much a velocity changes too fast; nan for positions, and without difference."""
    column, n = judged_limit.component, segments.start.shape[1] // 2
    if column < n or judged_limit.outcome is not Outcome.DIFFERS:
        return float("nan")
    start = segments.start[:, column]
    with np.errstate(all="ignore"):
        return judgement.excess(limit.value[:, column] - start, segments.end[:, column] - start)


def with_residual(
    verdict: CaseJudgement,
    residual: Residual,
    segments: Segments,
    names: tuple[str, ...],
    resolution: float,
) -> CaseJudgement:
    """Combine a verdict with that on the residual of the coordinate map, whose reference is zero.

    A model leaves the map if it can move in an extra direction, or if a constraint fails. The
    mapped motion does not show this.

    Args:
        names: names of the engine's coordinates, nz.
    """
    limit, scale = residual.limit, residual.scale
    defect = np.abs(limit.value) / scale
    uncertainty = np.maximum(limit.uncertainty / scale, EPSILON)
    resolution = judgement.resolvable(limit, scale, resolution)
    judged_limit = judgement.judge(defect, uncertainty, resolution, None)
    component = (*names, *(f"{name}_dot" for name in names))[judged_limit.component]
    time, segment = float(segments.t[judged_limit.segment]), judged_limit.segment
    residual_verdict = replace(
        verdict,
        map_residual=judged_limit.largest_discrepancy,
        map_uncertainty=judged_limit.largest_uncertainty,
    )
    worse = judged_limit.outcome.severity > verdict.outcome.severity
    if judged_limit.outcome is Outcome.DIFFERS:
        off = float(np.abs(limit.value[segment, judged_limit.component]))
        message = (
            f"engine coordinate {component} leaves the coordinate map by {off:.3g} "
            f"over the segment at {starts_at(time, segment)} (relative "
            f"{judged_limit.discrepancy:.2e}, uncertainty {judged_limit.uncertainty:.1e}); the "
            "model has a degree of freedom that the equations lack, or its "
            "constraint does not hold"
        )
    elif judged_limit.outcome is Outcome.UNRESOLVED:
        message = (
            f"engine coordinate {component} follows the coordinate map within an "
            f"uncertainty of {judged_limit.uncertainty:.1e} near "
            f"{starts_at(time, segment)}, above the requested resolution "
            f"{resolution:.0e}: {_why_coarse(limit, judged_limit, held=True)}"
        )
    elif judged_limit.below_resolution:
        place = starts_at(time, segment)
        message = _below(f"engine coordinate {component}", place, judged_limit, resolution)
    else:
        return residual_verdict
    if not worse:
        return replace(
            residual_verdict, reason="; ".join(part for part in (verdict.reason, message) if part)
        )
    return replace(
        residual_verdict,
        outcome=judged_limit.outcome,
        discrepancy=judged_limit.discrepancy,
        uncertainty=judged_limit.uncertainty,
        largest_discrepancy=max(verdict.largest_discrepancy, judged_limit.largest_discrepancy),
        largest_uncertainty=max(verdict.largest_uncertainty, judged_limit.largest_uncertainty),
        component=component,
        time=time,
        reason=message,
        resolution=resolution,
        kind="coordinate map",
    )


def with_spread(
    verdict: CaseJudgement, spread: PhaseSpread, names: tuple[str, ...]
) -> CaseJudgement:
    """Return the verdict on an event whose outcome depends on its place in a step.

    If that stays as the step falls, no limit exists, and the uncertainty is the spread. If it
    falls, but the extrapolation fails, the motion differs by at least `off`.
    """
    if spread.shrinks and (verdict.outcome is Outcome.DIFFERS or not spread.off):
        return verdict
    name = names[spread.component]
    values = (
        f"after the event at t = {spread.time:.4g} s {name} is {spread.low:.6g} to "
        f"{spread.high:.6g}, by the place of the event in a step; the motion has "
        f"{spread.expected:.6g}"
    )
    differs = spread.shrinks
    return replace(
        verdict,
        outcome=Outcome.DIFFERS if differs else Outcome.UNRESOLVED,
        component=name,
        discrepancy=spread.off if differs else verdict.discrepancy,
        largest_discrepancy=max(spread.off, verdict.largest_discrepancy),
        uncertainty=spread.relative,
        largest_uncertainty=spread.relative,
        reason=values if differs else f"no limit as the time step falls: {values}",
        kind="motion" if differs else "not smooth",
    )


def with_lost_contact(verdict: CaseJudgement, lost: LostContact) -> CaseJudgement:
    """Return the verdict on a motion whose contact opens and closes at every step size."""
    shares = " and ".join(
        f"after {100 * share:.0f} % of the steps of {step:.2g} s"
        for share, step in zip(lost.open, lost.steps, strict=True)
    )
    why = f"the engine loses the contact {lost.name} between steps: it is open {shares}"
    return replace(verdict, reason=f"{why}; {verdict.reason}", kind="not smooth")


def short_numbers(epsilon: float, uncertainty: float, requested: float) -> str:
    """Explain that the engine's numbers have too few digits for the requested resolution."""
    return (
        f"known to {uncertainty:.1e}, above the requested {requested:.0e}: the engine's "
        f"numbers have only {1 - math.log2(epsilon):.0f} binary digits"
    )


def _below(what: str, place: str, judged_limit: LimitVerdict, resolution: float) -> str:
    """Describe a measurable difference that is below the requested resolution."""
    return (
        f"{what} differs at {judged_limit.discrepancy:.0e}, below the requested resolution "
        f"{resolution:.0e} (segment at {place}, uncertainty {judged_limit.uncertainty:.0e})"
    )


def _unresolved(
    judged_limit: LimitVerdict,
    limit: ExtrapolatedLimit,
    place: str,
    component: str,
    claimed: int,
    resolution: float,
    coarse: str,
) -> str:
    if judged_limit.unresolved_reason is UnresolvedReason.STANDS_STILL:
        return "all step sizes returned the same values: the engine did not step"
    if judged_limit.unresolved_reason is UnresolvedReason.DIVERGES:
        return "the extrapolation diverges: the limits at finer steps do not converge"
    if judged_limit.unresolved_reason is UnresolvedReason.WRONG_ORDER:
        return (
            f"the convergence order is {limit.order:.2f} but the engine claims "
            f"{claimed}, so the extrapolation is not trusted"
        )
    if judged_limit.unresolved_reason is UnresolvedReason.DIVERGES_HERE:
        return (
            f"the extrapolation diverges near {place}: the limits at finer steps do "
            "not converge, which is typical of a motion that is not smooth"
        )
    return (
        f"the limit of {component} has an uncertainty of {judged_limit.uncertainty:.1e} "
        f"near {place}, above the requested resolution {resolution:.0e}: {coarse}"
    )


def _kind(judged_limit: LimitVerdict, limit: ExtrapolatedLimit) -> CaseKind:
    """Return the kind of a reason; empty where the case agrees."""
    if judged_limit.outcome is Outcome.DIFFERS:
        return "motion"
    if judged_limit.unresolved_reason is None:
        return ""
    if judged_limit.unresolved_reason is UnresolvedReason.COARSE and _is_rounding(
        limit, judged_limit
    ):
        return "rounding"
    return judged_limit.unresolved_reason.kind


def _is_rounding(limit: ExtrapolatedLimit, judged_limit: LimitVerdict) -> bool:
    """Return whether rounding causes all of the uncertainty."""
    place = judged_limit.segment, judged_limit.component
    return bool(limit.uncertainty[place] <= ROUNDED * limit.rounding[place])


def _why_coarse(limit: ExtrapolatedLimit, judged_limit: LimitVerdict, held: bool) -> str:
    """Return why an uncertainty is above the resolution.

    Args:
        held: whether the engine constrains some coordinates to others.
    """
    if _is_rounding(limit, judged_limit):
        divided = "; an equality divides the last digits of a position by the time step"
        return "rounding allows no better" + (divided if held else "")
    if held:
        return (
            "an equality yields differently at each step size, or the time step is too "
            "coarse for it"
        )
    return "the motion is not smooth there, or the time step is too coarse for it"


BLOWN_UP = 1e6
"""Global error, in amplitudes, above which a run counts as unstable."""


def with_full_runs(
    verdict: CaseJudgement, study: StepStudy, motion: Motion, claimed: int
) -> tuple[Outcome, str, CaseKind]:
    """Return the outcome of a case, its reason and the kind of the reason.

    Both are empty for plain agreement.
    """
    failed, kind = failure(study.base_run, study.global_error, motion)
    if failed:
        return Outcome.FAILED, failed, kind
    if verdict.outcome is not Outcome.AGREES:
        return verdict.outcome, verdict.reason, verdict.kind
    check = study.full_run_check
    if not check.converges and study.events:
        message = (
            "every segment agrees, but full runs do not converge, so an event depends on its place "
            f"in a step; the error is {study.global_error:.1e} at dt = {study.base_run.h:g} s and "
            f"{check.residual:.1e} at {min(run.h for run in study.others):g} s"
        )
        return Outcome.UNRESOLVED, message, "full run"
    if not check.converges:
        message = (
            "every segment agrees, but the full run does not converge to the "
            f"motion: order {check.order:.2f} instead of {claimed}, error "
            f"{study.global_error:.1e}; {check.residual:.1e} of it remains as dt "
            "falls, so the model carries a state from step to step"
        )
        return Outcome.UNRESOLVED, message, "full run"
    if not check.predicted:
        message = (
            f"every segment agrees, but the full run at dt = {study.base_run.h:g} s "
            f"is off by {check.deviation:.1e} from the error that finer steps "
            f"predict, {check.expected:.1e} ± {check.deviation_bound:.1e}; something in the "
            "model depends on dt"
        )
        return Outcome.UNRESOLVED, message, "time step"
    parts = (verdict.reason, _reservation(study, motion, verdict.decided_by))
    return verdict.outcome, "; ".join(part for part in parts if part), verdict.kind


def failure(shipped: SampledRun, global_error: float, motion: Motion) -> tuple[str, CaseKind]:
    """Return why a run at the file's own time step fails, and its kind; "" if it succeeds."""
    h = shipped.h
    if not shipped.finite:
        bad = shipped.t[~np.isfinite(shipped.states).all(axis=1)][0]
        return (
            f"at dt = {h:g} s the motion is no longer finite at t = {bad:.4g} s; choose "
            "a smaller time step",
            "not finite",
        )
    if global_error > BLOWN_UP:
        return (
            f"at dt = {h:g} s the motion blows up, to {global_error:.0e} of its "
            "amplitude; choose a smaller time step",
            "blows up",
        )
    if global_error > 1 and not follows(motion, h):
        return (
            f"dt = {h:g} s is too coarse: {shipped.steps} steps are fewer than two "
            f"per period of the fastest rate, {motion.fastest:.3g} rad/s; the error "
            f"is {global_error:.0%} of the amplitude, so choose a smaller time step",
            "too coarse",
        )
    return "", ""


def _reservation(study: StepStudy, motion: Motion, decided_by: DecidedBy) -> str:
    """Describe how far full runs confirm an agreement, if the motion allows only part of it."""
    check = study.full_run_check
    if not check.partly_chaotic:
        return ""
    if check.until <= 0:
        return (
            f"the {decided_by} alone decide; the steps tried are too coarse for a full "
            f"run of this motion, which multiplies differences by {check.growth:.1g}"
        )
    return (
        f"a full run confirms it until t = {check.until:.3g} s of "
        f"{motion.duration:.3g} s; after that the motion is chaotic (differences "
        f"grow {check.growth:.1g} times), and the {decided_by} alone decide"
    )


def motions_in_words(verdict: CaseJudgement) -> str:
    """Describe the verdict on motions beside another check that differs."""
    if verdict.outcome is Outcome.AGREES:
        return f"all {verdict.decided_by} agree within {verdict.largest_uncertainty:.1e}"
    return f"its motions: {verdict.reason}"


def with_dynamics(
    verdict: CaseJudgement,
    comparison: AccelerationComparison | None,
    names: tuple[str, ...],
    resolution: float,
) -> CaseJudgement:
    """Combine the verdict on motions with the one on accelerations: a difference in either counts.

    Accelerations need no time step, so they decide where stiff motions are unresolved. They do not
    decide where the step study has another fault, such as a convergence order that differs from the
    claimed one. Such a fault does not come from the model.

    Args:
        verdict: the verdict on motions.
        comparison: the comparison of accelerations; None if the engine exposes none.
        names: names of the engine's coordinates, nz.
        resolution: relative discrepancy to resolve.
    """
    if comparison is None or verdict.outcome is Outcome.DIFFERS:
        return verdict
    judged = comparison.judgement
    by_accelerations = partial(
        decided,
        verdict,
        judged,
        by="accelerations",
        component=component(names, judged.component),
        resolution=resolution,
    )
    if judged.outcome is Outcome.DIFFERS:
        reason = _apart(comparison, names, resolution, verdict)
        differing = by_accelerations(kind="acceleration", reason=reason)
        return replace(differing, excess=comparison.excess)
    stiff = verdict.outcome is Outcome.UNRESOLVED and math.isfinite(verdict.uncertainty)
    if not (stiff and judged.outcome is Outcome.AGREES and comparison.complete):
        return verdict
    resolved = max(judged.largest_discrepancy, judged.largest_uncertainty)
    held = " with soft equalities held exactly" if comparison.holds_equalities else ""
    message = (
        f"its accelerations{held}, at {counted(comparison.states, 'state')}, match the "
        f"equations to {resolved:.1e} of the largest; its motions: {verdict.reason}"
    )
    resolution = max(resolution, judged.largest_uncertainty)
    return by_accelerations(kind="", reason=message, resolution=resolution)


def decided(
    verdict: CaseJudgement,
    judged: LimitVerdict,
    *,
    by: DecidedBy,
    kind: CaseKind,
    component: str,
    reason: str,
    resolution: float,
) -> CaseJudgement:
    """Return the verdict of another check that decides a case, in place of that on motions."""
    return replace(
        verdict,
        outcome=judged.outcome,
        discrepancy=judged.discrepancy,
        uncertainty=judged.uncertainty,
        largest_discrepancy=judged.largest_discrepancy,
        largest_uncertainty=judged.largest_uncertainty,
        component=component,
        time=float("nan"),
        reason=reason,
        resolution=resolution,
        kind=kind,
        decided_by=by,
    )


def component(names: tuple[str, ...], index: int) -> str:
    """Return the name of an acceleration, or of a constrained position for larger indices."""
    return f"{names[index]}_ddot" if index < len(names) else names[index - len(names)]


def _apart(
    comparison: AccelerationComparison,
    names: tuple[str, ...],
    resolution: float,
    verdict: CaseJudgement,
) -> str:
    judged = comparison.judgement
    other = ", ".join(
        name
        for name, size in comparison.force_errors.items()
        if name != EQUALITIES and not size <= resolution
    )
    differing = f"; these of its forces differ: {other}" if other else ""
    moved = motions_in_words(verdict)
    amount = f"off by {percent(judged.discrepancy)} of its largest value"
    if judged.component >= len(names):
        amount = (
            f"off by {judged.discrepancy:.2e} of its range from the position that its "
            "equality demands"
        )
    return (
        f"{component(names, judged.component)} is {amount};"
        f" the uncertainty is {judged.uncertainty:.1e}{differing}; {moved}"
    )
