"""The extrapolated segment: what an engine makes of given states, as h -> 0.

Everything that the harness knows of an engine's motion over a segment comes from here: `climb` runs
rung after rung and takes the limit, of ends for `extrapolate` and of velocity changes for
`harness.numerics.accelerations`, and observes on every rung what rounding does to it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from harness.engines.protocol import Model
from harness.numerics.coordinates import CoordinateMap
from harness.numerics.ladder import (
    EPSILON,
    FIRST_JUDGED,
    RUNGS,
    Limit,
    largest,
    limits,
    suffices,
    weights,
)
from harness.numerics.rounding import Starts, unheld, with_companions, without_companions
from reference.motion import Motion, Span
from reference.numeric import Array
from reference.signal import Inputs

FINEST = 3
"""Rungs, the finest, whose own values bound what is left of the coordinate map."""

Rows = NDArray[np.intp]
StepInputs = Callable[[Rows, int], Array]
"""Inputs over chosen segments, at the starts of so many equal steps: (B, steps, inputs)."""

LEAST_SHARE = 1e-3
"""A component that moves less than this share of the one that moves most is measured against it."""


class BlownUpError(RuntimeError):
    """An engine returned values that are not finite."""


@dataclass(frozen=True, kw_only=True)
class Batch:
    """K segments to be run, in a system's coordinates; c = 2n components.

    Attributes:
        states: where they start, (K, c).
        lengths: seconds of each, (K,).
        inputs: over each segment.
        varying: whether an input changes over a segment, and is held over each step.
        scale: what counts as one, per component, (c,); None: how far the runs themselves move.
        ends: about where they end, (K, c), near which angles are taken; None: near their starts.
        times: when they start, (K,), and
        name: of their scenario, for messages.
        partial: whether segments that are not finite are left without a limit, where others are.
    """

    states: Array
    lengths: Array
    inputs: StepInputs
    varying: bool
    scale: Array | None
    ends: Array | None = None
    times: Array | None = None
    name: str = ""
    partial: bool = False

    @staticmethod
    def of(motion: Motion, scale: Array) -> Batch:
        """All segments of a motion."""
        return Batch(
            states=motion.start,
            lengths=motion.lengths,
            inputs=over(motion.inputs, motion.t, motion.lengths),
            varying=motion.varying,
            scale=scale,
            ends=motion.end,
            times=motion.t,
        )


def over(inputs: Inputs, t: Array, lengths: Array) -> StepInputs:
    """Inputs u(t) of a scenario, over segments from times t on, (K,)."""

    def at(rows: Rows, steps: int) -> Array:
        h = lengths[rows, None] / steps
        times = t[rows, None] + h * np.arange(steps)
        values = inputs(times.ravel(), slack=float(np.min(h)) / 4)
        return values.reshape(len(rows), steps, -1)

    return at


def held(values: Array) -> StepInputs:
    """Inputs (K, m) that are held throughout each segment."""

    def at(rows: Rows, steps: int) -> Array:
        return np.repeat(values[rows, None, :], steps, axis=1)

    return at


@dataclass(frozen=True, kw_only=True)
class Residual:
    """What the engine's coordinates leave of the map at the ends of K segments, as h -> 0.

    The equations' is zero: see `CoordinateMap.residual`.

    Attributes:
        limit: of positions, then velocities, (K, 2nz).
        scale: what counts as one: how far each moves over a segment at most by the map, floored by
            its like; the largest of these where the map holds one still, (2nz,).
    """

    limit: Limit
    scale: Array


@dataclass(frozen=True, kw_only=True)
class Extrapolated:
    """Every segment of a batch, extrapolated.

    Attributes:
        limit: where the engine ends each segment as h -> 0, with its uncertainty.
        raw: ends at each rung, (M, K, c).
        rungs: step counts of `raw`.
        steps: engine steps taken, the companions' included.
        residual: of the coordinate map; None where that leaves nothing open.
    """

    limit: Limit
    raw: Array
    rungs: tuple[int, ...]
    steps: int
    residual: Residual | None = None


@dataclass(frozen=True, kw_only=True)
class Observable:
    """What is looked at on every rung, of K starts and their companions; C components.

    Attributes:
        at: its values (K + 2P, C) in so many steps.
        starts: the starts.
        exponents: leading exponent of h and increment.
        rounding_scale: magnitude that rounding is relative to, (C,).
        scale: what counts as one, (C,); None: how far the values are from `origin`.
        origin: the values at the start, (K, C), which stand for those that are not finite; None:
            all values must be finite.
        begun: of an engine of less digits than doubles have, the values that all its starts have,
            (K + 2P, C), to which it adds what it rounds.
        where: tells where a start lies, by its segment and the rung, for a message.
    """

    at: Callable[[int], Array]
    starts: Starts
    exponents: tuple[int, int]
    rounding_scale: Array
    scale: Array | None
    origin: Array | None = None
    begun: Array | None = None
    where: Callable[[int, int], str]


def extrapolate(
    model: Model,
    coordinates: CoordinateMap,
    batch: Batch,
    *,
    rungs: tuple[int, ...] = RUNGS,
    resolution: float | None = None,
) -> Extrapolated:
    """Run every segment of a batch on rung after rung, and take the limit.

    All rungs are run, or, where a resolution is given, as many as it takes.

    Raises:
        BlownUpError: where the engine returns values that are not finite.
    """
    starts = with_companions(*coordinates.to_engine(batch.states), model.epsilon)
    left: list[Array] = []
    observable = _ends(model, coordinates, batch, starts, left)
    found = climb(observable, rungs, resolution)
    if batch.ends is None or not coordinates.redundant:
        return found
    return replace(found, residual=_residual(coordinates, batch, starts, found.rungs, left))


def limits_alone(
    model: Model, coordinates: CoordinateMap, batch: Batch, rungs: tuple[int, ...]
) -> Array:
    """The limits (K, c) of a batch without their uncertainty, for differences of close models.

    Raises:
        BlownUpError: where the engine returns values that are not finite.
    """
    starts = without_companions(*coordinates.to_engine(batch.states))
    observable = _ends(model, coordinates, batch, starts, [])
    values = list(_rungs(observable, rungs))  # no companions are among them
    limit: Array = np.tensordot(weights(rungs, observable.exponents), np.stack(values), axes=1)
    return limit


def climb(
    observable: Observable, rungs: tuple[int, ...], resolution: float | None = None
) -> Extrapolated:
    """The limit of an observable, over all rungs or as many as the resolution takes.

    Raises:
        BlownUpError: where its values are not finite.
    """
    o = observable
    raw: list[Array] = []
    rounding: list[Array] = []
    limit: Limit | None = None
    alive = np.ones(o.starts.count, dtype=bool)
    scale = o.scale
    for found in _rungs(o, rungs):
        value = found[: o.starts.count]
        raw.append(value)
        rounding.append(o.starts.observed_rounding(found))
        alive &= np.isfinite(value).all(axis=1)
        if not alive.any():
            raise BlownUpError(f"no motion is finite, {o.where(0, rungs[len(raw) - 1])}")
        count = len(raw)
        if count < (FIRST_JUDGED if resolution is not None else len(rungs)):
            continue
        known = raw if o.origin is None else [np.where(alive[:, None], v, o.origin) for v in raw]
        if scale is None:
            assert o.origin is not None
            scale = movement(known[-1], o.origin)
        previous = limit
        # Values that start at zero are rounded where they have moved to.
        size = np.maximum(o.rounding_scale, scale)
        alike = o.starts.last_digits(found if o.begun is None else found - o.begun)
        judged = partial(
            limits,
            known,
            rungs[:count],
            o.exponents,
            scale,
            size,
            rounding,
            alike,
            o.starts.epsilon,
        )
        limit = judged()
        if resolution is not None and suffices(limit, previous, count, scale, resolution):
            break
    assert limit is not None
    assert scale is not None
    worst = largest(limit.uncertainty / scale)
    if resolution is not None and worst > resolution and o.origin is None:
        # Where rounding is in the way, other weights of the same rungs amplify it less. Where they
        # don't help either, what is in the way is something else: a motion that is not smooth.
        other = judged(least=True)
        finite = np.isfinite(other.uncertainty).all()
        if finite and largest(other.uncertainty / scale) <= resolution:
            limit = other
    limit.uncertainty[~alive] = np.inf
    used = rungs[: len(raw)]
    return Extrapolated(
        limit=limit, raw=np.stack(raw), rungs=used, steps=sum(used) * len(o.starts.rows)
    )


def _rungs(o: Observable, rungs: Sequence[int]) -> Iterator[Array]:
    """Values (K + 2P, C) of rung after rung, the companions' among them."""
    for rung in rungs:
        found = o.at(rung)
        finite = np.isfinite(found).all(axis=1)
        if o.origin is None and not finite.all():
            where = o.where(int(o.starts.rows[np.argmin(finite)]), rung)
            raise BlownUpError(f"values that are not finite, {where}")
        yield found


