"""Verdicts on accelerations, combined with the verdicts on motions."""

from __future__ import annotations

import math
from dataclasses import replace

from physics_crosscheck.harness.checks.verdict import Verdict
from physics_crosscheck.harness.numerics.forward_dynamics import EQUALITIES, AccelerationComparison
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.results.status import counted


def with_dynamics(
    verdict: Verdict,
    comparison: AccelerationComparison | None,
    names: tuple[str, ...],
    resolution: float,
) -> Verdict:
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
    outcome = comparison.judgement.outcome
    if outcome is Outcome.DIFFERS:
        return _decided(
            verdict, comparison, names, resolution, _apart(comparison, names, resolution, verdict)
        )
    stiff = verdict.outcome is Outcome.UNRESOLVED and math.isfinite(verdict.uncertainty)
    if not (stiff and outcome is Outcome.AGREES and comparison.complete):
        return verdict
    resolved = max(
        comparison.judgement.largest_discrepancy, comparison.judgement.largest_uncertainty
    )
    held = " with soft equalities held exactly" if comparison.holds_equalities else ""
    message = (
        f"its accelerations{held}, at {counted(comparison.states, 'state')}, match the "
        f"equations to {resolved:.1e} of the largest; its motions: {verdict.reason}"
    )
    return _decided(verdict, comparison, names, resolution, message)


def _decided(
    verdict: Verdict,
    comparison: AccelerationComparison,
    names: tuple[str, ...],
    resolution: float,
    reason: str,
) -> Verdict:
    judged = comparison.judgement
    return replace(
        verdict,
        outcome=judged.outcome,
        discrepancy=judged.discrepancy,
        uncertainty=judged.uncertainty,
        largest_discrepancy=judged.largest_discrepancy,
        largest_uncertainty=judged.largest_uncertainty,
        component=component(names, judged.component),
        time=float("nan"),
        reason=reason,
        resolution=resolution,
        kind="acceleration" if judged.outcome is Outcome.DIFFERS else "",
    )


def component(names: tuple[str, ...], index: int) -> str:
    """Return the name of an acceleration, or of a constrained position for larger indices."""
    return f"{names[index]}_ddot" if index < len(names) else names[index - len(names)]


def _apart(
    comparison: AccelerationComparison, names: tuple[str, ...], resolution: float, verdict: Verdict
) -> str:
    judged = comparison.judgement
    other = ", ".join(
        name
        for name, size in comparison.force_errors.items()
        if name != EQUALITIES and not size <= resolution
    )
    differing = f"; these of its forces differ: {other}" if other else ""
    moved = (
        f"every segment agrees within {verdict.largest_uncertainty:.1e}"
        if verdict.outcome is Outcome.AGREES
        else f"its motions: {verdict.reason}"
    )
    amount = f"off by {judged.discrepancy:.2e} of its largest value"
    if judged.component >= len(names):
        amount = (
            f"off by {judged.discrepancy:.2e} of its range from the position that its "
            "equality demands"
        )
    return (
        f"{component(names, judged.component)} is {amount};"
        f" the uncertainty is {judged.uncertainty:.1e}{differing}; {moved}"
    )
