"""Check of a verdict by full runs, which can weaken an agreement but never create one."""

from __future__ import annotations

import numpy as np

from physics_crosscheck.harness.checks.verdict import Verdict
from physics_crosscheck.harness.numerics.full_run import SampledRun, follows
from physics_crosscheck.harness.numerics.step_study import StepStudy
from physics_crosscheck.harness.records.case import CaseKind
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.reference.solving.motion import Motion

BLOWN_UP = 1e6
"""Global error, in amplitudes, above which a run counts as unstable."""


def with_full_runs(
    verdict: Verdict, study: StepStudy, motion: Motion, claimed: int
) -> tuple[Outcome, str, CaseKind]:
    """Return the outcome of a case, its reason and the kind of the reason.

    Both are empty for plain agreement.
    """
    failed = failure(study.base_run, study.global_error, motion)
    if failed:
        return Outcome.FAILED, failed, _failure_kind(study)
    if verdict.outcome is not Outcome.AGREES:
        return verdict.outcome, verdict.reason, verdict.kind
    check = study.full_run_check
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
    parts = (verdict.reason, _reservation(study, motion))
    return verdict.outcome, "; ".join(part for part in parts if part), verdict.kind


def failure(shipped: SampledRun, global_error: float, motion: Motion) -> str:
    """Return why a run at the file's own time step fails; "" if it succeeds."""
    h = shipped.h
    if not shipped.finite:
        bad = shipped.t[~np.isfinite(shipped.states).all(axis=1)][0]
        return (
            f"at dt = {h:g} s the motion is no longer finite at t = {bad:.4g} s; choose "
            "a smaller time step"
        )
    if global_error > BLOWN_UP:
        return (
            f"at dt = {h:g} s the motion blows up, to {global_error:.0e} of its "
            "amplitude; choose a smaller time step"
        )
    if global_error > 1 and not follows(motion, h):
        return (
            f"dt = {h:g} s is too coarse: {shipped.steps} steps are fewer than two "
            f"per period of the fastest rate, {motion.fastest:.3g} rad/s; the error "
            f"is {global_error:.0%} of the amplitude, so choose a smaller time step"
        )
    return ""


def _failure_kind(study: StepStudy) -> CaseKind:
    """Return the kind of that failure."""
    if not study.base_run.finite:
        return "not finite"
    return "blows up" if study.global_error > BLOWN_UP else "too coarse"


def _reservation(study: StepStudy, motion: Motion) -> str:
    """Describe how far full runs confirm an agreement, if the motion allows only part of it."""
    check = study.full_run_check
    if not check.partly_chaotic:
        return ""
    if check.until <= 0:
        return (
            "the segments alone decide; the steps tried are too coarse for a full "
            f"run of this motion, which multiplies differences by {check.growth:.1g}"
        )
    return (
        f"a full run confirms it until t = {check.until:.3g} s of "
        f"{motion.duration:.3g} s; after that the motion is chaotic (differences "
        f"grow {check.growth:.1g} times), and the segments alone decide"
    )
