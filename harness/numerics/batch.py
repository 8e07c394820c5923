"""Segments that are to be run, and what counts as one in what comes of them."""

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
"""Inputs over chosen segments, at the starts of so many equal steps: (B, steps, inputs)."""

LEAST_SHARE = 1e-3
"""A component that moves less than this share of the one that moves most is measured against it."""


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
        uneven: whether rounding differs much from segment to segment, as under a drag, which grows
            with the square of a velocity: each segment has companions of its own.
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
    uneven: bool = False
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


def spread(motion: Motion, picked: int) -> Iterator[tuple[Span, Rows]]:
    """Pick about so many segments evenly, from each span in proportion, at least two: indices."""
    first = 0
    for span in motion.spans:
        count = min(span.count, max(2, round(picked * span.count / len(motion.t))))
        # An even spread, off the ends: a start at rest tells little.
        yield span, first + np.floor((np.arange(count) + 0.5) * span.count / count).astype(np.intp)
        first += span.count


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
