"""Short runs from given states under held forces, and where they end as the step goes to zero."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import sympy as sp

from harness.compare.match import Match
from harness.engines.protocol import Array, Force, Model, StateForce
from harness.numerics.coordinates import CoordinateMap
from harness.numerics.ladder import FIRST_JUDGED, RUNGS, Limit, limits, suffices, weights
from harness.numerics.segments import BlownUpError
from reference.numeric import NumericFunction, compile_function

QUICK = RUNGS[:8]
LEAST_SHARE = 1e-3
"""A component that moves less than this share of the one that moves most is measured against it."""


@dataclass(frozen=True)
class Runs:
    """K runs of one length.

    Attributes:
        length: seconds.
        z, w: where they start, in a model's own coordinates, (K, nz) each.
        push: forces on the m coordinates of the comparison, held throughout, (K, m).
    """

    length: float
    z: Array
    w: Array
    push: Array


def force(runs: Runs, match: Match | None, rung: int) -> Force:
    """The forces of some runs on a model's own coordinates; `match` where it is the source."""
    if not runs.push.any():
        return None
    held = np.repeat(runs.push[:, None, :], rung, axis=1)
    if match is None:
        return held
    if match.constant:
        own: Array = held @ match.slopes(runs.z[:1])[0]
        return own
    return StateForce(held, _Transposed(match.slope, runs.z.shape[1]))


@dataclass(frozen=True)
class _Transposed:
    """(z, u) -> dc/dz^T u, on plain numbers."""

    slope: NumericFunction
    size: int

    def __call__(self, z: Sequence[float], u: Sequence[float]) -> Sequence[float]:
        flat = self.slope.scalar(*z)
        n = self.size
        return [sum(flat[i * n + j] * u[i] for i in range(len(u))) for j in range(n)]


def exponents(model: Model, runs: Runs, match: Match | None) -> tuple[int, int]:
    """A force that depends on the state is held over each step, as an input that varies is."""
    varying = match is not None and not match.constant and bool(runs.push.any())
    return model.exponents(varying)


def raw(model: Model, runs: Runs, match: Match | None, rung: int) -> Array:
    """Ends (K, 2nz) of runs in `rung` steps, in the model's own coordinates."""
    h = runs.length / rung
    z, w = model.rollout(runs.z, runs.w, h, rung, force(runs, match, rung), rung)
    return np.concatenate([z[:, 0], w[:, 0]], axis=1)


def movement(ends: Array, starts: Array) -> Array:
    """What counts as one, (2nz,): how far each component moves at most, floored by its like."""
    with np.errstate(invalid="ignore"):
        moved = np.abs(ends - starts)
    reach = np.max(np.where(np.isfinite(moved), moved, 0.0), axis=0, initial=0.0)
    half = len(reach) // 2
    for part in (slice(0, half), slice(half, None)):
        reach[part] = np.maximum(reach[part], LEAST_SHARE * np.max(reach[part], initial=0.0))
    return np.where(reach > 0, reach, 1.0)


def ends(model: Model, runs: Runs, match: Match | None, fastest: float, resolution: float) -> Limit:
    """Where the runs end as h -> 0, in the model's own coordinates.

    Rungs are added until the uncertainty is far below the resolution, or stops falling. A run that
    is not finite has no limit.

    Raises:
        BlownUpError: where none is finite.
    """
    starts = np.concatenate([runs.z, runs.w], axis=1)
    values: list[Array] = []
    limit: Limit | None = None
    alive = np.ones(len(starts), dtype=bool)
    scale = grain = np.ones(starts.shape[1])
    for count, rung in enumerate(RUNGS, start=1):
        found = raw(model, runs, match, rung)
        alive &= np.isfinite(found).all(axis=1)
        if not alive.any():
            raise BlownUpError(
                f"no motion is finite, in {rung} steps of {runs.length / rung:.3g} s"
            )
        values.append(found)
        if count < FIRST_JUDGED:
            continue
        finite = [np.where(alive[:, None], value, starts) for value in values]
        if limit is None:
            scale = movement(finite[-1], starts)
            n = runs.z.shape[1]
            grain = np.max(np.abs(starts), axis=0) + scale
            # A velocity is moved by what rounding the positions does to the forces, over a run.
            grain[n:] += grain[:n] * fastest**2 * runs.length
        previous = limit
        limit = limits(finite, RUNGS[:count], exponents(model, runs, match), scale, grain)
        if suffices(limit, previous, count, scale, resolution):
            break
    assert limit is not None
    limit.uncertainty[~alive] = np.inf
    return limit


def quick(model: Model, runs: Runs, match: Match | None) -> Array:
    """The limits alone, (K, 2nz): for what a change of the model does.

    Raises:
        BlownUpError: where a value is not finite.
    """
    stack = np.stack([raw(model, runs, match, rung) for rung in QUICK])
    if not np.isfinite(stack).all():
        raise BlownUpError("values that are not finite")
    limit: Array = np.tensordot(weights(QUICK, exponents(model, runs, match)), stack, axes=1)
    return limit


@lru_cache(maxsize=8)
def identity(size: int) -> CoordinateMap:
    """A model's own coordinates as they are, for what measures in a system's."""
    z = [sp.Symbol(f"z{i}_", real=True) for i in range(size)]
    same, unit = compile_function(z, z), compile_function(list(sp.eye(size)), z)
    none = compile_function([sp.Integer(0)] * size, z, [])
    return CoordinateMap(same, unit, same, unit, none, np.zeros((size, 0)), (False,) * size)
