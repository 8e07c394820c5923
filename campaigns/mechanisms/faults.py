"""Faults planted in the numbers of a mechanism's file, and whether each has a visible effect.

The equations give the effect of a fault, without the harness and the engine: the motion and poses
are solved again with the wrong number. Then the harness judges the faulty file.
"""

from __future__ import annotations

import numpy as np

from campaigns.mechanisms.dynamics import MechanismDynamics, Real
from campaigns.mechanisms.mechanism import MJCF, Path, RandomMechanism, literals, with_fault
from campaigns.mechanisms.results import Detection, MechanismFault
from campaigns.mechanisms.trial import (
    MechanismCase,
    Settings,
    corrective_settings,
    judge_motion,
    loaded,
)
from campaigns.mechanisms.truth import ends
from physics_crosscheck.harness.records.outcome import Outcome

SIZES = (1e-6, 1e-8)

DETECTION_MARGIN = 2.0
"""Effect over uncertainty above which a fault must be detected; limits may be off by 1."""

RESOLUTION = 0.0
"""No tolerance: extrapolate as far as possible; any error above its uncertainty differs."""

POSE_RESOLUTION = 1e-9
"""Smallest resolved change of a pose: of a rotation matrix, or relative to the largest distance."""

POSE_ROUNDING = 1e-15
"""Change of a pose that rounding explains."""


def plant_faults(
    case: MechanismCase, rng: np.random.Generator, count: int
) -> tuple[MechanismFault, ...]:
    """Plant and judge `count` faults one at a time, in different numbers, of both sizes in turn."""
    numbers = literals(case.mechanism)
    # Digits that the engine loses would hide a small fault.
    settings = corrective_settings(case.mechanism)
    chosen = rng.permutation(len(numbers))[:count]
    return tuple(
        judge_fault(
            case, numbers[index], SIZES[turn % len(SIZES)] * float(rng.choice((-1, 1))), settings
        )
        for turn, index in enumerate(chosen)
    )


def judge_fault(
    case: MechanismCase, where: Path, share: float, settings: Settings
) -> MechanismFault:
    """Judge a fault of relative size `share`, with settings for the engine."""
    faulty = with_fault(case.mechanism, where, share)
    motion, right = case.motion, case.truth
    wrong = ends(MechanismDynamics(faulty), motion.t, motion.start, float(motion.lengths[0]))
    change = np.abs(wrong.states - right.states)
    # Errors of the two solutions are not an effect.
    change = np.where(change > 4 * (wrong.error + right.error), change, 0.0).astype(float)
    judgement = judge_motion(case, faulty, RESOLUTION, settings)
    effect = float(np.max(change / case.motion.unit))
    excess = float(np.max(change / judgement.uncertainty))
    pose, engine_pose = _pose_changes(case, faulty, settings)
    error = np.abs(judgement.extrapolated.limit.value - wrong.states).astype(float)
    is_different = judgement.verdict.outcome is Outcome.DIFFERS
    return MechanismFault(
        where=".".join(map(str, where)),
        share=abs(share),
        fate=detection_of(is_different, effect, excess, pose, engine_pose),
        effect=effect,
        excess=excess,
        pose=pose,
        outside=int(np.sum(error > judgement.uncertainty)),
    )


def detection_of(
    is_different: bool, effect: float, excess: float, pose: float, engine_pose: float
) -> Detection:
    """Return whether and how a fault is detected.

    Args:
        is_different: whether the verdict is DIFFERS.
        effect: largest relative change of a segment's end.
        excess: the same over the uncertainty of that end.
        pose, engine_pose: largest changes of a pose, by the equations and in the engine.
    """
    if engine_pose > POSE_RESOLUTION and pose < POSE_RESOLUTION / DETECTION_MARGIN:
        return Detection.FALSE
    if pose > DETECTION_MARGIN * POSE_RESOLUTION and engine_pose < POSE_RESOLUTION:
        return Detection.MISSED
    if is_different:
        return Detection.MOTION if effect > 0 else Detection.FALSE
    if excess > DETECTION_MARGIN:
        return Detection.MISSED
    if pose > POSE_RESOLUTION:
        return Detection.FRAMES
    if effect > 0:
        return Detection.BELOW
    return Detection.FAINT if pose > POSE_ROUNDING else Detection.INVISIBLE


def _pose_changes(
    case: MechanismCase, faulty: RandomMechanism, settings: Settings
) -> tuple[float, float]:
    """Return the largest change of a body's pose at the starts, by the equations and in the engine.

    Positions count relative to the largest distance, rotations by the entries of their matrices.
    """
    n = len(faulty.links)
    starts = case.motion.start[:, :n]
    q: Real = starts.T.astype(np.longdouble)
    right, wrong = (MechanismDynamics(mechanism).poses(q) for mechanism in (case.mechanism, faulty))
    size = np.max(np.abs(right.origins))

    def distance(origins: Real, turns: Real) -> float:
        places = np.max(np.abs(right.origins - origins)) / size
        return float(max(places, np.max(np.abs(right.turns - turns))))

    kind = "body" if faulty.format == MJCF else "link"
    with loaded(faulty, settings) as (model, _):
        poses = model.poses([f"{kind}:body{i + 1}" for i in range(n)], starts)
    engine = (np.moveaxis(array, 0, -1) for array in poses)
    return distance(wrong.origins, wrong.turns), distance(*engine)
