"""A track: picked segments of a scenario, complete in numbers, so that a later run can repeat them.

From states that were written down, under inputs that were written down, an engine must end where
it ended before; whatever has become of the declaration since.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp

from harness.engines.protocol import Model
from harness.numerics.coordinates import CoordinateMap
from harness.numerics.segments import Batch, Rows, extrapolate, spread
from reference.motion import Motion
from reference.numeric import Array
from reference.system import System

PICKED = 16
"""Segments a track: even over the motion, at least two of each span between breaks."""

SAME = 1e-9
"""Starts, ends and inputs this close, relative to their scale, are those of one motion: computed
anew on another machine they differ by some 1e-13."""

_FIRST_NODES, _MOST_NODES = 12, 96
_INTERPOLATED = 1e-13


@dataclass(frozen=True)
class Snapshot:
    """Picked segments of a scenario; K of them, 2n components.

    Attributes:
        scenario: its name.
        components: names of the state's components.
        duration: of the whole scenario, seconds.
        drive: the inputs in words, `F = 7*Heaviside(t - 1)`.
        fastest: fastest rate along the motion, rad/s.
        varying: whether an input changes over any segment of the scenario.
        t: start times, (K,).
        length: seconds of each segment, (K,).
        start: states there, (K, 2n).
        inputs: each segment's inputs at Chebyshev points inside it, (nodes, inputs); one row where
            they are constant.
        end: where the equations end each segment, (K, 2n).
        scale: what a defect is relative to, (2n,).
    """

    scenario: str
    components: tuple[str, ...]
    duration: float
    drive: tuple[str, ...]
    fastest: float
    varying: bool
    t: Array
    length: Array
    start: Array
    inputs: tuple[Array, ...]
    end: Array
    scale: Array

    def record(self) -> dict[str, Any]:
        """As plain JSON, every digit kept."""
        return {
            "scenario": self.scenario,
            "components": list(self.components),
            "duration": self.duration,
            "drive": list(self.drive),
            "fastest": self.fastest,
            "varying": self.varying,
            "t": self.t.tolist(),
            "length": self.length.tolist(),
            "start": self.start.tolist(),
            "inputs": [nodes.tolist() for nodes in self.inputs],
            "end": self.end.tolist(),
            "scale": self.scale.tolist(),
        }

    def same_as(self, other: Snapshot) -> bool:
        """Whether both are the same segments of the same motion."""
        if self.start.shape != other.start.shape or len(self.inputs) != len(other.inputs):
            return False
        if self.components != other.components or self.varying != other.varying:
            return False
        pairs: list[tuple[Array, Array, Array | float]] = [
            (self.t, other.t, 1.0),
            (self.length, other.length, float(np.max(self.length))),
            (self.start, other.start, self.scale),
            (self.end, other.end, self.scale),
            (self.scale, other.scale, self.scale),
            *(
                (a, b, 1.0 + np.max(np.abs(a), initial=0.0))
                for a, b in zip(self.inputs, other.inputs, strict=True)
            ),
        ]
        return all(
            a.shape == b.shape and bool(np.all(np.abs(a - b) <= SAME * scale))
            for a, b, scale in pairs
        )


def snapshot_from(record: Mapping[str, Any]) -> Snapshot:
    """The track that `Snapshot.record` has written."""
    return Snapshot(
        record["scenario"],
        tuple(record["components"]),
        record["duration"],
        tuple(record["drive"]),
        record["fastest"],
        record["varying"],
        np.array(record["t"]),
        np.array(record["length"]),
        np.array(record["start"]),
        tuple(np.array(nodes).reshape(len(nodes), -1) for nodes in record["inputs"]),
        np.array(record["end"]),
        np.array(record["scale"]),
    )


def snapshot_key(record: Mapping[str, Any]) -> str:
    """Name of a track by what is in it, such as `free@1f0a2b3c4d5e`."""
    text = json.dumps(record, sort_keys=True, allow_nan=False)
    return f"{record['scenario']}@{hashlib.sha256(text.encode()).hexdigest()[:12]}"


def track(
    system: System, name: str, motion: Motion, scale: Array, components: tuple[str, ...]
) -> Snapshot:
    """Pick segments evenly over a scenario, from each of its spans in proportion."""
    chosen = np.concatenate([indices for _, indices in spread(motion, PICKED)])
    scenario = system.scenario(name)
    t, length = motion.t[chosen], motion.lengths[chosen]
    return Snapshot(
        name,
        components,
        float(motion.duration),
        tuple(f"{i.name} = {sp.sstr(sp.sympify(scenario.inputs[i]))}" for i in system.inputs),
        float(motion.fastest),
        motion.varying,
        t,
        length,
        motion.start[chosen],
        tuple(_nodes(motion.inputs, a, h) for a, h in zip(t, length, strict=True)),
        motion.end[chosen],
        scale,
    )


def ends(model: Model, coordinates: CoordinateMap, one: Snapshot) -> tuple[Array, Array]:
    """Where an engine ends the segments as h -> 0, with the uncertainty, (K, 2n) each.

    Raises:
        BlownUpError: where the engine returns values that are not finite.
    """
    limit = extrapolate(model, coordinates, _batch(one)).limit
    return limit.value, limit.uncertainty


def _batch(one: Snapshot) -> Batch:
    def inputs(rows: Rows, steps: int) -> Array:
        at = np.arange(steps) / steps
        return np.stack([_interpolate(one.inputs[row], at) for row in rows])

    return Batch(
        states=one.start,
        lengths=one.length,
        inputs=inputs,
        varying=one.varying,
        scale=one.scale,
        ends=one.end,
        times=one.t,
        name=one.scenario,
    )


def inputs_of(one: Snapshot, chosen: Array, copies: int) -> Callable[[Array], Array]:
    """u at flat times of `copies` runs over the chosen segments, as the reference asks for it."""
    t = np.tile(one.t[chosen], copies)
    length = np.tile(one.length[chosen], copies)
    nodes = [one.inputs[i] for i in np.flatnonzero(chosen)] * copies

    def at(times: Array) -> Array:
        shaped = times.reshape(len(t), -1)
        inside = (shaped - t[:, None]) / length[:, None]
        values = [_interpolate(u, x) for u, x in zip(nodes, inside, strict=True)]
        return np.concatenate(values)

    return at


def _nodes(inputs: Callable[[Array], Array], start: float, length: float) -> Array:
    """Inputs at Chebyshev points inside a segment: as many as give them back to rounding."""
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
    """Chebyshev points of the first kind on (0, 1): none at a break of the input."""
    points: Array = (1 - np.cos(np.pi * (np.arange(count) + 0.5) / count)) / 2
    return points


def _interpolate(nodes: Array, at: Array) -> Array:
    """Values at places in [0, 1], (len(at), inputs)."""
    if len(nodes) == 1:
        return np.repeat(nodes, len(at), axis=0)
    values: Array = _matrix(len(nodes), tuple(at.tolist())) @ nodes
    return values


@lru_cache(maxsize=512)
def _matrix(count: int, at: tuple[float, ...]) -> Array:
    """Barycentric interpolation (Berrut and Trefethen 2004, eq. 4.2 and 5.3)."""
    k = np.arange(count)
    weights = np.where(k % 2 == 0, 1.0, -1.0) * np.sin(np.pi * (k + 0.5) / count)
    gaps = np.array(at)[:, None] - _points(count)
    exact = np.abs(gaps) < 1e-15
    factors = weights / np.where(exact, 1.0, gaps)
    hit = exact.any(axis=1)
    factors[hit] = exact[hit]
    matrix: Array = factors / factors.sum(axis=1)[:, None]
    return matrix


def finite(values: Array) -> list[list[float | None]]:
    """Rows of numbers for JSON, where what is not finite is null."""
    return [[x if math.isfinite(x) else None for x in row] for row in values.tolist()]
