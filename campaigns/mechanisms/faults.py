"""Faults planted in the numbers of a mechanism's file, and whether each can be seen at all.

What a fault does is found without the harness and without the engine: the equations are solved
again with the wrong number, and the bodies posed again. The harness is asked afterwards.
"""

from __future__ import annotations

import numpy as np

from campaigns.mechanisms.dynamics import Dynamics, Real
from campaigns.mechanisms.mechanism import MJCF, Mechanism, Path, literals, with_fault
from campaigns.mechanisms.results import Fate, Planted
from campaigns.mechanisms.trial import Judged, Posed, Settings, examine, loaded, undone
from campaigns.mechanisms.truth import ends
from physics_crosscheck.harness.records.outcome import Outcome

SIZES = (1e-6, 1e-8)

SURE = 2.0
"""A limit may be off by its uncertainty: a fault is sure to be told where it does twice as much."""

RESOLUTION = 0.0
"""Limits are as good as they get, and whatever is larger than its uncertainty differs."""

POSE = 1e-9
"""What frames resolve: of a place, by the largest distance, or of a turn."""

SAME = 1e-15
"""Below it poses are the same but for rounding."""


def plant(posed: Posed, rng: np.random.Generator, count: int) -> tuple[Planted, ...]:
    """Plant so many faults, one at a time, of both sizes in turn, each in another number."""
    numbers = literals(posed.mechanism)
    # What the engine itself loses would hide a small fault.
    settings = undone(posed.mechanism)
    chosen = rng.permutation(len(numbers))[:count]
    return tuple(
        planted(
            posed,
            numbers[index],
            SIZES[turn % len(SIZES)] * float(rng.choice((-1, 1))),
            settings,
        )
        for turn, index in enumerate(chosen)
    )


def planted(posed: Posed, where: Path, share: float, settings: Settings) -> Planted:
    """What becomes of one fault, with settings of the engine's."""
    faulty = with_fault(posed.mechanism, where, share)
    motion, right = posed.motion, posed.truth
    wrong = ends(Dynamics(faulty), motion.t, motion.start, float(motion.lengths[0]))
    change = np.abs(wrong.states - right.states)
    # What both solutions' own errors may be is no effect.
    change = np.where(change > 4 * (wrong.error + right.error), change, 0.0).astype(float)
    found = examine(posed, faulty, RESOLUTION, settings)
    effect = float(np.max(change / posed.motion.unit))
    excess = float(np.max(change / found.uncertainty))
    pose, seen = _moved(posed, faulty, settings)
    error = np.abs(found.found.limit.value - wrong.states).astype(float)
    return Planted(
        where=".".join(map(str, where)),
        share=abs(share),
        fate=fate_of(_told(found), effect, excess, pose, seen),
        effect=effect,
        excess=excess,
        pose=pose,
        outside=int(np.sum(error > found.uncertainty)),
    )


def _told(found: Judged) -> bool:
    return found.verdict.outcome is Outcome.DIFFERS


def fate_of(told: bool, effect: float, excess: float, pose: float, seen: float) -> Fate:
    """See `Fate`: motions are asked first, then the engine's own poses."""
    if seen > POSE and pose < POSE / SURE:
        return Fate.FALSE
    if pose > SURE * POSE and seen < POSE:
        return Fate.MISSED
    if told:
        return Fate.MOTION if effect > 0 else Fate.FALSE
    if excess > SURE:
        return Fate.MISSED
    if pose > POSE:
        return Fate.FRAMES
    if effect > 0:
        return Fate.BELOW
    return Fate.FAINT if pose > SAME else Fate.INVISIBLE


def _moved(posed: Posed, faulty: Mechanism, settings: Settings) -> tuple[float, float]:
    """How far any body's place, by the largest distance, or turn is another, at all starts.

    By the equations, and as the engine has it of the faulty file.
    """
    n = len(faulty.links)
    starts = posed.motion.start[:, :n]
    q: Real = starts.T.astype(np.longdouble)
    right, wrong = (Dynamics(mechanism).poses(q) for mechanism in (posed.mechanism, faulty))
    size = np.max(np.abs(right.origins))

    def apart(origins: Real, turns: Real) -> float:
        places = np.max(np.abs(right.origins - origins)) / size
        return float(max(places, np.max(np.abs(right.turns - turns))))

    kind = "body" if faulty.format == MJCF else "link"
    with loaded(faulty, settings) as (model, _):
        found = model.poses([f"{kind}:body{i + 1}" for i in range(n)], starts)
    own = (np.moveaxis(one, 0, -1) for one in found)
    return apart(wrong.origins, wrong.turns), apart(*own)
