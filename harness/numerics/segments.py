"""Extrapolated segments: an engine's motion from given states, as h -> 0.

All knowledge of an engine's motion over a segment comes from here. `climb` runs one rung after
another and takes the limit, of ends for `extrapolate`, and of velocity changes for
`harness.numerics.accelerations`. It observes the rounding on every rung.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from physics_crosscheck.harness.engines.protocol import LoadedModel
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.segments import Segments
from .coordinates import CoordinateMap
from .ladder import (
    EPSILON,
    FIRST_JUDGED,
    ODD_RUNGS,
    RUNGS,
    ExtrapolatedLimit,
    largest,
    limits,
    movement,
    suffices,
    weights,
)
from .residual import Residual, residual_of
from .rounding import Starts, quantization_error, with_companions, without_companions


class BlownUpError(RuntimeError):
    """An engine returned values that are not finite."""

    kind = "not finite"


class MisplacedEventError(RuntimeError):
    """An event within a segment, but not in its middle: coarse rungs miss it and agree falsely."""

    kind = "event"


CENTRED = 1e-9
"""Largest distance of an event from the middle of its segment, relative to the segment."""


def _rungs_of(segments: Segments, rungs: tuple[int, ...]) -> tuple[int, ...]:
    """Return the rungs, or as many odd ones for segments with events.

    Raises:
        MisplacedEventError: if an event is elsewhere in a segment than in its middle.
    """
    if not segments.events or all(rung % 2 for rung in rungs):
        return rungs
    odd = ODD_RUNGS[: len(rungs)]
    check_events(segments, min(odd))
    return odd


def check_events(segments: Segments, coarsest: int) -> None:
    """Check that each event is in the middle of a segment, or a coarsest step away from all.

    Args:
        segments: the segments.
        coarsest: smallest number of steps of a segment.

    Raises:
        MisplacedEventError: naming the event and the segment.
    """
    for event in segments.events:
        offset = np.abs(event - segments.t - segments.lengths / 2) / segments.lengths
        near = (offset > CENTRED) & (offset < 0.5 + (1 - 1e-9) / coarsest)
        if near.any():
            row = int(np.argmax(near))
            raise MisplacedEventError(
                f"the segment at t = {segments.t[row]:.6g} s has an event off its middle, at "
                f"t = {event:.6g} s; coarse steps would agree falsely; centre it, or keep "
                f"{segments.lengths[row] / coarsest:.2g} s away"
            )


@dataclass(frozen=True, kw_only=True)
class Extrapolated:
    """Extrapolated ends of segments.

    Attributes:
        limit: the engine's end of each segment as h -> 0, with its uncertainty.
        raw: ends at each rung, (M, K, c).
        rungs: step counts of `raw`.
        steps: number of engine steps, including companions.
        residual: of the coordinate map; None if the map is one to one.
    """

    limit: ExtrapolatedLimit
    raw: Array
    rungs: tuple[int, ...]
    steps: int
    residual: Residual | None = None


@dataclass(frozen=True, kw_only=True)
class Observable:
    """A quantity measured on every rung, of K starts and their companions; C components.

    Attributes:
        values: its values (K + 2P, C) for a number of steps.
        starts: the starts.
        exponents: leading exponent of h and increment.
        rounding_scale: magnitude that rounding is relative to, (C,).
        scale: unit of relative errors, (C,); None for the distance of the values from `origin`.
        origin: values at the start, (K, C), which replace those that are not finite; None if all
            values must be finite.
        initial: initial values of all starts, (K + 2P, C), for an engine with fewer digits than
            doubles; its rounding is added to them.
        centred: whether each start has an event in the middle of its segment, (K,); None: none has.
        lost: errors of values on a rung that do not follow powers of h, (F, K), for F rates;
            None without any.
        where: describes a start, by its segment and the rung, for a message.
    """

    values: Callable[[int], Array]
    starts: Starts
    exponents: tuple[int, int]
    rounding_scale: Array
    scale: Array | None
    origin: Array | None = None
    initial: Array | None = None
    centred: Array | None = None
    lost: Callable[[int], Array] | None = None
    where: Callable[[int, int], str]


def extrapolate(
    model: LoadedModel,
    coordinates: CoordinateMap,
    segments: Segments,
    *,
    rungs: tuple[int, ...] = RUNGS,
    resolution: float | None = None,
    partial: bool = False,
) -> Extrapolated:
    """Run every segment on one rung after another, and take the limit.

    Segments with events take odd numbers of steps, which meet an event in the middle of a step.
    With a resolution, only as many rungs are run as it needs. Segments that are not finite only
    lose their own limit if `partial`.

    Raises:
        BlownUpError: if the engine returns values that are not finite.
        MisplacedEventError: if an event is elsewhere in a segment.
    """
    rungs = _rungs_of(segments, rungs)
    positions = coordinates.to_engine(segments.start)
    starts = with_companions(*positions, model.epsilon, every=segments.nonsmooth)
    residuals: list[Array] = []
    observable = _ends(model, coordinates, segments, starts, residuals)
    if partial:
        observable = replace(observable, origin=segments.start)
    result = climb(observable, rungs, resolution)
    if observable.centred is not None:
        result = _with_finer_run(model, coordinates, segments, observable, result)
    if not (segments.bounded and coordinates.redundant):
        return result
    return replace(
        result, residual=residual_of(coordinates, segments, starts, result.rungs, residuals)
    )


FINER = 243
"""Steps of a run that checks limits through events, odd and three times the finest rung. An engine
may keep a mode, such as a slip, that only finer steps end; then all rungs agree falsely."""

FINER_MISS = 10.0
"""Uncertainties by which that run may miss the value that the rungs predict for it."""


def _with_finer_run(
    model: LoadedModel,
    coordinates: CoordinateMap,
    segments: Segments,
    observable: Observable,
    result: Extrapolated,
) -> Extrapolated:
    """Make limits through events uncertain if their rungs do not predict a finer run."""
    assert observable.centred is not None
    rows = np.flatnonzero(observable.centred)
    some = segments.pick(rows)
    starts = without_companions(*coordinates.to_engine(some.start))
    ends, _ = run_rung(model, coordinates, some, starts, FINER)
    limit = result.limit
    used = [result.rungs.index(rung) for rung in limit.rungs]
    prediction = weights(limit.rungs, observable.exponents, FINER)
    predicted = np.tensordot(prediction, result.raw[used][:, rows], axes=1)
    fits = np.abs(ends - predicted) <= FINER_MISS * limit.uncertainty[rows]
    limit.uncertainty[rows] = np.where(fits, limit.uncertainty[rows], np.inf)
    return replace(result, steps=result.steps + FINER * len(rows))


def limits_only(
    model: LoadedModel, coordinates: CoordinateMap, segments: Segments, rungs: tuple[int, ...]
) -> Array:
    """Return the limits (K, c) of segments without uncertainty, for differences of close models.

    Raises:
        BlownUpError: if the engine returns values that are not finite.
    """
    rungs = _rungs_of(segments, rungs)
    starts = without_companions(*coordinates.to_engine(segments.start))
    observable = _ends(model, coordinates, segments, starts, [])
    values = list(_rungs(observable, rungs))  # there are no companions
    limit: Array = np.tensordot(weights(rungs, observable.exponents), np.stack(values), axes=1)
    return limit


def climb(
    observable: Observable, rungs: tuple[int, ...], resolution: float | None = None
) -> Extrapolated:
    """Return the limit of an observable, over all rungs or as many as the resolution needs.

    Raises:
        BlownUpError: if its values are not finite.
    """
    o = observable
    raw: list[Array] = []
    rounding: list[Array] = []
    limit: ExtrapolatedLimit | None = None
    alive = np.ones(o.starts.count, dtype=bool)
    scale = o.scale
    for values in _rungs(o, rungs):
        value = values[: o.starts.count]
        raw.append(value)
        rounding.append(o.starts.observed_rounding(values))
        alive &= np.isfinite(value).all(axis=1)
        if not alive.any():
            raise BlownUpError(f"no motion is finite, {o.where(0, rungs[len(raw) - 1])}")
        count = len(raw)
        if count < (FIRST_JUDGED if resolution is not None else len(rungs)):
            continue
        finite_values = (
            raw if o.origin is None else [np.where(alive[:, None], v, o.origin) for v in raw]
        )
        if scale is None:
            assert o.origin is not None
            scale = movement(finite_values[-1], o.origin)
        previous = limit
        # Rounding of values that start at zero is relative to their movement.
        size = np.maximum(o.rounding_scale, scale)
        alike = o.starts.last_digits(values if o.initial is None else values - o.initial)
        judged = partial(
            limits,
            exponents=o.exponents,
            scale=scale,
            rounding_scale=size,
            rounded_alike=alike,
            epsilon=o.starts.epsilon,
            apart=o.centred,
        )
        limit = judged(finite_values, rungs[:count], observed_rounding=rounding)
        if resolution is not None and suffices(limit, previous, count, scale, resolution):
            break
    assert limit is not None
    assert scale is not None

    def judge(first: int, least: bool) -> ExtrapolatedLimit:
        return judged(
            finite_values[first:],
            rungs[first:count],
            observed_rounding=rounding[first:],
            least=least,
        )

    if resolution is not None:
        limit = _reweighted(o, limit, judge, scale, resolution)
    if o.lost is not None:
        errors = np.stack([o.lost(rung) for rung in limit.rungs])
        shift = np.abs(np.tensordot(weights(limit.rungs, o.exponents), errors, axes=1))
        limit.uncertainty[:] += np.max(shift, axis=0)[:, None]
    limit.uncertainty[~alive] = np.inf
    used = rungs[: len(raw)]
    return Extrapolated(
        limit=limit, raw=np.stack(raw), rungs=used, steps=sum(used) * len(o.starts.rows)
    )


def lost_turns(model: LoadedModel, rates: Array, h: Array | float) -> Array:
    """Return the rotation that a step loses at rates of rotation, rad/s; rad, of equal shapes.

    Some rungs lose it and others do not, so that it does not vanish by extrapolation.
    """
    turn = rates * h
    lost: Array = np.where(turn < model.lost_turn, turn**3 / 6, 0.0)
    return lost


def spread(first: Array, last: Array) -> Array:
    """Return rates between two, (K,) each, and somewhat beyond, (F, K)."""
    return np.abs(np.linspace(1.25 * first - 0.25 * last, 1.25 * last - 0.25 * first, 7))


def _reweighted(
    o: Observable,
    limit: ExtrapolatedLimit,
    judge: Callable[[int, bool], ExtrapolatedLimit],
    scale: Array,
    resolution: float,
) -> ExtrapolatedLimit:
    """Return a limit, or one of the same runs that resolves more segments."""
    # An engine may meet an event some steps early or late, more than a coarse rung has.
    omitted = len(limit.increments) + 1 - FIRST_JUDGED if o.centred is not None else 0
    for first in range(1, omitted + 1):
        if not _coarse(limit, scale, resolution):
            break
        other = judge(first, False)
        if _coarse(other, scale, resolution) < _coarse(limit, scale, resolution):
            limit = other
    if largest(limit.uncertainty / scale) > resolution and o.origin is None:
        # Where rounding dominates, other weights of the same rungs amplify it less. If they do not
        # help, the cause is different, such as a motion that is not smooth.
        other = judge(0, True)
        finite = np.isfinite(other.uncertainty).all()
        if finite and largest(other.uncertainty / scale) <= resolution:
            limit = other
    return limit


def _coarse(limit: ExtrapolatedLimit, scale: Array, resolution: float) -> int:
    return int(np.sum((limit.uncertainty / scale > resolution).any(axis=1)))


def _rungs(o: Observable, rungs: Sequence[int]) -> Iterator[Array]:
    """Yield the values (K + 2P, C) of one rung after another, companions included."""
    for rung in rungs:
        values = o.values(rung)
        finite = np.isfinite(values).all(axis=1)
        if o.origin is None and not finite.all():
            where = o.where(int(o.starts.rows[np.argmin(finite)]), rung)
            raise BlownUpError(f"values that are not finite, {where}")
        yield values


def _ends(
    model: LoadedModel,
    coordinates: CoordinateMap,
    segments: Segments,
    starts: Starts,
    residuals: list[Array],
) -> Observable:
    """Return the segments' ends as an observable; each rung appends its residual to `residuals`."""

    def ends_at(rung: int) -> Array:
        ends, residual = run_rung(model, coordinates, segments, starts, rung)
        residuals.append(residual)
        return ends

    def where(row: int, rung: int) -> str:
        length = segments.lengths[row]
        time = segments.t[row]
        when = "" if np.isnan(time) else f" at t = {time:.4g} s"
        scenario = f" of {segments.name!r}" if segments.name else ""
        return f"from the segment{when}{scenario}, in {rung} steps of {length / rung:.3g} s"

    size = starts.count
    middle = segments.t + segments.lengths / 2
    centred = None
    if segments.events:
        offset = np.abs(np.array(segments.events)[:, None] - middle).min(axis=0)
        centred = offset <= CENTRED * segments.lengths
    initial = None
    if starts.epsilon > EPSILON:
        initial = coordinates.from_engine(starts.z, starts.w, segments.start[starts.rows])
    return Observable(
        values=ends_at,
        starts=starts,
        exponents=model.exponents(segments.varying),
        rounding_scale=coordinates.rounding_scale(starts.z[:size], starts.w[:size]),
        scale=segments.scale,
        initial=initial,
        centred=centred,
        lost=_lost_by(model, coordinates, segments) if model.lost_turn else None,
        where=where,
    )


