"""Samples of a diagnosis: a few segments of each scenario, and the engine's end states."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from physics_crosscheck.harness.engines.protocol import LoadedModel
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.ladder import EPSILON, RUNGS
from physics_crosscheck.harness.numerics.segments import extrapolate, limits_only
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.segments import Motion, Segments
from physics_crosscheck.reference.solving.variants import Variants

SEGMENTS_PICKED = 16
"""Segments per scenario: they distinguish about forty causes, and each literal can be varied."""

RUNGS_USED = RUNGS[:8]

RUNGS_OF_SLOPES = RUNGS[:4]
"""Rungs for a difference between two similar models: it needs four digits, not nine.

These rungs take a seventh of the steps.
"""


def sample_segments(motions: Mapping[str, Motion]) -> tuple[Segments, ...]:
    """Pick segments evenly from each scenario, in proportion from each of its spans."""
    return tuple(
        replace(motion.pick(motion.informative(SEGMENTS_PICKED)), name=name)
        for name, motion in motions.items()
    )


def engine_ends(
    model: LoadedModel, coordinates: CoordinateMap, samples: Sequence[Segments]
) -> tuple[Array, Array]:
    """Return the engine's end states as h -> 0 and their uncertainty, both scaled and flat.

    Raises:
        BlownUpError: if the engine returns values that are not finite.
    """
    values, uncertainties = [], []
    for some in samples:
        limit = extrapolate(model, coordinates, some, rungs=RUNGS_USED).limit
        values.append((limit.value / some.unit).ravel())
        uncertainties.append((limit.uncertainty / some.unit).ravel())
    return np.concatenate(values), np.concatenate(uncertainties)


def finite(uncertainty: Array, discrepancy: Array) -> Array:
    """Return uncertainties; those of unknown limits are as large as the largest discrepancy."""
    return np.where(np.isfinite(uncertainty), uncertainty, np.max(np.abs(discrepancy)))


def freedoms(
    model: LoadedModel, coordinates: CoordinateMap, samples: Sequence[Segments]
) -> tuple[str, ...]:
    """Return engine coordinates that leave the coordinate map, though the equations fix them.

    Raises:
        BlownUpError: if the engine returns values that are not finite.
    """
    names, free = tuple(model.coordinates), set[int]()
    for some in samples:
        residual = extrapolate(model, coordinates, some, rungs=RUNGS_USED).residual
        if residual is None:
            return ()
        limit = residual.limit
        uncertainty = np.maximum(limit.uncertainty, EPSILON * residual.scale)
        columns = np.flatnonzero((np.abs(limit.value) > uncertainty).any(axis=0))
        free |= {int(column) % len(names) for column in columns}
    return tuple(names[i] for i in sorted(free))


def quick_ends(
    model: LoadedModel,
    coordinates: CoordinateMap,
    samples: Sequence[Segments],
    rungs: tuple[int, ...] = RUNGS_USED,
) -> Array:
    """Return only the limits, scaled and flat, for differences between two models."""
    return np.concatenate(
        [(limits_only(model, coordinates, some, rungs) / some.unit).ravel() for some in samples]
    )


def reference_ends(samples: Sequence[Segments]) -> Array:
    """Return the end states of the equations, scaled and flat."""
    return np.concatenate([(some.end / some.unit).ravel() for some in samples])


def variant_ends(variants: Variants, points: Array, samples: Sequence[Segments]) -> Array:
    """Return end states of the equations at other parameters: points (K, P) -> (K, N)."""
    parts = [variants.flows(points, some) / some.unit for some in samples]
    return np.concatenate([part.reshape(len(points), -1) for part in parts], axis=1)
