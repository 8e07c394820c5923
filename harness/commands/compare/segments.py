"""Short runs of both models from the same states, and their end states as h -> 0."""

from dataclasses import dataclass, replace

import numpy as np

from physics_crosscheck.harness.engines.protocol import Array, LoadedModel
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap, identity
from physics_crosscheck.harness.numerics.ladder import (
    RUNGS,
    ExtrapolatedLimit,
    movement,
    observed_order,
)
from physics_crosscheck.harness.numerics.segments import (
    BlownUpError,
    Extrapolated,
    extrapolate,
    limits_only,
)
from physics_crosscheck.reference.solving.segments import ConstantInputs, Segments
from .candidate import Candidate
from .match import Match, halves

QUICK_RUNGS = RUNGS[:8]

RUN_DIVISORS = (1.0, 4.0, 16.0)
"""Divisors of the run length, tried until most runs are resolved."""

SOURCE_SHARE = 0.4
"""Share of the resolution available to a run of the source."""

MIN_LIMITED_SHARE = 0.1
"""Share of the target's runs that must have a limit for a verdict."""


def reversed_segments(segments: Segments, signs: Array) -> Segments:
    """Return segments where some coordinates have the opposite direction, by their signs (m,)."""
    both = np.concatenate([signs, signs])
    return Segments.unsolved(segments.start * both, segments.length, segments.start_inputs * signs)


def own_forces(segments: Segments, match: Match) -> Segments:
    """Return segments of the source with forces on its own coordinates, if `match` is constant."""
    z, _ = halves(segments.start[:1])
    return replace(segments, inputs=ConstantInputs(segments.start_inputs @ match.slopes(z)[0]))


@dataclass(frozen=True, kw_only=True)
class Ends:
    """End states of one model, in the coordinates of the comparison.

    Attributes:
        length: of the runs, seconds.
        value, uncertainty: as h -> 0, (K, 2m).
        finest: at the finest rung, (K, 2m).
        limit: in the model's own coordinates.
        claimed: order of its integrator.
    """

    length: float
    value: Array
    uncertainty: Array
    finest: Array
    limit: ExtrapolatedLimit
    claimed: int

    @property
    def mostly_limited(self) -> bool:
        """True if enough runs have a limit, so that last digits do not decide."""
        finite = np.isfinite(self.uncertainty).all(axis=1)
        return bool(np.mean(finite) >= MIN_LIMITED_SHARE)


def run_target(target: Candidate, runs: Segments, signs: Array, resolution: float) -> Ends:
    """Run the target from the source's states.

    Args:
        target: the model.
        runs: in the coordinates of the comparison.
        signs: -1 for each coordinate that the target reverses, (m,).
        resolution: relative to how far the components move.

    Raises:
        EngineError, BlownUpError: for a failing run.
    """
    reached, both = (
        _ends(target.load(), reversed_segments(runs, signs), None, resolution),
        [*signs] * 2,
    )
    return replace(reached, value=reached.value * both, finest=reached.finest * both)


def run_source(source: Candidate, runs: Segments, match: Match, resolution: float) -> Ends:
    """Run the source, over shorter runs if most are not resolved otherwise.

    Args:
        source: the model.
        runs: in its own coordinates, with forces on those of the comparison.
        match: conversion to the coordinates of the comparison.
        resolution: relative to how far the components move.

    Raises:
        EngineError, BlownUpError: for a failing run.
    """
    model, start, best = source.load(), match.convert(runs.start), None
    for divisor in RUN_DIVISORS:
        shorter = replace(runs, lengths=runs.lengths / divisor)
        try:
            tried = _ends(model, shorter, match, resolution)
        except BlownUpError:
            continue
        value = unwrapped(tried.value, start, match.periodic)
        finite = np.isfinite(tried.uncertainty).all(axis=1)
        relative = tried.uncertainty / movement(value[finite], start[finite])
        # They leave no room for the uncertainty of the target.
        unresolved = float(np.mean(np.max(relative, axis=1) > SOURCE_SHARE * resolution))
        if best is None or unresolved < best[0]:
            best = unresolved, tried
        if unresolved <= 0.5:
            break
    if best is None:
        raise BlownUpError("no motion is finite")
    return best[1]


def _ends(model: LoadedModel, runs: Segments, match: Match | None, resolution: float) -> Ends:
    """Return the ends of runs; `match` is that of the source, None for the target."""
    extrapolated = ends(model, runs, match, resolution)
    limit, finest = extrapolated.limit, extrapolated.raw[-1]
    return Ends(
        length=runs.length,
        value=limit.value if match is None else match.convert(limit.value),
        uncertainty=limit.uncertainty
        if match is None
        else match.errors(limit.value, limit.uncertainty),
        finest=finest if match is None else match.convert(finest),
        limit=limit,
        claimed=model.exponents(False)[0],
    )


def ends(
    model: LoadedModel, runs: Segments, match: Match | None, resolution: float
) -> Extrapolated:
    """Return end states as h -> 0 and at each rung, in the model's own coordinates.

    Rungs are added until the uncertainty is far below the resolution, or stops falling. A run with
    values that are not finite has no limit.

    Args:
        model: to run.
        runs: in its own coordinates, with forces on those of the comparison.
        match: conversion for the source; None: the forces act on the model's own coordinates.
        resolution: relative to how far the components move.

    Raises:
        BlownUpError: if no run is finite.
    """
    coordinates, segments = _own_states(runs, match), _varying(runs, match)
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


def quick(model: LoadedModel, runs: Segments, match: Match | None) -> Array:
    """Return only the limits, (K, 2nz), to measure the effect of a change of the model.

    Raises:
        BlownUpError: if a value is not finite.
    """
    return limits_only(model, _own_states(runs, match), _varying(runs, match), QUICK_RUNGS)


def unwrapped(end: Array, near: Array, periodic: tuple[bool, ...]) -> Array:
    """Shift angles known modulo 2 pi close to another state."""
    end = end.copy()
    for i, turns in enumerate(periodic):
        if turns:
            end[:, i] += 2 * np.pi * np.round((near[:, i] - end[:, i]) / (2 * np.pi))
    return end


def _varying(runs: Segments, match: Match | None) -> Segments:
    """Return the runs; forces that depend on the state are constant over each step only."""
    varies = match is not None and not match.constant and bool(runs.start_inputs.any())
    return replace(runs, varying=varies)


def _own_states(runs: Segments, match: Match | None) -> CoordinateMap:
    """Return a model's own coordinates, with forces on those of the comparison."""
    z, _ = halves(runs.start[:1])
    plain = identity(z.shape[1])
    if match is None:
        return replace(plain, push_matrix=np.eye(z.shape[1]))
    matrix = match.slopes(0 * z)[0].T if match.constant else None
    return replace(plain, push=match.push, push_matrix=matrix)
