"""Snapshots: selected segments of a scenario in numbers, for later runs to repeat.

From the recorded states under the recorded inputs, an engine must end where it ended before, even
if the declaration has changed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import sympy as sp

from physics_crosscheck.harness.engines.protocol import Model
from physics_crosscheck.harness.numerics.batch import Batch, Rows, pick_segments
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.segments import extrapolate
from physics_crosscheck.harness.records.baseline import Snapshot
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.system import System
from physics_crosscheck.reference.solving.motion import Motion

PICKED = 16
"""Number of segments in a snapshot: evenly spaced, at least two between breaks of the motion."""

SAME = 1e-9
"""Relative difference of starts, ends and inputs up to which two motions are the same. Another
machine reproduces them to about 1e-13.
"""

_FIRST_NODES, _MOST_NODES = 12, 96
_INTERPOLATED = 1e-13


@dataclass(frozen=True, kw_only=True)
class PickedSegments:
    """The segments of a snapshot in arrays; K of them, 2n components.

    Attributes:
        scenario, fastest, varying: as in `Snapshot`.
        t: start times, (K,), seconds; nan for independent segments.
        length: length of each segment, (K,), seconds.
        start: start states, (K, 2n).
        inputs: inputs of each segment at its inner Chebyshev points, (nodes, inputs).
        end: ends of the segments by the equations, (K, 2n).
        scale: scale of the defects, (2n,).
    """

    scenario: str
    fastest: float
    varying: bool
    t: Array
    length: Array
    start: Array
    inputs: tuple[Array, ...]
    end: Array
    scale: Array


def segments_of(snapshot: Snapshot) -> PickedSegments:
    """Convert the segments of a snapshot to arrays."""
    return PickedSegments(
        scenario=snapshot.scenario,
        fastest=snapshot.fastest,
        varying=snapshot.varying,
        t=np.array(snapshot.t, dtype=float),  # None becomes nan
        length=np.array(snapshot.length),
        start=np.array(snapshot.start),
        inputs=tuple(np.array(nodes).reshape(len(nodes), -1) for nodes in snapshot.input_nodes),
        end=np.array(snapshot.end),
        scale=np.array(snapshot.scale),
    )


def snapshot_of(
    system: System, name: str, motion: Motion, scale: Array, components: tuple[str, ...]
) -> Snapshot:
    """Select segments evenly over a scenario, from each of its spans in proportion."""
    chosen = np.concatenate([indices for _, indices in pick_segments(motion, PICKED)])
    scenario = system.scenario(name)
    t, length = motion.t[chosen], motion.lengths[chosen]
    nodes = [_nodes(motion.inputs, a, h) for a, h in zip(t, length, strict=True)]
    return Snapshot(
        scenario=name,
        components=components,
        duration=float(motion.duration),
        inputs=tuple(
            f"{i.name} = {sp.sstr(sp.sympify(scenario.inputs[i]))}" for i in system.inputs
        ),
        fastest=float(motion.fastest),
        varying=motion.varying,
        t=tuple(t.tolist()),
        length=tuple(length.tolist()),
        start=_table(motion.start[chosen]),
        input_nodes=tuple(_table(values) for values in nodes),
        end=_table(motion.end[chosen]),
        scale=tuple(scale.tolist()),
    )


def _table(values: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in values.tolist())


def same_motion(first: Snapshot, second: Snapshot) -> bool:
    """Return whether two snapshots hold the same segments of the same motion."""
    if (first.components, first.varying) != (second.components, second.varying):
        return False
    a, b = segments_of(first), segments_of(second)
    if a.start.shape != b.start.shape or len(a.inputs) != len(b.inputs):
        return False
    pairs: list[tuple[Array, Array, Array | float]] = [
        (np.isnan(a.t) * 1.0, np.isnan(b.t) * 1.0, 0.0),
        (np.nan_to_num(a.t), np.nan_to_num(b.t), 1.0),
        (a.length, b.length, float(np.max(a.length))),
        (a.start, b.start, a.scale),
        (a.end, b.end, a.scale),
        (a.scale, b.scale, a.scale),
        *(
            (u, v, 1.0 + float(np.max(np.abs(u), initial=0.0)))
            for u, v in zip(a.inputs, b.inputs, strict=True)
        ),
    ]
    return all(
        x.shape == y.shape and bool(np.all(np.abs(x - y) <= SAME * scale)) for x, y, scale in pairs
    )


def ends(model: Model, coordinates: CoordinateMap, segments: PickedSegments) -> tuple[Array, Array]:
    """Return the ends of the segments in an engine as h -> 0, with their uncertainty, (K, 2n) each.

    Raises:
        BlownUpError: if the engine returns values that are not finite.
    """
    limit = extrapolate(model, coordinates, _batch(segments)).limit
    return limit.value, limit.uncertainty


def _batch(segments: PickedSegments) -> Batch:
    def inputs(rows: Rows, steps: int) -> Array:
        fractions = np.arange(steps) / steps
        return np.stack([_interpolate(segments.inputs[row], fractions) for row in rows])

    return Batch(
        states=segments.start,
        lengths=segments.length,
        inputs=inputs,
        varying=segments.varying,
        scale=segments.scale,
        ends=segments.end,
        times=None if np.isnan(segments.t).any() else segments.t,
        name=segments.scenario,
    )


def inputs_of(segments: PickedSegments, chosen: Array, copies: int) -> Callable[[Array], Array]:
    """Return u at flat times of `copies` runs over the chosen segments, as the reference
    expects.
    """
    t = np.tile(segments.t[chosen], copies)
    length = np.tile(segments.length[chosen], copies)
    nodes = [segments.inputs[i] for i in np.flatnonzero(chosen)] * copies

    def at(times: Array) -> Array:
        shaped = times.reshape(len(t), -1)
        inside = (shaped - t[:, None]) / length[:, None]
        values = [_interpolate(u, x) for u, x in zip(nodes, inside, strict=True)]
        return np.concatenate(values)

    return at


def _nodes(inputs: Callable[[Array], Array], start: float, length: float) -> Array:
    """Sample inputs at Chebyshev points inside a segment, enough to restore them up to rounding."""
    check = start + length * (np.arange(33) + 0.5) / 33
    wanted = inputs(check)
    if bool(np.all(wanted == wanted[:1])):
        return wanted[:1]
    count = _FIRST_NODES
    while True:
        nodes = inputs(start + length * _points(count))
        miss = np.max(np.abs(_interpolate(nodes, (check - start) / length) - wanted))
        if miss <= _INTERPOLATED * np.max(np.abs(wanted)) or count >= _MOST_NODES:
            return nodes
        count *= 2


def _points(count: int) -> Array:
    """Return Chebyshev points of the first kind on (0, 1), none at a break of the input."""
    points: Array = (1 - np.cos(np.pi * (np.arange(count) + 0.5) / count)) / 2
    return points


def _interpolate(nodes: Array, places: Array) -> Array:
    """Interpolate between nodes at places in [0, 1], (len(at), inputs)."""
    if len(nodes) == 1:
        return np.repeat(nodes, len(places), axis=0)
    values: Array = _matrix(len(nodes), tuple(places.tolist())) @ nodes
    return values


@lru_cache(maxsize=512)
def _matrix(count: int, places: tuple[float, ...]) -> Array:
    """Return a barycentric interpolation matrix (Berrut and Trefethen 2004, eq. 4.2 and 5.3)."""
    k = np.arange(count)
    weights = np.where(k % 2 == 0, 1.0, -1.0) * np.sin(np.pi * (k + 0.5) / count)
    gaps = np.array(places)[:, None] - _points(count)
    exact = np.abs(gaps) < 1e-15
    factors = weights / np.where(exact, 1.0, gaps)
    hit = exact.any(axis=1)
    factors[hit] = exact[hit]
    matrix: Array = factors / factors.sum(axis=1)[:, None]
    return matrix
