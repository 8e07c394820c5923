"""From defects to a verdict: one outcome, the number behind it, and the reason.

The first that applies: ABSENT, FAILED, DIFFERS, UNRESOLVED, AGREES. No tolerance is picked: the
uncertainty is that of the extrapolation, its rounding and the reference.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from harness.numerics.ladder import EPSILON, Limit
from harness.records.outcome import FLOOR, Outcome
from reference.motion import Motion
from reference.numeric import Array


@dataclass(frozen=True)
class Verdict:
    """The judgement of one case.

    Attributes:
        outcome: see `Outcome`.
        discrepancy: E, the largest defect over the segments, relative to how far the component
            moves over a segment at most.
        uncertainty: U, likewise.
        component: the component they belong to, such as `x` or `theta_dot`.
        time: start of the segment with the largest defect, seconds.
        order: leading order seen on the segments' rungs; nan where rounding hides it.
        reason: one sentence for whatever is not AGREES.
    """

    outcome: Outcome
    discrepancy: float
    uncertainty: float
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
    """Judge the extrapolated segments of one scenario.

    A segment differs where its defect exceeds its own uncertainty; a segment that could not be
    resolved doesn't hide one that was.
    """
    defect = np.abs(limit.value - motion.end) / scale
    # Never below what a double resolves: a component at rest at zero has no rounding at all.
    uncertainty = np.maximum((limit.uncertainty + motion.bound) / scale, EPSILON)
    if not (limit.holds and limit.converges) or float(limit.draws[0]) == 0.0:
        return _no_digit(limit, defect, motion, names, claimed)
    ratio = defect / uncertainty
    component = int(np.argmax(np.max(ratio, axis=0)))
    differing = ratio[:, component] > 1
    if differing.any():
        segment = int(np.argmax(np.where(differing, defect[:, component], -1.0)))
        e, u = float(defect[segment, component]), float(uncertainty[segment, component])
        reason = (
            f"{names[component]} ends the segment at t = {motion.t[segment]:.4g} s"
            f" {e:.2e} of its movement off; the uncertainty there is {u:.1e}"
        )
        outcome = Outcome.DIFFERS
    else:
        largest = np.max(defect, axis=0), np.max(uncertainty, axis=0)
        component = int(np.argmax(largest[0] / largest[1]))
        e, u = float(largest[0][component]), float(largest[1][component])
        segment = int(np.argmax(defect[:, component]))
        outcome, reason = Outcome.AGREES, ""
        worst = float(np.max(uncertainty))
        if worst > resolution:
            where = np.unravel_index(int(np.argmax(uncertainty)), uncertainty.shape)
            outcome = Outcome.UNRESOLVED
            component, segment = int(where[1]), int(where[0])
            e, u = float(largest[0][component]), worst
            reason = (
                f"the ladder diverges near t = {motion.t[segment]:.4g} s: the limits of finer rungs"
                " do not draw together, as where a motion is not smooth"
                if worst == float("inf")
                else f"the limit of {names[component]} is known to {worst:.1e} at best, near"
                f" t = {motion.t[segment]:.4g} s, where {resolution:.0e} was asked:"
                " the motion is not smooth there, or the step is too coarse for it"
            )
    return Verdict(outcome, e, u, names[component], float(motion.t[segment]), limit.order, reason)


def _no_digit(
    limit: Limit, defect: Array, motion: Motion, names: tuple[str, ...], claimed: int
) -> Verdict:
    where = np.unravel_index(int(np.nanargmax(defect)), defect.shape)
    if float(limit.draws[0]) == 0.0:
        reason = "every rung returned the same values: the engine did not step"
    elif not limit.converges:
        reason = "the ladder diverges: the limits of finer rungs do not draw together"
    else:
        reason = (
            f"the exponents don't hold: the rungs fall with order {limit.order:.2f},"
            f" the engine claims {claimed}; no digit of the limit can be trusted"
        )
    return Verdict(
        Outcome.UNRESOLVED,
        float(defect[where]),
        float("inf"),
        names[int(where[1])],
        float(motion.t[int(where[0])]),
        limit.order,
        reason,
    )
