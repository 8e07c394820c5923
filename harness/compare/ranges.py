"""Sampling range of initial states: within the limits of both files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from physics_crosscheck.harness.compare.candidate import Facts
from physics_crosscheck.harness.compare.match import Match
from physics_crosscheck.harness.compare.placed import tree_of
from physics_crosscheck.harness.compare.side import pairs_of
from physics_crosscheck.harness.engines.protocol import Array
from physics_crosscheck.reference.mechanism.chart import coordinate_names

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
    for pair in pairs_of(match, source.coordinates):
        source_name, target_name = (pair.a, pair.b) if match.source == "A" else (pair.b, pair.a)
        slope, offset = pair.slope, pair.offset
        if match.source == "B":
            slope, offset = 1 / slope, -offset / slope
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
