"""What a diagnosis stands on: a few segments of every scenario, and what an engine makes of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from physics_crosscheck.harness.engines.protocol import Model
from physics_crosscheck.harness.numerics.batch import Batch, over, pick_segments
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.ladder import EPSILON, RUNGS
from physics_crosscheck.harness.numerics.segments import extrapolate, limits_only
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.signal import Inputs
from physics_crosscheck.reference.solving.motion import Motion
from physics_crosscheck.reference.solving.variants import Variants

SEGMENTS_PICKED = 16
"""Segments a scenario: enough to tell some forty causes apart, few enough to move each literal."""

RUNGS_USED = RUNGS[:8]

RUNGS_OF_SLOPES = RUNGS[:4]
"""Enough for a difference between two models that are close: it needs four digits, not nine, and
takes a seventh of the steps."""


@dataclass(frozen=True, kw_only=True)
class Sample:
    """Picked segments of one length from one scenario.

    Attributes:
        scenario: its name.
        length: of each segment, seconds.
        t, start, end: start times (B,), states there and where the equations end, (B, 2n).
        inputs: u(t).
        scale: what a defect is relative to, (2n,).
        varying: whether an input changes over time.
    """

    scenario: str
    length: float
    t: Array
    start: Array
    end: Array
    inputs: Inputs
    scale: Array
    varying: bool


def sample_segments(
    motions: Mapping[str, Motion], scales: Mapping[str, Array]
) -> tuple[Sample, ...]:
    """Pick segments evenly over every scenario, from each of its spans in proportion."""
    samples = []
    for name, motion in motions.items():
        for span, chosen in pick_segments(motion, SEGMENTS_PICKED):
            samples.append(
                Sample(
                    scenario=name,
                    length=span.length,
                    t=motion.t[chosen],
                    start=motion.start[chosen],
                    end=motion.end[chosen],
                    inputs=motion.inputs,
                    scale=scales[name],
                    varying=motion.varying,
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
    for batch, scale in _batches(samples):
        found = extrapolate(model, coordinates, batch, rungs=RUNGS_USED).limit
        values.append((found.value / scale).ravel())
        uncertainties.append((found.uncertainty / scale).ravel())
    return np.concatenate(values), np.concatenate(uncertainties)


def freedoms(
    model: Model, coordinates: CoordinateMap, samples: Sequence[Sample]
) -> tuple[str, ...]:
    """The engine's coordinates that leave the coordinate map, where the equations hold them.

    Raises:
        BlownUpError: where the engine returns values that are not finite.
    """
    names, free = tuple(model.coordinates), set[int]()
    for batch, _ in _batches(samples):
        found = extrapolate(model, coordinates, batch, rungs=RUNGS_USED).residual
        if found is None:
            return ()
        limit = found.limit
        known = np.maximum(limit.uncertainty, EPSILON * found.scale)
        columns = np.flatnonzero((np.abs(limit.value) > known).any(axis=0))
        free |= {int(column) % len(names) for column in columns}
    return tuple(names[i] for i in sorted(free))


def quick_ends(
    model: Model,
    coordinates: CoordinateMap,
    samples: Sequence[Sample],
    rungs: tuple[int, ...] = RUNGS_USED,
) -> Array:
    """The limits alone, scaled and flat: for differences between two models."""
    return np.concatenate(
        [
            (limits_only(model, coordinates, batch, rungs) / scale).ravel()
            for batch, scale in _batches(samples)
        ]
    )


def _batches(samples: Sequence[Sample]) -> Iterator[tuple[Batch, Array]]:
    """The segments of each scenario together, in the order of the samples, with their scale."""
    for name, group in groupby(samples, key=lambda sample: sample.scenario):
        of = list(group)
        t = np.concatenate([sample.t for sample in of])
        lengths = np.concatenate([np.full(len(sample.t), sample.length) for sample in of])
        batch = Batch(
            states=np.concatenate([sample.start for sample in of]),
            lengths=lengths,
            inputs=over(of[0].inputs, t, lengths),
            varying=of[0].varying,
            scale=of[0].scale,
            ends=np.concatenate([sample.end for sample in of]),
            times=t,
            name=name,
        )
        yield batch, of[0].scale


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
