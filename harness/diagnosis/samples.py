"""What a diagnosis stands on: a few segments of every scenario, and what an engine makes of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from harness.engines.protocol import Model
from harness.numerics.coordinates import CoordinateMap
from harness.numerics.ladder import RUNGS, limits, weights
from harness.numerics.segments import BlownUpError, rounding_scales, run_ends, spread
from reference.motion import Motion
from reference.numeric import Array
from reference.signal import Inputs
from reference.variants import Variants

SEGMENTS_PICKED = 16
"""Segments a scenario: enough to tell some forty causes apart, few enough to move each literal."""

RUNGS_USED = RUNGS[:8]

RUNGS_OF_SLOPES = RUNGS[:4]
"""Enough for a difference between two models that are close: it needs four digits, not nine, and
takes a seventh of the steps."""


@dataclass(frozen=True)
class Sample:
    """Picked segments of one length from one scenario.

    Attributes:
        scenario: its name.
        length: of each segment, seconds.
        t, start, end: start times (B,), states there and where the equations end, (B, 2n).
        inputs: u(t).
        scale: what a defect is relative to, (2n,).
        varying: whether an input changes over time.
        fastest: the fastest rate along the motion, rad/s.
    """

    scenario: str
    length: float
    t: Array
    start: Array
    end: Array
    inputs: Inputs
    scale: Array
    varying: bool
    fastest: float


def sample_segments(
    motions: Mapping[str, Motion], scales: Mapping[str, Array]
) -> tuple[Sample, ...]:
    """Pick segments evenly over every scenario, from each of its spans in proportion."""
    samples = []
    for name, motion in motions.items():
        varying = not all(span.constant_input for span in motion.spans)
        for span, chosen in spread(motion, SEGMENTS_PICKED):
            samples.append(
                Sample(
                    name,
                    span.length,
                    motion.t[chosen],
                    motion.start[chosen],
                    motion.end[chosen],
                    motion.inputs,
                    scales[name],
                    varying,
                    motion.fastest,
                )
            )
    return tuple(samples)


def engine_ends(
    model: Model, coordinates: CoordinateMap, samples: Sequence[Sample]
) -> tuple[Array, Array]:
    """Where an engine ends the segments as h -> 0, with the uncertainty, both scaled and flat.

    Raises:
        BlownUpError: where the engine returns values that are not finite.
    """
    values, uncertainties = [], []
    for sample in samples:
        raw = _raw(model, coordinates, sample, RUNGS_USED)
        z, w = coordinates.to_engine(sample.start)
        grain = rounding_scales(coordinates, z, w, sample.fastest, sample.length)
        found = limits(raw, RUNGS_USED, model.exponents(sample.varying), sample.scale, grain)
        values.append((found.value / sample.scale).ravel())
        uncertainties.append((found.uncertainty / sample.scale).ravel())
    return np.concatenate(values), np.concatenate(uncertainties)


def quick_ends(
    model: Model,
    coordinates: CoordinateMap,
    samples: Sequence[Sample],
    rungs: tuple[int, ...] = RUNGS_USED,
) -> Array:
    """The limits alone, scaled and flat: for differences between two models."""
    values = []
    for sample in samples:
        w = weights(rungs, model.exponents(sample.varying))
        limit = np.tensordot(w, np.stack(_raw(model, coordinates, sample, rungs)), axes=1)
        values.append((limit / sample.scale).ravel())
    return np.concatenate(values)


def _raw(
    model: Model, coordinates: CoordinateMap, sample: Sample, rungs: tuple[int, ...]
) -> list[Array]:
    z, w = coordinates.to_engine(sample.start)
    raw = []
    for rung in rungs:
        h = sample.length / rung
        times = sample.t[:, None] + h * np.arange(rung)
        u = sample.inputs(times.ravel(), slack=h / 4).reshape(len(sample.t), rung, -1)
        ends = run_ends(model, coordinates, z, w, h, rung, u, sample.end)
        if not np.isfinite(ends).all():
            raise BlownUpError(f"values that are not finite, in {sample.scenario!r}")
        raw.append(ends)
    return raw


def reference_ends(samples: Sequence[Sample]) -> Array:
    """Where the equations end the segments, scaled and flat."""
    return np.concatenate([(sample.end / sample.scale).ravel() for sample in samples])


def variant_ends(variants: Variants, points: Array, samples: Sequence[Sample]) -> Array:
    """Where the equations end the segments at other parameters: points (K, P) -> (K, N)."""
    parts = []
    for sample in samples:
        ends = variants.flows(points, sample.t, sample.start, sample.length, sample.inputs)
        parts.append((ends / sample.scale).reshape(len(points), -1))
    return np.concatenate(parts, axis=1)
