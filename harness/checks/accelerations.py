"""What an engine's accelerations say of a case, beside what its motions say."""

from __future__ import annotations

import math
from dataclasses import replace

from physics_crosscheck.harness.checks.verdict import Verdict
from physics_crosscheck.harness.numerics.forward_dynamics import EQUALITIES, AccelerationComparison
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.results.status import counted


def with_dynamics(
    verdict: Verdict,
    found: AccelerationComparison | None,
    names: tuple[str, ...],
    resolution: float,
) -> Verdict:
    """A verdict on motions with that on accelerations: what differs in either differs.

    Where motions are not resolved since they are stiff, accelerations at every state decide: no
    step is in them. Where a ladder has another fault, such as an order that is not the claimed one,
    they don't: that is no matter of the model.

    Args:
        verdict: on the motions.
        found: None where the engine tells no accelerations.
        names: of the engine's coordinates, nz.
        resolution: that is asked.
    """
    if found is None or verdict.outcome is Outcome.DIFFERS:
        return verdict
    outcome = found.judgement.outcome
    if outcome is Outcome.DIFFERS:
        return _decided(
            verdict, found, names, resolution, _apart(found, names, resolution, verdict)
        )
    stiff = verdict.outcome is Outcome.UNRESOLVED and math.isfinite(verdict.uncertainty)
    if not (stiff and outcome is Outcome.AGREES and found.complete):
        return verdict
    known = max(found.judgement.largest_discrepancy, found.judgement.largest_uncertainty)
    held = " with soft equalities held exactly" if found.holds_equalities else ""
    told = (
        f"its accelerations{held}, at {counted(found.states, 'state')}, match the "
        f"equations to {known:.1e} of the largest; its motions: {verdict.reason}"
    )
    return _decided(verdict, found, names, resolution, told)


def _decided(
    verdict: Verdict,
    found: AccelerationComparison,
    names: tuple[str, ...],
    resolution: float,
    reason: str,
) -> Verdict:
    judged = found.judgement
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
    """Name an acceleration; past these, a position that an equality holds."""
    return f"{names[index]}_ddot" if index < len(names) else names[index - len(names)]


def _apart(
    found: AccelerationComparison, names: tuple[str, ...], resolution: float, verdict: Verdict
) -> str:
    judged = found.judgement
    other = ", ".join(
        name
        for name, size in found.force_errors.items()
        if name != EQUALITIES and not size <= resolution
    )
    differing = f"; these of its forces differ: {other}" if other else ""
    moved = (
        f"every segment agrees within {verdict.largest_uncertainty:.1e}"
        if verdict.outcome is Outcome.AGREES
        else f"its motions: {verdict.reason}"
    )
    of = f"off by {judged.discrepancy:.2e} of its largest value"
    if judged.component >= len(names):
        of = (
            f"off by {judged.discrepancy:.2e} of its range from the position that its "
            "equality demands"
        )
    return (
        f"{component(names, judged.component)} is {of};"
        f" the uncertainty is {judged.uncertainty:.1e}{differing}; {moved}"
    )
