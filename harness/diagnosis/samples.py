"""Samples of a diagnosis: a few segments of each scenario, and the engine's end states."""

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
"""Segments per scenario: they distinguish about forty causes, and each literal can be varied."""

RUNGS_USED = RUNGS[:8]

RUNGS_OF_SLOPES = RUNGS[:4]
"""Rungs for a difference between two similar models: it needs four digits, not nine.

These rungs take a seventh of the steps.
"""


@dataclass(frozen=True, kw_only=True)
class SegmentSample:
    """Some segments of one length from one scenario.

    Attributes:
        scenario: its name.
        length: of each segment, seconds.
        t, start, end: start times (B,), states there and end states of the equations, (B, 2n).
        inputs: u(t).
        scale: of a defect, (2n,).
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
) -> tuple[SegmentSample, ...]:
    """Pick segments evenly from each scenario, in proportion from each of its spans."""
    samples = []
    for name, motion in motions.items():
        for span, chosen in pick_segments(motion, SEGMENTS_PICKED):
            samples.append(
                SegmentSample(
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
    model: Model, coordinates: CoordinateMap, samples: Sequence[SegmentSample]
) -> tuple[Array, Array]:
    """Return the engine's end states as h -> 0 and their uncertainty, both scaled and flat.

    Raises:
        BlownUpError: if the engine returns values that are not finite.
    """
    values, uncertainties = [], []
    for batch, scale in _batches(samples):
        limit = extrapolate(model, coordinates, batch, rungs=RUNGS_USED).limit
        values.append((limit.value / scale).ravel())
        uncertainties.append((limit.uncertainty / scale).ravel())
    return np.concatenate(values), np.concatenate(uncertainties)


def freedoms(
    model: Model, coordinates: CoordinateMap, samples: Sequence[SegmentSample]
) -> tuple[str, ...]:
    """Return engine coordinates that leave the coordinate map, though the equations fix them.

    Raises:
        BlownUpError: if the engine returns values that are not finite.
    """
    names, free = tuple(model.coordinates), set[int]()
    for batch, _ in _batches(samples):
        residual = extrapolate(model, coordinates, batch, rungs=RUNGS_USED).residual
        if residual is None:
            return ()
        limit = residual.limit
        uncertainty = np.maximum(limit.uncertainty, EPSILON * residual.scale)
        columns = np.flatnonzero((np.abs(limit.value) > uncertainty).any(axis=0))
        free |= {int(column) % len(names) for column in columns}
    return tuple(names[i] for i in sorted(free))


def quick_ends(
    model: Model,
    coordinates: CoordinateMap,
    samples: Sequence[SegmentSample],
    rungs: tuple[int, ...] = RUNGS_USED,
) -> Array:
    """Return only the limits, scaled and flat, for differences between two models."""
    return np.concatenate(
        [
            (limits_only(model, coordinates, batch, rungs) / scale).ravel()
            for batch, scale in _batches(samples)
        ]
    )


def _batches(samples: Sequence[SegmentSample]) -> Iterator[tuple[Batch, Array]]:
    """Yield the segments of each scenario together, in the order of the samples, and scale."""
    for name, group in groupby(samples, key=lambda sample: sample.scenario):
        members = list(group)
        t = np.concatenate([sample.t for sample in members])
        lengths = np.concatenate([np.full(len(sample.t), sample.length) for sample in members])
        batch = Batch(
            states=np.concatenate([sample.start for sample in members]),
            lengths=lengths,
            inputs=over(members[0].inputs, t, lengths),
            varying=members[0].varying,
            scale=members[0].scale,
            ends=np.concatenate([sample.end for sample in members]),
            times=t,
            name=name,
        )
        yield batch, members[0].scale


def reference_ends(samples: Sequence[SegmentSample]) -> Array:
    """Return the end states of the equations, scaled and flat."""
    return np.concatenate([(sample.end / sample.scale).ravel() for sample in samples])


def variant_ends(variants: Variants, points: Array, samples: Sequence[SegmentSample]) -> Array:
    """Return end states of the equations at other parameters: points (K, P) -> (K, N)."""
    parts = []
    for sample in samples:
        ends = variants.flows(points, sample.t, sample.start, sample.length, sample.inputs)
        parts.append((ends / sample.scale).reshape(len(points), -1))
    return np.concatenate(parts, axis=1)
