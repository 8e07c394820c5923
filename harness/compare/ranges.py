"""Initial states: within the limits of both files, and where tendon springs with play pull.

A force along a tendon has a kink at either end of the play.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from physics_crosscheck.harness.compare.candidate import Facts
from physics_crosscheck.harness.compare.match import Match
from physics_crosscheck.harness.compare.placed import tree_of
from physics_crosscheck.harness.compare.side import pairs_of
from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.reference.mechanism.chart import coordinate_names

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
    lines = _lines_of(match, source.coordinates)
    for spring in _springs(target):
        slope, offset = np.zeros(len(source.coordinates)), 0.0
        for source_name, target_name, by, shift in lines:
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


MAX_DISTANCE = np.pi
"""Limits further from home are ignored, as in `reference.solving.samples`: rad or m."""

MAX_ROTATION = 2.0
"""Rotation coordinates, 4 tan(angle / 4), above which a body is turned back: 106 degrees."""

END_MARGIN = 1e-3
"""Share of a range between an initial state and its ends, where a stop may act already."""


def start_range(
    source: Facts, target: Facts, match: Match
) -> tuple[Array, Array, tuple[str, ...], Array]:
    """Return initial positions, (nz,), and their sampling range, (nz, 2), of the source.

    The range is within the limits of both. Without limits it is the engine's, about the position in
    which the file draws the mechanism. Also return joints whose ranges do not overlap, and the
    limits of both files, (nz, 2).
    """
    limits, strangers = source.limits.copy(), []
    for source_name, target_name, slope, offset in _lines_of(match, source.coordinates):
        i, j = source.coordinates.index(source_name), target.coordinates.index(target_name)
        other = np.sort((target.limits[j] - offset) / slope)
        both = np.array([max(limits[i, 0], other[0]), min(limits[i, 1], other[1])])
        if both[0] < both[1]:
            limits[i] = both
        else:
            strangers.append(source_name)
    return *_drawn(replace(source, home=_upright(source)), limits), tuple(strangers), limits


def _upright(source: Facts) -> Array:
    """Return the positions of the file, (nz,), without large rotations of bodies.

    Half a turn is the edge of the chart. There a torque about an axis moves another coordinate
    than its own, so that the body would seem to be locked.
    """
    home = source.home.copy()
    tree = tree_of(source.robot, source.coordinates)
    turning = [link for link in tree.links if link.kind in ("free", "ball")] if tree else []
    for link in turning:
        names = [name for name, unit in coordinate_names(link.kind, link.name) if unit == "rad"]
        places = [source.coordinates.index(name) for name in names]
        if np.linalg.norm(home[places]) > MAX_ROTATION:
            home[places] = 0.0
    return home


def _drawn(source: Facts, limits: Array) -> tuple[Array, Array]:
    """Return what `reference.solving.samples.within` does, with ranges of the engine."""
    low, high = limits.T
    half = (source.sampling_range[:, 1] - source.sampling_range[:, 0]) / 2
    half = np.where(np.isinf(limits).all(axis=1), half, np.minimum(half, MAX_DISTANCE))
    low = np.where(np.isfinite(low), low, np.minimum(source.home, high) - half)
    high = np.where(np.isfinite(high), high, np.maximum(source.home, low) + half)
    near = np.clip(source.home, low, high)
    sampled = np.stack(
        [np.maximum(low, near - MAX_DISTANCE), np.minimum(high, near + MAX_DISTANCE)], axis=1
    )
    off = END_MARGIN * (sampled[:, 1] - sampled[:, 0])
    inside = (sampled[:, 0] + off <= source.home) & (source.home <= sampled[:, 1] - off)
    return np.where(inside, source.home, sampled.mean(axis=1)), sampled


def range_notes(strangers: Sequence[str], label: str) -> tuple[str, ...]:
    """Return a note about joints whose ranges do not overlap."""
    if not strangers:
        return ()
    return (
        f"the ranges of {', '.join(strangers)} have nothing in common: runs start within those"
        f" of {label}",
    )


def _lines_of(
    match: Match, source_names: tuple[str, ...]
) -> tuple[tuple[str, str, float, float], ...]:
    """Return rows (source, target, slope, offset): the target's position is on that line."""
    pairs = pairs_of(match, source_names)
    if match.source == "A":
        return tuple((pair.a, pair.b, pair.slope, pair.offset) for pair in pairs)
    return tuple((p.b, p.a, 1 / p.slope, -p.offset / p.slope) for p in pairs)
