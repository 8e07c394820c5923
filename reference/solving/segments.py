"""Segments: start states, inputs, and the exact ends; a motion is a chain of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np

from physics_crosscheck.reference.mechanism.numeric import Array, NumericFunction, Rows
from physics_crosscheck.reference.mechanism.signal import Inputs

NODES = 11
"""Chebyshev-Lobatto points per segment: degree 10 over a twentieth of the fastest period."""

INTERPOLATION = 2e-14
"""Largest error of degree 10, relative to the amplitude, measured on every built-in scenario;
degree 8 has 7e-12."""


def chebyshev_nodes() -> Array:
    """Return Chebyshev points of the second kind on [0, 1], ascending, both ends included."""
    nodes: Array = (1 - np.cos(np.pi * np.arange(NODES) / (NODES - 1))) / 2
    return nodes


def even_indices(count: int, limit: int) -> Rows:
    """Return at most `limit` evenly spaced indices of `count`, including the first and the last."""
    return np.unique(np.linspace(0, count - 1, limit).astype(np.intp))


class SegmentInputs(Protocol):
    """Inputs u over K segments; B of them are chosen by their rows."""

    def over_steps(self, rows: Rows, t: Array, lengths: Array, steps: int) -> Array:
        """Return u at the starts of equal steps, (B, steps, inputs)."""

    def within(self, rows: Rows, t: Array, lengths: Array, times: Array) -> Array:
        """Return u at S times within each segment, (B, S) -> (B, S, inputs)."""

    def pick(self, rows: Rows) -> SegmentInputs:
        """Return the inputs of the chosen segments alone."""


@dataclass(frozen=True)
class ConstantInputs:
    """Inputs that are constant over each segment, (K, inputs)."""

    values: Array

    def over_steps(self, rows: Rows, t: Array, lengths: Array, steps: int) -> Array:
        """Return u at the starts of equal steps, (B, steps, inputs)."""
        return np.repeat(self.values[rows, None, :], steps, axis=1)

    def within(self, rows: Rows, t: Array, lengths: Array, times: Array) -> Array:
        """Return u at times within each segment, (B, S, inputs)."""
        return np.repeat(self.values[rows, None, :], times.shape[1], axis=1)

    def pick(self, rows: Rows) -> ConstantInputs:
        """Return the inputs of the chosen segments alone."""
        return ConstantInputs(self.values[rows])


@dataclass(frozen=True, kw_only=True)
class Segments:
    """K short segments of a system with n coordinates, in SI units.

    The reference solves them. Engines run them, and their ends are compared.

    Attributes:
        start: states (q, v) at the starts, (K, 2n), rounded to doubles.
        lengths: seconds per segment, (K,).
        inputs: inputs over each segment.
        end: states that the equations reach from `start`, (K, 2n). Angles of an engine are
            unwrapped near them. Segments that no equations solve have their starts here.
        bound: error bound of `end`, per component, (2n,). It includes the rounding of the inputs'
            values and of their times to doubles. Infinite if unknown.
        t: start times, (K,); nan for segments that no motion joins.
        varying: whether an input changes over any segment.
        scale: unit of relative errors, per component, (2n,); None for the movement of the runs.
        fastest: fastest rate of the equations there, rad/s; nan if unknown.
        name: name of the scenario, for messages.
        nonsmooth: whether forces are not smooth, as a drag quadratic in the velocity. Rounding
            then differs much between segments.
        events: times of impacts and other changes of the equations, s; each is in the middle of
            a segment or outside of all.
    """

    start: Array
    lengths: Array
    inputs: SegmentInputs
    end: Array
    bound: Array
    t: Array
    varying: bool = False
    scale: Array | None = None
    fastest: float = float("nan")
    name: str = ""
    nonsmooth: bool = False
    events: tuple[float, ...] = ()

    @staticmethod
    def unsolved(
        start: Array,
        length: float,
        inputs: Array,
        *,
        scale: Array | None = None,
    ) -> Segments:
        """Return segments of one length, each under constant inputs (K, m), with unknown ends."""
        return Segments(
            start=start,
            lengths=np.full(len(start), length),
            inputs=ConstantInputs(inputs),
            end=start,
            bound=np.full(start.shape[1], np.inf),
            t=np.full(len(start), np.nan),
            varying=False,
            scale=scale,
        )

    @property
    def bounded(self) -> bool:
        """True if the error of `end` has a bound."""
        return not bool(np.isposinf(self.bound).all())

    @property
    def duration(self) -> float:
        """Length of the longest stretch without a jump, seconds."""
        return self.length

    @property
    def length(self) -> float:
        """Length of segments that share one, seconds."""
        return float(self.lengths[0])

    @cached_property
    def start_inputs(self) -> Array:
        """Inputs at the starts, (K, inputs)."""
        values: Array = self.step_inputs(np.arange(len(self.start)), 1)[:, 0]
        return values

    @cached_property
    def movement(self) -> Array:
        """Largest movement of each component over a segment, (2n,)."""
        largest: Array = np.max(np.abs(self.end - self.start), axis=0)
        return largest

    def step_inputs(self, rows: Rows, steps: int) -> Array:
        """Return inputs at the starts of `steps` equal steps of chosen segments.

        Returns:
            The inputs, (B, steps, inputs).
        """
        return self.inputs.over_steps(rows, self.t[rows], self.lengths[rows], steps)

    def inputs_within(self, rows: Rows, times: Array) -> Array:
        """Return inputs at S times within each chosen segment, (B, S) -> (B, S, inputs)."""
        return self.inputs.within(rows, self.t[rows], self.lengths[rows], times)

    def pick(self, rows: Rows | slice) -> Segments:
        """Return the chosen segments alone."""
        rows = np.arange(len(self.start))[rows]
        return Segments(
            start=self.start[rows],
            lengths=self.lengths[rows],
            inputs=self.inputs.pick(rows),
            end=self.end[rows],
            bound=self.bound,
            t=self.t[rows],
            varying=self.varying,
            scale=self.scale,
            fastest=self.fastest,
            name=self.name,
            nonsmooth=self.nonsmooth,
            events=self.events,
        )

    def informative(self, count: int) -> Rows:
        """Return the rows of about `count` segments that show the most; they come first."""
        return np.arange(min(count, len(self.start)))

    def by_length(self) -> Iterator[tuple[float, Rows]]:
        """Yield each length of segments, seconds, and their rows."""
        for length in np.unique(self.lengths):
            yield float(length), np.flatnonzero(self.lengths == length)

    @property
    def unit(self) -> Array:
        """The scale, (2n,), of segments whose scale does not depend on the runs."""
        assert self.scale is not None
        return self.scale


@dataclass(frozen=True, kw_only=True)
class Span:
    """Equal segments between two breaks of the input: `count` segments of `length` seconds."""

    start: float
    length: float
    count: int
    constant_input: bool


def start_times(spans: tuple[Span, ...]) -> Array:
    """Return the start times of all segments, (K,)."""
    return np.concatenate([span.start + span.length * np.arange(span.count) for span in spans])


@dataclass(frozen=True, kw_only=True)
class EventMark:
    """One event of a motion, and the condition that ends the mode before it.

    Attributes:
        time: s.
        part: names of the interactions that change.
        change: how they change, such as `impact` or `stick to slip+`.
        guards: conditions of the mode before, of (q, v, u, (t,)).
        guard: index of the condition that crosses zero at the event.
    """

    time: float
    part: str
    change: str
    guards: NumericFunction
    guard: int


@dataclass(frozen=True, kw_only=True)
class PressedContact:
    """A contact that is pressed from one event to another.

    Attributes:
        name: its name.
        start, stop: s.
        gap: its gap, of (q, v, u, (t,)).
    """

    name: str
    start: float
    stop: float
    gap: NumericFunction


@dataclass(frozen=True, kw_only=True)
class Motion(Segments):
    """A solved scenario: segments that join.

    Attributes:
        inputs: u(t), the right-hand value at a break.
        global_bound: error bound of `start`, and of the last end, against the motion from the first
            state, (K + 1, 2n); infinite if unknown.
        nodes: states at the Chebyshev points of each segment, (K, NODES, 2n).
        spans: tiling of the duration by segments.
        method: how the states were computed and checked.
        marks: the events; None if the equations never change.
        pressed: contacts between events.
        halves: nodes before and after an event, (2, NODES, 2n), by the row of its segment.
    """

    inputs: Inputs
    global_bound: Array
    nodes: Array
    spans: tuple[Span, ...]
    method: str
    marks: tuple[EventMark, ...] | None = None
    pressed: tuple[PressedContact, ...] = ()
    halves: Mapping[int, Array] = field(default_factory=dict)

    @staticmethod
    def join(
        spans: tuple[Span, ...],
        inputs: Inputs,
        *,
        start: Array,
        end: Array,
        nodes: Array,
        bound: Array,
        method: str,
    ) -> Motion:
        """Return the motion that solved segments tile, without bounds along it or its rate."""
        return Motion(
            start=start,
            lengths=np.concatenate([np.full(span.count, span.length) for span in spans]),
            inputs=inputs,
            end=end,
            bound=bound,
            t=start_times(spans),
            varying=not all(span.constant_input for span in spans),
            global_bound=np.full((len(start) + 1, start.shape[1]), np.inf),
            nodes=nodes,
            spans=spans,
            method=method,
        )

    @cached_property
    def duration(self) -> float:
        """Length of the whole motion in seconds."""
        return self.spans[-1].start + self.spans[-1].length * self.spans[-1].count

    @cached_property
    def amplitude(self) -> Array:
        """Largest magnitude of each component, (2n,)."""
        size: Array = np.max(np.abs(self.nodes), axis=(0, 1))
        return size

    def informative(self, count: int) -> Rows:
        """Return evenly spaced rows of each span, in proportion, at least two each."""
        rows, first = [], 0
        for span in self.spans:
            some = min(span.count, max(2, round(count * span.count / len(self.t))))
            # Spread evenly, away from the ends, since a start at rest is not informative.
            rows.append(first + np.floor((np.arange(some) + 0.5) * span.count / some))
            first += span.count
        return np.concatenate(rows).astype(np.intp)

    def global_bound_at(self, times: Array) -> Array:
        """Return an error bound of `states_at` against the motion from the start, (len(times), 2n).

        It combines the bounds of the neighbouring states and of the interpolation.
        """
        which = np.clip(np.searchsorted(self.t, times, side="right") - 1, 0, len(self.t) - 1)
        chain = np.maximum(self.global_bound[which], self.global_bound[which + 1])
        bound: Array = chain + INTERPOLATION * self.amplitude
        return bound

    def states_at(self, times: Array) -> Array:
        """Return states at times within the motion, (len(times), 2n); after the jump of an event.

        Source: barycentric interpolation, Berrut and Trefethen 2004, SIAM Review 46(3), eq. 4.2 and
        5.4.
        """
        which = np.clip(np.searchsorted(self.t, times, side="right") - 1, 0, len(self.t) - 1)
        local = (times - self.t[which]) / self.lengths[which]
        tiles = self.nodes[which]
        for row, halves in self.halves.items():
            here = which == row
            later = (local[here] >= 0.5).astype(np.intp)
            tiles[here], local[here] = halves[later], 2 * local[here] - later
        nodes = chebyshev_nodes()
        weights = np.where(np.arange(NODES) % 2 == 0, 1.0, -1.0)
        weights[[0, -1]] /= 2
        gaps = local[:, None] - nodes[None, :]
        exact = np.abs(gaps) < 1e-14
        factors = weights / np.where(exact, 1.0, gaps)
        hit = exact.any(axis=1)
        factors[hit] = exact[hit]
        values = np.einsum("ki,kic->kc", factors, tiles)
        result: Array = values / factors.sum(axis=1)[:, None]
        return result
