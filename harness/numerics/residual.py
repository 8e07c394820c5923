"""Residual of the coordinate map at the ends of segments, as h -> 0."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.segments import Segments
from .coordinates import CoordinateMap
from .ladder import EPSILON, ExtrapolatedLimit, limits, movement
from .rounding import Starts

FINEST = 3
"""Finest rungs whose own values bound the residual."""


@dataclass(frozen=True, kw_only=True)
class Residual:
    """Residual of the coordinate map at the ends of K segments, as h -> 0.

    The equations have zero: see `CoordinateMap.residual`.

    Attributes:
        limit: of positions, then velocities, (K, 2nz).
        scale: unit of relative errors: the largest movement of each coordinate over a segment by
            the map, floored by its kind; the largest of its kind for a fixed coordinate, (2nz,).
    """

    limit: ExtrapolatedLimit
    scale: Array


def residual_of(
    coordinates: CoordinateMap,
    segments: Segments,
    starts: Starts,
    rungs: tuple[int, ...],
    residuals: Sequence[Array],
) -> Residual:
    """Return the limit of the residuals of the rungs.

    They are extrapolated with the exponents 1, 2, 3, ..., which apply for any order that the engine
    claims of a motion: constraint forces may have a lower order, and be as stiff as the step
    allows. A constraint that holds to the last digits has residuals without any order; its rungs
    have no limit, but are near zero. So the uncertainty is at most the residual of the finest
    rungs.
    """
    count = starts.count
    ends = np.stack(residuals)[:, :count]
    finite: NDArray[np.bool_] = np.array([np.isfinite(one).all() for one in ends.swapaxes(0, 1)])
    moved = [
        np.concatenate(coordinates.to_engine(a), axis=1) for a in (segments.end, segments.start)
    ]
    scale = np.maximum(_held_scale(*moved), _unit_movement(coordinates, segments))
    rounding = coordinates.residual_rounding_scale(starts.z[:count], starts.w[:count])
    limit = limits(
        list(np.where(finite[:, None], ends, 0.0)),
        rungs,
        (1, 1),
        scale,
        np.maximum(rounding, scale),
        [starts.observed_rounding(one) for one in residuals],
        starts.last_digits(residuals[-1]),
        starts.epsilon,
    )
    value, uncertainty = bounded_by_finest(limit.value, limit.uncertainty, ends[-FINEST:])
    limit = replace(limit, value=value, uncertainty=uncertainty)
    limit.uncertainty[~finite] = np.inf
    return Residual(limit=limit, scale=scale)


def bounded_by_finest(value: Array, uncertainty: Array, finest: Array) -> tuple[Array, Array]:
    """Bound the limit of a quantity that the equations make zero by its finest rungs.

    Rounding alone has no order and no limit, but is near zero.

    Args:
        value: the limit, (...).
        uncertainty: of the limit, (...).
        finest: values on the finest rungs, the best one last, (R, ...).

    Returns:
        The limit and its uncertainty.
    """
    largest = np.max(np.abs(finest), axis=0)
    closer = largest < uncertainty
    return np.where(closer, finest[-1], value), np.where(closer, largest, uncertainty)


def _unit_movement(coordinates: CoordinateMap, segments: Segments) -> Array:
    """Return the movement of engine coordinates for one unit of each component, (2nz,)."""
    positions = np.concatenate(coordinates.to_engine(segments.start), axis=1)
    if segments.scale is None:
        return np.zeros(positions.shape[1])
    moved = [
        np.concatenate(coordinates.to_engine(segments.start + step), axis=1) - positions
        for step in np.diag(segments.scale)
    ]
    movement: Array = np.max(np.abs(moved), axis=(0, 1))
    return movement


def _held_scale(ends: Array, starts: Array) -> Array:
    """Return the unit of relative errors of engine coordinates, (2nz,).

    It is their `movement`; for coordinates that the map fixes, the largest of their kind.
    """
    scale = movement(ends, starts)
    moved = np.max(np.abs(ends - starts), axis=0)
    half = len(scale) // 2
    for part in (slice(0, half), slice(half, None)):
        still = moved[part] <= EPSILON * scale[part]
        scale[part] = np.where(still, np.max(scale[part]), scale[part])
    return scale