def _ends(
    model: Model, coordinates: CoordinateMap, batch: Batch, starts: Starts, left: list[Array]
) -> Observable:
    """The ends of all segments; what each rung leaves of the coordinate map is added to `left`."""

    def at(rung: int) -> Array:
        ends, residual = run_rung(model, coordinates, batch, starts, rung)
        left.append(residual)
        return ends

    def where(row: int, rung: int) -> str:
        length = batch.lengths[row]
        when = "" if batch.times is None else f" at t = {batch.times[row]:.4g} s"
        of = f" of {batch.name!r}" if batch.name else ""
        return f"from the segment{when}{of}, in {rung} steps of {length / rung:.3g} s"

    size = starts.count
    begun = None
    if starts.epsilon > EPSILON:
        begun = coordinates.from_engine(starts.z, starts.w, batch.states[starts.rows])
    return Observable(
        at=at,
        starts=starts,
        exponents=model.exponents(batch.varying),
        rounding_scale=coordinates.rounding_scale(starts.z[:size], starts.w[:size]),
        scale=batch.scale,
        origin=batch.states if batch.partial else None,
        begun=begun,
        where=where,
    )


def run_rung(
    model: Model, coordinates: CoordinateMap, batch: Batch, starts: Starts, rung: int
) -> tuple[Array, Array]:
    """Ends (K + 2P, c) of all segments and companions, in `rung` steps from `starts`.

    With them what they leave of the coordinate map, (K + 2P, 2nz); no columns where that leaves
    nothing open.
    """
    near = batch.states if batch.ends is None else batch.ends
    lengths = batch.lengths[starts.rows]
    ends = np.empty((len(lengths), near.shape[1]))
    residual = np.zeros((len(lengths), 2 * starts.z.shape[1] if coordinates.redundant else 0))
    for length in np.unique(lengths):
        chosen = lengths == length
        rows, z, w = starts.rows[chosen], starts.z[chosen], starts.w[chosen]
        inputs = batch.inputs(rows, rung) * starts.gain[chosen, None, None]
        force = coordinates.force(inputs)
        end_z, end_w = model.rollout(z, w, float(length) / rung, rung, force, rung)
        end_z, end_w = (
            end[:, 0] + unheld(a, starts.epsilon) for end, a in ((end_z, z), (end_w, w))
        )
        ends[chosen] = coordinates.from_engine(end_z, end_w, near[rows])
        if coordinates.redundant:
            residual[chosen] = coordinates.residual(end_z, end_w, ends[chosen])
    return ends, residual


