"""Initial positions at which tendon springs with play pull.

The force has a kink at either end of the play.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from physics_crosscheck.harness.compare.candidate import Facts
from physics_crosscheck.harness.compare.match import Match
from physics_crosscheck.harness.compare.side import pairs_of
from physics_crosscheck.harness.engines.protocol import Array

TAUT_SHARE = 0.5
"""Share of the way from an end of the play to the end of the joints' range."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Spring:
    """A length slope @ z + offset of the source's positions z, and its range of play."""

    slope: Array
    offset: float
    rest: tuple[float, float]


def taut_starts(
    source: Facts, target: Facts, match: Match, home: Array, sampling_range: Array, limits: Array
) -> Array:
    """Return positions (P, nz) of the source at which springs of either file pull.

    Args:
        source, target: both models.
        match: of their coordinates.
        home: base position, (nz,).
        sampling_range: sampling range, (nz, 2).
        limits: of the joints of both, infinite where there is no limit, (nz, 2).
    """
    starts = dict.fromkeys(
        tuple(start.tolist())
        for spring in (*_springs(source), *_springs_of_target(source, target, match))
        for side in (-1.0, 1.0)
        for start in _taut(spring, side, home, sampling_range, limits)
    )
    return np.array(list(starts)).reshape(len(starts), len(home))


def _springs(model_facts: Facts) -> Iterator[_Spring]:
    """Yield springs with play along joints of one model, in its own positions."""
    if model_facts.compiled is None:
        return
    joints = [joint.name for body in model_facts.compiled.bodies for joint in body.joints]
    names = [name or f"joint_{i}" for i, name in enumerate(joints)]
    for force in model_facts.compiled.pulls:
        if not (any(force.stiffness) and force.joints and force.rest[0] < force.rest[1]):
            continue
        slope = np.zeros(len(model_facts.coordinates))
        for joint, share in force.joints:
            if names[joint] in model_facts.coordinates:
                slope[model_facts.coordinates.index(names[joint])] += share
        yield _Spring(slope=slope, offset=0.0, rest=force.rest)


def _springs_of_target(source: Facts, target: Facts, match: Match) -> Iterator[_Spring]:
    """Yield the target's springs in the source's positions."""
    pairs = pairs_of(match, source.coordinates)
    for spring in _springs(target):
        slope, offset = np.zeros(len(source.coordinates)), 0.0
        for pair in pairs:
            source_name, target_name = (pair.a, pair.b) if match.source == "A" else (pair.b, pair.a)
            by, shift = pair.slope, pair.offset
            if match.source == "B":
                by, shift = 1 / by, -shift / by
            share = spring.slope[target.coordinates.index(target_name)]
            slope[source.coordinates.index(source_name)] += share * by
            offset += share * shift
        yield _Spring(slope=slope, offset=offset, rest=spring.rest)


def _taut(
    spring: _Spring, direction: float, home: Array, sampling_range: Array, limits: Array
) -> Sequence[Array]:
    """Return a position beyond one end of the play, if the joints' range permits it."""
    slope, end = (
        direction * spring.slope,
        max(direction * spring.rest[0], direction * spring.rest[1]),
    )
    now = float(slope @ home) + direction * spring.offset
    free = np.logical_and(slope != 0, np.isinf(limits).all(axis=1))
    if free.any():
        # Joints without limits move as far as necessary.
        way = np.where(
            free, np.sign(slope) * (sampling_range[:, 1] - sampling_range[:, 0]) / 2, 0.0
        )
        far = max(end, now) + TAUT_SHARE * float(slope @ way)
    else:
        corner = np.where(slope > 0, sampling_range[:, 1], sampling_range[:, 0])
        way = np.where(slope != 0, corner - home, 0.0)
        furthest = now + float(slope @ way)
        far = end + TAUT_SHARE * (furthest - end)
        if furthest <= end:
            return []
    size = float(slope @ way)
    return [home + way * (far - now) / size] if size > 0 else []
