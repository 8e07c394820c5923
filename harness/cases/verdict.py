"""From defects to a verdict: one outcome, the number behind it, and the reason.

The first that applies: ABSENT, FAILED, DIFFERS, UNRESOLVED, AGREES. No tolerance is picked: the
uncertainty is that of the extrapolation, its rounding and the reference.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from harness.numerics import judgement
from harness.numerics.judgement import Judgement, Obstacle, obstacle
from harness.numerics.ladder import EPSILON, Limit
from harness.records.outcome import FLOOR, Outcome
from reference.motion import Motion
from reference.numeric import Array


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """The judgement of one case.

    Attributes:
        outcome: see `Outcome`.
        discrepancy: E, the largest defect over the segments, relative to how far the component
            moves over a segment at most.
        uncertainty: U, likewise.
        largest_discrepancy, largest_uncertainty: over all components and segments.
        component: the component they belong to, such as `x` or `theta_dot`.
        time: start of the segment with the largest defect, seconds.
        order: leading order seen on the segments' rungs; nan where rounding hides it.
        reason: one sentence for whatever is not AGREES.
    """

    outcome: Outcome
    discrepancy: float
    uncertainty: float
    largest_discrepancy: float
    largest_uncertainty: float
    component: str
    time: float
    order: float
    reason: str


def component_scale(motion: Motion, others: list[Motion]) -> Array:
    """What counts as one, per component: how far it moves over a segment at most.

    Floored by the system's other scenarios. A component that no scenario moves takes the largest
    scale among the positions (or velocities).
    """
    reach = np.max([m.movement for m in others], axis=0) if others else motion.movement
    scale: Array = np.maximum(motion.movement, FLOOR * reach)
    half = len(scale) // 2
    for part in (slice(0, half), slice(half, None)):
        scale[part] = np.where(scale[part] > 0, scale[part], np.max(scale[part]))
    return np.where(scale > 0, scale, 1.0)


def judge(
    limit: Limit,
    motion: Motion,
    scale: Array,
    names: tuple[str, ...],
    claimed: int,
    resolution: float,
) -> Verdict:
    """Judge the extrapolated segments of one scenario: `harness.numerics.judgement`."""
    defect = np.abs(limit.value - motion.end) / scale
    # Never below what a double resolves: a component at rest at zero has no rounding at all.
    uncertainty = np.maximum((limit.uncertainty + motion.bound) / scale, EPSILON)
    found = judgement.judge(defect, uncertainty, resolution, obstacle(limit))
    time, component = float(motion.t[found.segment]), names[found.component]
    reason = ""
    if found.outcome is Outcome.DIFFERS:
        reason = (
            f"{component} ends the segment at t = {time:.4g} s"
            f" {found.discrepancy:.2e} of its movement off; the uncertainty there is"
            f" {found.uncertainty:.1e}"
        )
    elif found.obstacle is not None:
        reason = _unresolved(found, limit, time, component, claimed, resolution)
    return Verdict(
        outcome=found.outcome,
        discrepancy=found.discrepancy,
        uncertainty=found.uncertainty,
        largest_discrepancy=found.largest_discrepancy,
        largest_uncertainty=found.largest_uncertainty,
        component=component,
        time=time,
        order=limit.order,
        reason=reason,
    )


def _unresolved(
    found: Judgement, limit: Limit, time: float, component: str, claimed: int, resolution: float
) -> str:
    if found.obstacle is Obstacle.STANDS_STILL:
        return "every rung returned the same values: the engine did not step"
    if found.obstacle is Obstacle.DIVERGES:
        return "the ladder diverges: the limits of finer rungs do not converge"
    if found.obstacle is Obstacle.WRONG_ORDER:
        return (
            f"the exponents don't hold: the rungs fall with order {limit.order:.2f},"
            f" the engine claims {claimed}; no digit of the limit can be trusted"
        )
    if found.obstacle is Obstacle.DIVERGES_HERE:
        return (
            f"the ladder diverges near t = {time:.4g} s: the limits of finer rungs"
            " do not converge, as where a motion is not smooth"
        )
    return (
        f"the limit of {component} is known to {found.uncertainty:.1e} at best, near"
        f" t = {time:.4g} s, where {resolution:.0e} was asked:"
        " the motion is not smooth there, or the step is too coarse for it"
    )
