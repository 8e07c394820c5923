"""Snapshots: selected segments of a scenario in numbers, for later runs to repeat.

From the recorded states under the recorded inputs, an engine must end where it ended before, even
if the declaration has changed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from physics_crosscheck.harness.engines.protocol import LoadedModel
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.segments import extrapolate
from physics_crosscheck.harness.records.base import numbers
from physics_crosscheck.harness.records.baseline import Snapshot
from physics_crosscheck.reference.mechanism.numeric import Array, Rows
from physics_crosscheck.reference.solving.segments import Segments

PICKED = 16
"""Number of segments in a snapshot: evenly spaced, at least two between breaks of the motion."""

SAME = 1e-9
"""Relative difference of starts, ends and inputs up to which two motions are the same. Another
machine reproduces them to about 1e-13.
"""

_FIRST_NODES, _MOST_NODES = 12, 96
_INTERPOLATED = 1e-13


@dataclass(frozen=True)
class RecordedInputs:
    """Inputs of K segments at inner Chebyshev points of each, (nodes, inputs)."""

    nodes: tuple[Array, ...]

    def over_steps(self, rows: Rows, t: Array, lengths: Array, steps: int) -> Array:
        """Return u at the starts of equal steps, (B, steps, inputs)."""
        fractions = np.arange(steps) / steps
        return np.stack([_interpolate(self.nodes[row], fractions) for row in rows])

    def within(self, rows: Rows, t: Array, lengths: Array, times: Array) -> Array:
        """Return u at times within each segment, (B, S, inputs)."""
        inside = (times - t[:, None]) / lengths[:, None]
        return np.stack(
            [_interpolate(self.nodes[row], x) for row, x in zip(rows, inside, strict=True)]
        )

    def pick(self, rows: Rows) -> RecordedInputs:
        """Return the inputs of the chosen segments alone."""
        return RecordedInputs(tuple(self.nodes[row] for row in rows))


def segments_of(snapshot: Snapshot) -> Segments:
    """Convert the segments of a snapshot to arrays; it does not record the bound of the ends."""
    start = np.array(snapshot.start)
    nodes = (np.array(one).reshape(len(one), -1) for one in snapshot.input_nodes)
    return Segments(
        start=start,
        lengths=np.array(snapshot.length),
        inputs=RecordedInputs(tuple(nodes)),
        end=np.array(snapshot.end),
        bound=np.full(start.shape[1], np.inf),
        t=np.array(snapshot.t, dtype=float),  # None becomes nan
        varying=snapshot.varying,
        scale=np.array(snapshot.scale),
        fastest=snapshot.fastest,
        name=snapshot.scenario,
    )


def snapshot_of(
    segments: Segments, scenario: str, components: tuple[str, ...], inputs: tuple[str, ...]
) -> Snapshot:
    """Select informative segments of a scenario.

    Args:
        segments: all segments.
        scenario: its name.
        components: names of the state's components.
        inputs: the inputs as text.
    """
    some = segments.pick(segments.informative(PICKED))
    return Snapshot(
        scenario=scenario,
        components=components,
        duration=float(segments.duration),
        inputs=inputs,
        fastest=float(some.fastest),
        varying=some.varying,
        t=numbers(some.t.tolist()),
        length=tuple(some.lengths.tolist()),
        start=_table(some.start),
        input_nodes=tuple(_table(_nodes(some, row)) for row in range(len(some.t))),
        end=_table(some.end),
        scale=tuple(some.unit.tolist()),
    )


def _table(values: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in values.tolist())


def same_motion(first: Snapshot, second: Snapshot) -> bool:
    """Return whether two snapshots hold the same segments of the same motion."""
    if (first.components, first.varying) != (second.components, second.varying):
        return False
    a, b = segments_of(first), segments_of(second)
    if a.start.shape != b.start.shape:
        return False
    pairs: list[tuple[Array, Array, Array | float]] = [
        (np.isnan(a.t) * 1.0, np.isnan(b.t) * 1.0, 0.0),
        (np.nan_to_num(a.t), np.nan_to_num(b.t), 1.0),
        (a.lengths, b.lengths, float(np.max(a.lengths))),
        (a.start, b.start, a.unit),
        (a.end, b.end, a.unit),
        (a.unit, b.unit, a.unit),
        *(
            (u, v, 1.0 + float(np.max(np.abs(u), initial=0.0)))
            for u, v in zip(
                map(np.array, first.input_nodes), map(np.array, second.input_nodes), strict=True
            )
        ),
    ]
    return all(
        x.shape == y.shape and bool(np.all(np.abs(x - y) <= SAME * scale)) for x, y, scale in pairs
    )


def ends(model: LoadedModel, coordinates: CoordinateMap, segments: Segments) -> tuple[Array, Array]:
    """Return the ends of the segments in an engine as h -> 0, with their uncertainty, (K, 2n) each.

    Raises:
        BlownUpError: if the engine returns values that are not finite.
    """
    limit = extrapolate(model, coordinates, segments).limit
    return limit.value, limit.uncertainty


def _nodes(segments: Segments, row: int) -> Array:
    """Sample inputs at Chebyshev points inside a segment, enough to restore them up to rounding."""
    start, length = segments.t[row], segments.lengths[row]

    def inputs(times: Array) -> Array:
        values: Array = segments.inputs_within(np.array([row]), times[None])[0]
        return values

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
    """Interpolate between nodes at places in [0, 1], (len(places), inputs)."""
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
