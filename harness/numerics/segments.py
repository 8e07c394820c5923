"""The extrapolated segment: what an engine makes of the reference's states, as h -> 0."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harness.engines.protocol import Model
from harness.numerics.coordinates import CoordinateMap
from harness.numerics.ladder import FIRST_JUDGED, RUNGS, Limit, limits, suffices
from harness.numerics.rounding import Starts, with_companions
from reference.motion import Motion, Span
from reference.numeric import Array


class BlownUpError(RuntimeError):
    """An engine returned values that are not finite."""


@dataclass(frozen=True)
class Extrapolated:
    """Every segment of a motion, extrapolated.

    Attributes:
        limit: where the engine ends each segment as h -> 0, with its uncertainty.
        raw: ends at each rung, (M, K, 2n).
        rungs: step counts of `raw`.
        steps: engine steps taken, the companions' included.
    """

    limit: Limit
    raw: Array
    rungs: tuple[int, ...]
    steps: int


def extrapolate(
    model: Model, coordinates: CoordinateMap, motion: Motion, scale: Array, resolution: float
) -> Extrapolated:
    """Run every segment of a motion on rung after rung, and take the limit.

    Raises:
        BlownUpError: where the engine returns values that are not finite.
    """
    varying = not all(span.constant_input for span in motion.spans)
    exponents = model.exponents(varying)
    z, w = coordinates.to_engine(motion.start)
    grain = coordinates.grain(z, w)
    starts = with_companions(z, w)
    values: list[Array] = []
    seen: list[Array] = []
    steps = 0
    limit: Limit | None = None
    for count, rung in enumerate(RUNGS, start=1):
        ends = run_rung(model, coordinates, motion, starts, rung)
        if not np.isfinite(ends).all():
            raise BlownUpError(_where(motion, starts, ends, rung))
        values.append(ends[: len(z)])
        seen.append(starts.seen(ends))
        steps += rung * len(ends)
        if count < FIRST_JUDGED:
            continue
        previous = limit
        limit = limits(values, RUNGS[:count], exponents, scale, grain, seen)
        if suffices(limit, previous, count, scale, resolution):
            break
    assert limit is not None
    return Extrapolated(limit, np.stack(values), RUNGS[: len(values)], steps)


def spread(motion: Motion, picked: int) -> Iterator[tuple[Span, NDArray[np.intp]]]:
    """Pick about so many segments evenly, from each span in proportion, at least two: indices."""
    first = 0
    for span in motion.spans:
        count = min(span.count, max(2, round(picked * span.count / len(motion.t))))
        # An even spread, off the ends: a start at rest tells little.
        yield span, first + np.floor((np.arange(count) + 0.5) * span.count / count).astype(np.intp)
        first += span.count


def rounding_scales(
    coordinates: CoordinateMap, z: Array, w: Array, fastest: float, length: float
) -> Array:
    """How far one unit of relative rounding moves each component over a segment, (2n,)."""
    grain = coordinates.grain(z, w)
    # A velocity is moved by what rounding the positions does to the forces.
    n = len(grain) // 2
    grain[n:] += grain[:n] * fastest**2 * length
    return grain


def run_rung(
    model: Model, coordinates: CoordinateMap, motion: Motion, starts: Starts, rung: int
) -> Array:
    """Ends (K + 2 PAIRS, 2n) of all segments and companions, in `rung` steps from `starts`."""
    rows = starts.rows
    ends = np.empty((len(rows), motion.end.shape[1]))
    first = 0
    for span in motion.spans:
        chosen = (first <= rows) & (rows < first + span.count)
        first += span.count
        own = rows[chosen]
        h = span.length / rung
        times = motion.t[own, None] + h * np.arange(rung)
        inputs = motion.inputs(times.ravel(), slack=h / 4).reshape(len(own), rung, -1)
        ends[chosen] = run_ends(
            model,
            coordinates,
            starts.z[chosen],
            starts.w[chosen],
            h,
            rung,
            inputs,
            motion.end[own],
        )
    return ends


def run_ends(
    model: Model,
    coordinates: CoordinateMap,
    z: Array,
    w: Array,
    h: float,
    rung: int,
    inputs: Array,
    near: Array,
) -> Array:
    """Ends (B, 2n) of B runs of `rung` steps; inputs are (B, rung, inputs), angles near `near`."""
    end_z, end_w = model.rollout(z, w, h, rung, coordinates.force(inputs), rung)
    return coordinates.from_engine(end_z[:, 0], end_w[:, 0], near)


def _where(motion: Motion, starts: Starts, ends: Array, rung: int) -> str:
    bad = int(starts.rows[np.argmin(np.isfinite(ends).all(axis=1))])
    return (
        f"values that are not finite, from the segment at t = {motion.t[bad]:.4g} s,"
        f" in {rung} steps of {motion.lengths[bad] / rung:.3g} s"
    )