def _lost_by(
    model: LoadedModel, coordinates: CoordinateMap, segments: Segments
) -> Callable[[int], Array]:
    states = segments.start, segments.end
    rates = spread(*(model.turning_rates(*coordinates.to_engine(one)) for one in states))

    def lost(rung: int) -> Array:
        each = lost_turns(model, rates, segments.lengths / rung)
        total: Array = rung * each * np.maximum(rates, 1.0)
        return total

    return lost


def run_rung(
    model: LoadedModel, coordinates: CoordinateMap, segments: Segments, starts: Starts, rung: int
) -> tuple[Array, Array]:
    """Return the ends (K + 2P, c) of all segments and companions, after `rung` steps.

    The second value is their residual of the coordinate map, (K + 2P, 2nz), or without columns if
    the map is one to one.
    """
    lengths = segments.lengths[starts.rows]
    ends = np.empty((len(lengths), segments.end.shape[1]))
    residual = np.zeros((len(lengths), 2 * starts.z.shape[1] if coordinates.redundant else 0))
    for length in np.unique(lengths):
        chosen = lengths == length
        rows, z, w = starts.rows[chosen], starts.z[chosen], starts.w[chosen]
        inputs = segments.step_inputs(rows, rung) * starts.gain[chosen, None, None]
        force = coordinates.force(inputs)
        end_z, end_w = model.rollout(z, w, float(length) / rung, rung, force, rung)
        end_z, end_w = (
            end[:, 0] + quantization_error(a, starts.epsilon) for end, a in ((end_z, z), (end_w, w))
        )
        ends[chosen] = coordinates.from_engine(end_z, end_w, segments.end[rows])
        if coordinates.redundant:
            residual[chosen] = coordinates.residual(end_z, end_w, ends[chosen])
    return ends, residual
