"""What full runs say of a case that its segments have judged: they can take away, not give."""

from __future__ import annotations

import numpy as np

from physics_crosscheck.harness.cases.verdict import Verdict
from physics_crosscheck.harness.numerics.full_run import SampledRun, follows
from physics_crosscheck.harness.numerics.step_study import StepStudy
from physics_crosscheck.harness.records.case import CaseKind
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.reference.motion import Motion

BLOWN_UP = 1e6
"""Global errors beyond so many amplitudes are an instability that ran out of time, not accuracy."""


def with_full_runs(
    verdict: Verdict, study: StepStudy, motion: Motion, claimed: int
) -> tuple[Outcome, str, CaseKind]:
    """Return the outcome of a case, its reason and the kind of the reason.

    Both are empty for plain agreement.
    """
    failed = failure(study.shipped, study.global_error, motion)
    if failed:
        return Outcome.FAILED, failed, _failure_kind(study)
    if verdict.outcome is not Outcome.AGREES:
        return verdict.outcome, verdict.reason, verdict.kind
    found = study.witness
    if not found.bears_out:
        told = (
            "every segment agrees, but a run from start to end does not converge to the motion"
            f" (order {found.order:.2f} where {claimed} is claimed, global error"
            f" {study.global_error:.1e}, {found.residual:.1e} of it left as the step falls):"
            " something is carried from step to step"
        )
        return Outcome.UNRESOLVED, told, "full run"
    if not found.foretold:
        told = (
            f"every segment agrees, but the run at the shipped step of {study.shipped.h:g} s is not"
            f" what finer steps foretell: its error is {found.surprise:.1e} off the"
            f" {found.expected:.1e} that they do, where {found.unsure:.1e} is uncertain: something"
            " depends on the step that it ships with"
        )
        return Outcome.UNRESOLVED, told, "time step"
    parts = (verdict.reason, _reservation(study, motion))
    return verdict.outcome, "; ".join(part for part in parts if part), verdict.kind


def failure(shipped: SampledRun, global_error: float, motion: Motion) -> str:
    """Why a run at the shipped step is none; empty where it is one."""
    h = shipped.h
    if not shipped.finite:
        bad = shipped.t[~np.isfinite(shipped.states).all(axis=1)][0]
        return f"at the shipped step of {h:g} s the motion is no longer finite at t = {bad:.4g} s"
    if global_error > BLOWN_UP:
        return (
            f"at the shipped step of {h:g} s the motion blows up, to {global_error:.0e} of"
            " its amplitude; the step is too coarse for it"
        )
    if global_error > 1 and not follows(motion, h):
        return (
            f"at the shipped step of {h:g} s nothing follows the motion: {shipped.steps} steps are"
            f" less than two a period of its fastest rate, {motion.fastest:.3g} rad/s, and the"
            f" error is {global_error:.0%} of the amplitude; the step is too coarse for it"
        )
    return ""


def _failure_kind(study: StepStudy) -> CaseKind:
    """Return the kind of that failure."""
    if not study.shipped.finite:
        return "not finite"
    return "blows up" if study.global_error > BLOWN_UP else "too coarse"


def _reservation(study: StepStudy, motion: Motion) -> str:
    """How far full runs bear an agreement out, where the motion lets them do so in part alone."""
    found = study.witness
    if not found.excused:
        return ""
    if found.until <= 0:
        return (
            "the segments alone say so: no part of a run from start to end is resolved at the steps"
            " tried, which are coarse for a motion that multiplies differences by"
            f" {found.growth:.1g}"
        )
    return (
        f"a run from start to end bears it out until t = {found.until:.3g} s of"
        f" {motion.duration:.3g} s; beyond, the motion multiplies differences ({found.growth:.1g}"
        " times in all) too much for the steps tried, and the segments alone say so"
    )
