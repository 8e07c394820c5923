"""The reference motion: states from which segments start, and where each must end."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.signal import Inputs

NODES = 11
"""Chebyshev-Lobatto points a segment: degree 10 over a twentieth of the fastest period."""

INTERPOLATION = 2e-14
"""By which degree 10 errs at most, of the amplitude, as measured on every built-in scenario; degree
8 leaves 7e-12."""


def chebyshev_nodes() -> Array:
    """Chebyshev points of the second kind on [0, 1], ascending, both ends included."""
    nodes: Array = (1 - np.cos(np.pi * np.arange(NODES) / (NODES - 1))) / 2
    return nodes


@dataclass(frozen=True, kw_only=True)
class Span:
    """Equal segments between two breaks of the input: `count` segments of `length` seconds."""

    start: float
    length: float
    count: int
    constant_input: bool


@dataclass(frozen=True, kw_only=True)
class Motion:
    """A scenario solved: K segments of a system with n coordinates; all in SI units.

    Attributes:
        t: start times of the segments, (K,).
        start: states (q, v) there, (K, 2n), rounded to doubles.
        end: states that the equations reach from `start` at the segments' ends, (K, 2n).
        bound: bound of the error of `end`, per component, (2n,); that of the inputs' values as
            doubles, and of the times at which they are taken, included.
        global_bound: bound of the error of `start`, and of the last end, against the motion that
            the equations make of the very first state, (K + 1, 2n); infinite where none is known.
        nodes: states at the Chebyshev points of each segment, (K, NODES, 2n).
        spans: how the segments tile the duration.
        inputs: u(t), the right-hand value at a break.
        fastest: the fastest rate along the motion, rad/s.
        method: how the states were found and checked.
    """

    t: Array
    start: Array
    end: Array
    bound: Array
    global_bound: Array
    nodes: Array
    spans: tuple[Span, ...]
    inputs: Inputs
    fastest: float
    method: str

    @cached_property
    def duration(self) -> float:
        """Length of the whole motion in seconds."""
        return self.spans[-1].start + self.spans[-1].length * self.spans[-1].count

    @cached_property
    def varying(self) -> bool:
        """Whether an input changes over any segment."""
        return not all(span.constant_input for span in self.spans)

    @cached_property
    def lengths(self) -> Array:
        """Length of each segment, (K,)."""
        return np.concatenate([np.full(s.count, s.length) for s in self.spans])

    @cached_property
    def movement(self) -> Array:
        """How far each component moves over a segment at most, (2n,)."""
        reach: Array = np.max(np.abs(self.end - self.start), axis=0)
        return reach

    @cached_property
    def amplitude(self) -> Array:
        """Largest magnitude of each component, (2n,)."""
        size: Array = np.max(np.abs(self.nodes), axis=(0, 1))
        return size

    def global_bound_at(self, times: Array) -> Array:
        """Bound of the error of `at` against the motion from the start, (len(times), 2n).

        That of the neighbouring states, and of the interpolation between them.
        """
        which = np.clip(np.searchsorted(self.t, times, side="right") - 1, 0, len(self.t) - 1)
        chain = np.maximum(self.global_bound[which], self.global_bound[which + 1])
        bound: Array = chain + INTERPOLATION * self.amplitude
        return bound

    def at(self, times: Array) -> Array:
        """States at given times within the motion, (len(times), 2n), by barycentric interpolation.

        Source: Berrut and Trefethen 2004, SIAM Review 46(3), eq. 4.2 and 5.4.
        """
        which = np.clip(np.searchsorted(self.t, times, side="right") - 1, 0, len(self.t) - 1)
        local = (times - self.t[which]) / self.lengths[which]
        nodes = chebyshev_nodes()
        weights = np.where(np.arange(NODES) % 2 == 0, 1.0, -1.0)
        weights[[0, -1]] /= 2
        gaps = local[:, None] - nodes[None, :]
        exact = np.abs(gaps) < 1e-14
        factors = weights / np.where(exact, 1.0, gaps)
        hit = exact.any(axis=1)
        factors[hit] = exact[hit]
        values = np.einsum("ki,kic->kc", factors, self.nodes[which])
        result: Array = values / factors.sum(axis=1)[:, None]
        return result
