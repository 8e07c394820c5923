"""Short runs from given states under constant forces, and their end states as h -> 0."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from physics_crosscheck.harness.compare.match import Match
from physics_crosscheck.harness.engines.protocol import Array, Model
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap, identity
from physics_crosscheck.harness.numerics.ladder import RUNGS, movement, observed_order
from physics_crosscheck.harness.numerics.segments import Extrapolated, extrapolate, limits_only
from physics_crosscheck.reference.solving.segments import Segments

QUICK_RUNGS = RUNGS[:8]


@dataclass(frozen=True, kw_only=True)
class Runs:
    """K runs of one length.

    Attributes:
        length: seconds.
        z, w: initial states, in a model's own coordinates, (K, nz) each.
        push: constant forces on the m coordinates of the comparison, (K, m).
    """

    length: float
    z: Array
    w: Array
    push: Array


def ends(model: Model, runs: Runs, match: Match | None, resolution: float) -> Extrapolated:
    """Return end states as h -> 0 and at each rung, in the model's own coordinates.

    Rungs are added until the uncertainty is far below the resolution, or stops falling. A run with
    values that are not finite has no limit.

    Args:
        model: to run.
        runs: in its own coordinates.
        match: conversion for the source; None: the forces act on the model's own coordinates.
        resolution: relative to how far the components move.

    Raises:
        BlownUpError: if no run is finite.
    """
    coordinates, segments = own_states(runs.z.shape[1], match), _segments(runs, match)
    extrapolated = extrapolate(model, coordinates, segments, resolution=resolution, partial=True)
    if extrapolated.limit.order_confirmed or not extrapolated.limit.converges:
        return extrapolated
    claimed = model.exponents(segments.varying)[0]
    confirmed = _mostly_confirmed(extrapolated, segments.start, claimed)
    return replace(extrapolated, limit=replace(extrapolated.limit, order_confirmed=confirmed))


def _mostly_confirmed(extrapolated: Extrapolated, starts: Array, claimed: int) -> bool:
    """Return whether at least half of the runs have the claimed order, judged one by one.

    Judged together, a few runs in which a drag changes sign would decide. Their loss of accuracy is
    part of their own uncertainty.
    """
    scale = movement(extrapolated.limit.value, starts)
    rounding = float(np.max(np.abs(extrapolated.limit.value) / scale))
    finite = np.flatnonzero(np.isfinite(extrapolated.limit.uncertainty).all(axis=1))
    confirmed = [
        observed_order(extrapolated.raw[:, [k]] / scale, extrapolated.rungs, claimed, rounding)[1]
        for k in finite
    ]
    return 2 * sum(confirmed) >= len(confirmed)


def quick(model: Model, runs: Runs, match: Match | None) -> Array:
    """Return only the limits, (K, 2nz), to measure the effect of a change of the model.

    Raises:
        BlownUpError: if a value is not finite.
    """
    coordinates, segments = own_states(runs.z.shape[1], match), _segments(runs, match)
    return limits_only(model, coordinates, segments, QUICK_RUNGS)


def _segments(runs: Runs, match: Match | None) -> Segments:
    return Segments.unsolved(
        np.concatenate([runs.z, runs.w], axis=1),
        runs.length,
        runs.push,
        # A force that depends on the state is constant over each step, like a varying input.
        varying=match is not None and not match.constant and bool(runs.push.any()),
    )


def own_states(size: int, match: Match | None) -> CoordinateMap:
    """Return a model's own coordinates, with forces on those of the comparison."""
    if match is None:
        return replace(identity(size), push_matrix=np.eye(size))
    matrix = match.slopes(np.zeros((1, size)))[0].T if match.constant else None
    return replace(identity(size), push=match.push, push_matrix=matrix)