def _residual(
    coordinates: CoordinateMap,
    batch: Batch,
    starts: Starts,
    rungs: tuple[int, ...],
    left: Sequence[Array],
) -> Residual:
    """The limit of what the rungs left of the coordinate map.

    Extrapolated with the exponents 1, 2, 3, ..., which hold whatever the engine claims of a motion:
    what holds a constraint may be of a lower order, and as stiff as the step allows. A constraint
    that holds to the last digits leaves them in no order at all: its rungs have no limit, and are
    near zero. So the uncertainty is never more than what the finest rungs leave themselves.
    """
    assert batch.ends is not None
    count = starts.count
    ends = np.stack(left)[:, :count]
    finite: NDArray[np.bool_] = np.array([np.isfinite(one).all() for one in ends.swapaxes(0, 1)])
    moved = [np.concatenate(coordinates.to_engine(a), axis=1) for a in (batch.ends, batch.states)]
    scale = np.maximum(_held_scale(*moved), _reach(coordinates, batch))
    rounding = coordinates.residual_rounding_scale(starts.z[:count], starts.w[:count])
    limit = limits(
        list(np.where(finite[:, None], ends, 0.0)),
        rungs,
        (1, 1),
        scale,
        np.maximum(rounding, scale),
        [starts.observed_rounding(one) for one in left],
        starts.last_digits(left[-1]),
        starts.epsilon,
    )
    finest = np.max(np.abs(ends[-FINEST:]), axis=0)
    closer = finest < limit.uncertainty
    limit = replace(
        limit,
        value=np.where(closer, ends[-1], limit.value),
        uncertainty=np.where(closer, finest, limit.uncertainty),
    )
    limit.uncertainty[~finite] = np.inf
    return Residual(limit=limit, scale=scale)


