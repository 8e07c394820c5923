"""Segments to be run, and the units of their relative errors."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.signal import Inputs
from physics_crosscheck.reference.solving.motion import Motion, Span

Rows = NDArray[np.intp]
StepInputs = Callable[[Rows, int], Array]
"""Inputs over chosen segments, at the starts of `steps` equal steps: (B, steps, inputs)."""

LEAST_SHARE = 1e-3
"""Smallest unit of a component's relative error, as a share of the largest movement."""


@dataclass(frozen=True, kw_only=True)
class Batch:
    """K segments to be run, in a system's coordinates; c = 2n components.

    Attributes:
        states: start states, (K, c).
        lengths: seconds per segment, (K,).
        inputs: inputs over each segment.
        varying: whether an input changes over a segment; it is constant over each step.
        scale: unit of relative errors, per component, (c,); None for the movement of the runs.
        ends: approximate ends, (K, c), near which angles are unwrapped; None for the starts.
        times: start times, (K,).
        name: name of the scenario, for messages.
        uneven: whether rounding differs much between segments, as under a drag quadratic in the
            velocity; each segment then has its own companions.
        partial: whether segments that are not finite only lose their own limit.
    """

    states: Array
    lengths: Array
    inputs: StepInputs
    varying: bool
    scale: Array | None
    ends: Array | None = None
    times: Array | None = None
    name: str = ""
    uneven: bool = False
    partial: bool = False

    @staticmethod
    def of_motion(motion: Motion, scale: Array) -> Batch:
        """Return all segments of a motion."""
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
    """Return inputs u(t) of a scenario, over segments that start at times t, (K,)."""

    def step_inputs(rows: Rows, steps: int) -> Array:
        h = lengths[rows, None] / steps
        times = t[rows, None] + h * np.arange(steps)
        values = inputs(times.ravel(), slack=float(np.min(h)) / 4)
        return values.reshape(len(rows), steps, -1)

    return step_inputs


def held(values: Array) -> StepInputs:
    """Return inputs (K, m) that are constant over each segment."""

    def step_inputs(rows: Rows, steps: int) -> Array:
        return np.repeat(values[rows, None, :], steps, axis=1)

    return step_inputs


def pick_segments(motion: Motion, picked: int) -> Iterator[tuple[Span, Rows]]:
    """Yield evenly spaced segment indices per span, in proportion, at least two each."""
    first = 0
    for span in motion.spans:
        count = min(span.count, max(2, round(picked * span.count / len(motion.t))))
        # Spread evenly, away from the ends, since a start at rest is not informative.
        yield span, first + np.floor((np.arange(count) + 0.5) * span.count / count).astype(np.intp)
        first += span.count


def movement(ends: Array, starts: Array) -> Array:
    """Return the unit of relative errors, (c,): the largest movement, floored by its kind."""
    with np.errstate(invalid="ignore"):
        moved = np.abs(ends - starts)
    largest = np.max(np.where(np.isfinite(moved), moved, 0.0), axis=0, initial=0.0)
    half = len(largest) // 2
    return np.concatenate([floored(largest[:half]), floored(largest[half:])])


def floored(sizes: Array) -> Array:
    """Return sizes (c,), none below `LEAST_SHARE` of the largest, and nowhere zero."""
    result = np.maximum(sizes, LEAST_SHARE * np.max(sizes, initial=0.0))
    return np.where(result > 0, result, 1.0)


def even_indices(count: int, limit: int) -> Rows:
    """Return at most `limit` evenly spaced indices of `count`, including the first and the last."""
    return np.unique(np.linspace(0, count - 1, limit).astype(np.intp))
