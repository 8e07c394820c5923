"""The reference motion: start states of segments, and their exact ends."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from physics_crosscheck.reference.mechanism.numeric import Array
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


@dataclass(frozen=True, kw_only=True)
class Span:
    """Equal segments between two breaks of the input: `count` segments of `length` seconds."""

    start: float
    length: float
    count: int
    constant_input: bool


@dataclass(frozen=True, kw_only=True)
class Motion:
    """A solved scenario: K segments of a system with n coordinates, in SI units.

    Attributes:
        t: start times of the segments, (K,).
        start: states (q, v) there, (K, 2n), rounded to doubles.
        end: states that the equations reach from `start` at the segments' ends, (K, 2n).
        bound: error bound of `end`, per component, (2n,). It includes the rounding of the inputs'
            values and of their times to doubles.
        global_bound: error bound of `start`, and of the last end, against the motion from the first
            state, (K + 1, 2n); infinite if unknown.
        nodes: states at the Chebyshev points of each segment, (K, NODES, 2n).
        spans: tiling of the duration by segments.
        inputs: u(t), the right-hand value at a break.
        fastest: the fastest rate along the motion, rad/s.
        method: how the states were computed and checked.
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
        """True if an input changes over any segment."""
        return not all(span.constant_input for span in self.spans)

    @cached_property
    def lengths(self) -> Array:
        """Length of each segment, (K,)."""
        return np.concatenate([np.full(s.count, s.length) for s in self.spans])

    @cached_property
    def movement(self) -> Array:
        """Largest movement of each component over a segment, (2n,)."""
        largest: Array = np.max(np.abs(self.end - self.start), axis=0)
        return largest

    @cached_property
    def amplitude(self) -> Array:
        """Largest magnitude of each component, (2n,)."""
        size: Array = np.max(np.abs(self.nodes), axis=(0, 1))
        return size

    def global_bound_at(self, times: Array) -> Array:
        """Return an error bound of `states_at` against the motion from the start, (len(times), 2n).

        It combines the bounds of the neighbouring states and of the interpolation.
        """
        which = np.clip(np.searchsorted(self.t, times, side="right") - 1, 0, len(self.t) - 1)
        chain = np.maximum(self.global_bound[which], self.global_bound[which + 1])
        bound: Array = chain + INTERPOLATION * self.amplitude
        return bound

    def states_at(self, times: Array) -> Array:
        """Return states at times within the motion, (len(times), 2n), by barycentric interpolation.

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