def _reach(coordinates: CoordinateMap, batch: Batch) -> Array:
    """How far engine coordinates move where each component moves by what counts as one, (2nz,)."""
    at = np.concatenate(coordinates.to_engine(batch.states), axis=1)
    if batch.scale is None:
        return np.zeros(at.shape[1])
    moved = [
        np.concatenate(coordinates.to_engine(batch.states + step), axis=1) - at
        for step in np.diag(batch.scale)
    ]
    reach: Array = np.max(np.abs(moved), axis=(0, 1))
    return reach


def _held_scale(ends: Array, starts: Array) -> Array:
    """What counts as one of engine coordinates, (2nz,): `movement`, and where the map holds one
    still the largest of its like.
    """
    scale = movement(ends, starts)
    moved = np.max(np.abs(ends - starts), axis=0)
    half = len(scale) // 2
    for part in (slice(0, half), slice(half, None)):
        still = moved[part] <= EPSILON * scale[part]
        scale[part] = np.where(still, np.max(scale[part]), scale[part])
    return scale


def movement(ends: Array, starts: Array) -> Array:
    """What counts as one, (c,): how far each component moves at most, floored by its like."""
    with np.errstate(invalid="ignore"):
        moved = np.abs(ends - starts)
    reach = np.max(np.where(np.isfinite(moved), moved, 0.0), axis=0, initial=0.0)
    half = len(reach) // 2
    return np.concatenate([floored(reach[:half]), floored(reach[half:])])


def floored(sizes: Array) -> Array:
    """Sizes of what is alike, (c,): none below `LEAST_SHARE` of the largest, and nowhere zero."""
    found = np.maximum(sizes, LEAST_SHARE * np.max(sizes, initial=0.0))
    return np.where(found > 0, found, 1.0)


def spread(motion: Motion, picked: int) -> Iterator[tuple[Span, Rows]]:
    """Pick about so many segments evenly, from each span in proportion, at least two: indices."""
    first = 0
    for span in motion.spans:
        count = min(span.count, max(2, round(picked * span.count / len(motion.t))))
        # An even spread, off the ends: a start at rest tells little.
        yield span, first + np.floor((np.arange(count) + 0.5) * span.count / count).astype(np.intp)
        first += span.count
