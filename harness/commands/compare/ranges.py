"""Initial positions: within the limits of both files, and where tendon springs with play pull."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.reference.mechanism.chart import coordinate_names
from physics_crosscheck.reference.solving.samples import within
from .candidate import Facts
from .match import Match
from .side import pairs_of

TAUT_SHARE = 0.5
"""Share of the way from an end of the play to the end of the joints' range."""

MAX_ROTATION = 2.0
"""Rotation coordinates, 4 tan(angle / 4), above which a body is turned back: 106 degrees."""

END_MARGIN = 1e-3
"""Share of a range between an initial state and its ends, where a stop may act already."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StartRange:
    """Positions from which runs of the source start.

    Attributes:
        home: that of its file, or the middle of the joints' range, (nz,).
        limits: of both files, (nz, 2), infinite without a limit.
        taut: further positions, at which springs of either file pull, (P, nz).
        strangers: joints whose ranges in both files do not overlap.
    """

    home: Array
    limits: Array
    taut: Array
    strangers: tuple[str, ...]


def start_range(source: Facts, target: Facts, match: Match) -> StartRange:
    """Return the positions within the limits of both files."""
    limits, strangers = source.limits.copy(), []
    lines = _lines(match, source, target)
    for i, j, slope, offset in lines:
        other = np.sort((target.limits[j] - offset) / slope)
        both = np.array([max(limits[i, 0], other[0]), min(limits[i, 1], other[1])])
        if both[0] < both[1]:
            limits[i] = both
        else:
            strangers.append(source.coordinates[i])
    home = _upright(source)
    sampled = within(limits, home)
    low, high = sampled.T + END_MARGIN * np.outer([1, -1], np.ptp(sampled, axis=1))
    home = np.where((low <= home) & (home <= high), home, sampled.mean(axis=1))
    unlimited: NDArray[np.bool_] = np.logical_and.reduce(np.isinf(limits), axis=1)
    taut = [
        start
        for spring in (*_springs(source), *_springs_of_target(target, lines, len(home)))
        for direction in (-1.0, 1.0)
        for start in _taut(spring, direction, home, sampled, unlimited)
    ]
    different = np.unique(np.array(taut).reshape(len(taut), len(home)), axis=0)
    return StartRange(home=home, limits=limits, taut=different, strangers=tuple(strangers))


def _upright(source: Facts) -> Array:
    """Return the positions of the file, (nz,), without large rotations of bodies.

    Half a turn is the edge of the chart. There a torque about an axis moves another coordinate
    than its own, so that the body would seem to be locked.
    """
    home, tree = source.home.copy(), source.tree
    turning = [link for link in tree.links if link.kind in ("free", "ball")] if tree else []
    for link in turning:
        names = [name for name, unit in coordinate_names(link.kind, link.name) if unit == "rad"]
        places = [source.coordinates.index(name) for name in names]
        if np.linalg.norm(home[places]) > MAX_ROTATION:
            home[places] = 0.0
    return home


@dataclass(frozen=True, kw_only=True, eq=False)
class _Spring:
    """A length slope @ z + offset of the source's positions z, and its range of play."""

    slope: Array
    offset: float
    rest: tuple[float, float]


def _springs(model: Facts) -> Iterator[_Spring]:
    """Yield springs with play along joints of one model, in its own positions."""
    tree = model.tree
    if tree is None or tree.couplings:
        return
    for force in tree.pulls:
        if not (any(force.stiffness) and force.joints and force.rest[0] < force.rest[1]):
            continue
        slope = np.zeros(len(model.coordinates))
        for joint, share in force.joints:
            slope[model.coordinates.index(tree.links[joint].name)] += share
        yield _Spring(slope=slope, offset=0.0, rest=force.rest)


def _springs_of_target(target: Facts, lines: Sequence[_Line], size: int) -> Iterator[_Spring]:
    """Yield the target's springs in the source's positions."""
    for spring in _springs(target):
        slope = np.zeros(size)
        for i, j, by, _ in lines:
            slope[i] += spring.slope[j] * by
        offset = sum(float(spring.slope[j]) * shift for _, j, _, shift in lines)
        yield _Spring(slope=slope, offset=offset, rest=spring.rest)


def _taut(
    spring: _Spring, direction: float, home: Array, sampled: Array, unlimited: NDArray[np.bool_]
) -> Iterator[Array]:
    """Yield a position beyond one end of the play, if the joints' range permits it."""
    slope = direction * spring.slope
    end = max(direction * spring.rest[0], direction * spring.rest[1])
    now = float(slope @ home) + direction * spring.offset
    corner = np.where(slope > 0, sampled[:, 1], sampled[:, 0])
    way, free = np.where(slope != 0, corner - home, 0.0), np.logical_and(slope != 0, unlimited)
    if free.any():  # joints without limits move as far as necessary
        way = np.where(free, way, 0.0)
    size = float(slope @ way)
    furthest = max(end, now) + size if free.any() else now + size
    if size > 0 and furthest > end:
        far = end + TAUT_SHARE * (furthest - end)
        yield home + way * (far - now) / size


def range_notes(strangers: Sequence[str], label: str) -> tuple[str, ...]:
    """Return a note about joints whose ranges do not overlap."""
    if not strangers:
        return ()
    return (
        f"the ranges of {', '.join(strangers)} have nothing in common: runs start within those"
        f" of {label}",
    )


_Line = tuple[int, int, float, float]
"""(i, j, slope, offset): the target's position j is on that line over the source's position i."""


def _lines(match: Match, source: Facts, target: Facts) -> tuple[_Line, ...]:
    pairs, names = pairs_of(match, source.coordinates), (source.coordinates, target.coordinates)
    if match.source == "A":
        rows = [(pair.a, pair.b, pair.slope, pair.offset) for pair in pairs]
    else:
        rows = [(p.b, p.a, 1 / p.slope, -p.offset / p.slope) for p in pairs]
    return tuple((names[0].index(i), names[1].index(j), by, shift) for i, j, by, shift in rows)
