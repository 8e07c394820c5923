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

BEYOND = 0.5
"""Share of the way from an end of the play to the end of the joints' range."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Spring:
    """A length slope @ z + offset of the source's positions z, and its range of play."""

    slope: Array
    offset: float
    rest: tuple[float, float]


def taut_starts(
    source: Facts, target: Facts, match: Match, home: Array, reach: Array, limits: Array
) -> Array:
    """Return positions (P, nz) of the source at which springs of either file pull.

    Args:
        source, target: both models.
        match: of their coordinates.
        home: base position, (nz,).
        reach: sampling range, (nz, 2).
        limits: of the joints of both, infinite where there is no limit, (nz, 2).
    """
    found = dict.fromkeys(
        tuple(start.tolist())
        for spring in (*_springs(source), *_springs_of_target(source, target, match))
        for side in (-1.0, 1.0)
        for start in _taut(spring, side, home, reach, limits)
    )
    return np.array(list(found)).reshape(len(found), len(home))


def _springs(own: Facts) -> Iterator[_Spring]:
    """Yield springs with play along joints of one model, in its own positions."""
    if own.compiled is None:
        return
    joints = [joint.name for body in own.compiled.bodies for joint in body.joints]
    names = [name or f"joint_{i}" for i, name in enumerate(joints)]
    for pull in own.compiled.pulls:
        if not (any(pull.stiffness) and pull.joints and pull.rest[0] < pull.rest[1]):
            continue
        slope = np.zeros(len(own.coordinates))
        for joint, share in pull.joints:
            if names[joint] in own.coordinates:
                slope[own.coordinates.index(names[joint])] += share
        yield _Spring(slope=slope, offset=0.0, rest=pull.rest)


def _springs_of_target(source: Facts, target: Facts, match: Match) -> Iterator[_Spring]:
    """Yield the target's springs in the source's positions."""
    pairs = pairs_of(match, source.coordinates)
    for spring in _springs(target):
        slope, offset = np.zeros(len(source.coordinates)), 0.0
        for pair in pairs:
            own, its = (pair.a, pair.b) if match.source == "A" else (pair.b, pair.a)
            by, shift = pair.slope, pair.offset
            if match.source == "B":
                by, shift = 1 / by, -shift / by
            share = spring.slope[target.coordinates.index(its)]
            slope[source.coordinates.index(own)] += share * by
            offset += share * shift
        yield _Spring(slope=slope, offset=offset, rest=spring.rest)


def _taut(
    spring: _Spring, side: float, home: Array, reach: Array, limits: Array
) -> Sequence[Array]:
    """Return a position beyond one end of the play, if the joints' range permits it."""
    slope, end = side * spring.slope, max(side * spring.rest[0], side * spring.rest[1])
    now = float(slope @ home) + side * spring.offset
    free = np.logical_and(slope != 0, np.isinf(limits).all(axis=1))
    if free.any():
        # Joints without limits move as far as necessary.
        way = np.where(free, np.sign(slope) * (reach[:, 1] - reach[:, 0]) / 2, 0.0)
        far = max(end, now) + BEYOND * float(slope @ way)
    else:
        corner = np.where(slope > 0, reach[:, 1], reach[:, 0])
        way = np.where(slope != 0, corner - home, 0.0)
        most = now + float(slope @ way)
        far = end + BEYOND * (most - end)
        if most <= end:
            return []
    size = float(slope @ way)
    return [home + way * (far - now) / size] if size > 0 else []
