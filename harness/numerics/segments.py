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

from physics_crosscheck.harness.engines.protocol import Model
from physics_crosscheck.harness.numerics.batch import Batch, movement
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.ladder import (
    EPSILON,
    FIRST_JUDGED,
    RUNGS,
    Limit,
    largest,
    limits,
    suffices,
    weights,
)
from physics_crosscheck.harness.numerics.residual import Residual, residual_of
from physics_crosscheck.harness.numerics.rounding import (
    Starts,
    unheld,
    with_companions,
    without_companions,
)
from physics_crosscheck.reference.mechanism.numeric import Array


class BlownUpError(RuntimeError):
    """An engine returned values that are not finite."""

    kind = "not finite"


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
    at = coordinates.to_engine(batch.states)
    starts = with_companions(*at, model.epsilon, every=batch.uneven)
    left: list[Array] = []
    observable = _ends(model, coordinates, batch, starts, left)
    found = climb(observable, rungs, resolution)
    if batch.ends is None or not coordinates.redundant:
        return found
    return replace(found, residual=residual_of(coordinates, batch, starts, found.rungs, left))


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
