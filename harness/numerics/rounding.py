"""What rounding does to an engine's motion, seen in runs from starts close by.

Two things. What is rounded otherwise in every run shows in second differences (`observed_rounding`)
and grows with the weights of an extrapolation. What is rounded alike in every run shows in no
difference of any two, and is of the size of what a last digit of the start does (`last_digits`).

The last digit of a position is a force too, where a constraint is held by a spring: a soft
equality, as stiff as the step allows, makes a velocity of it by dividing it by h, so that the
finest rungs have the most. No rule that knows only the motion foresees that; other runs show it.

An engine that computes in 32 bits holds every start to 24 binary digits and rounds every step to
them: its own epsilon takes the place of the double's throughout.

Each chosen start has a pair of companions, at the same distance on either side. What the three ends
depend on smoothly drops out of their second difference, and leaves how differently they were
rounded. Source: Hamming's difference table; More and Wild 2011, Estimating Computational Noise,
SIAM J. Sci. Comput. 33(3), with second differences alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.numerics.ladder import EPSILON
from physics_crosscheck.reference.mechanism.numeric import Array

PAIRS = 24
"""Starts with companions, at most: they cost a quarter more steps where there are 200 segments."""

LEAST = 4
"""Pairs however few the starts are: of a few, all second differences may be small by chance."""

NEAR = 2 / 3
"""Relative distance of a companion, at most, as a power of epsilon: far above a last digit, so that
it is rounded otherwise (one digit away the same roundings come again), and its square far below."""

ALIKE = 16.0
"""Last digits that an engine rounds alike in every step of a segment, by those of its start.

An engine makes accelerations from numbers of its own: the file's, each rounded where it is compiled
(frames normalized, tensors turned to principal axes), and sines and places of bodies that hardly
change over a segment. What these lose is the same in every step, rung and companion: an
acceleration that is off by d moves the end by d L in velocity and d L^2 / 2 in position over a
length L, at any step, and the weights of the limit, which add up to one, leave it as it is. So it
is in no increment and in no second difference. By backward error (Wilkinson 1963, Rounding Errors
in Algebraic Processes; Higham 2002, ch. 1.5 and 9.3) the computed acceleration M^-1 f is that of
numbers off by a few last digits, whatever the conditioning of M makes of them; and a last digit of
a start's positions, velocities and inputs goes through the same products and the same M^-1 as one
of a stiffness, a mass or a sine. Its effect is a first difference of the companions, which costs no
further run. How many digits there are to one of the
start's was measured: of 300 random mechanisms in 3-D (`campaigns.mechanisms`), stepped by RK4 and
oscillating by little about where springs carry their weight, so that accelerations are small
differences of large forces, three had limits outside U without this, by up to 1.17 U; with it none,
the worst at 0.79 U, and U is larger by 37 % in the median. Where the weights' magnitudes add up to
40 instead of 2.5, as with integrators of first order, that is 2 %.
"""


@dataclass(frozen=True, kw_only=True)
class Starts:
    """Starts of K segments, and after them those of P pairs of companions, in engine coordinates.

    Attributes:
        rows: segment that each start belongs to, (K + 2P,).
        z, w: positions and velocities, each (K + 2P, nz).
        gain: what the inputs of each are multiplied by, (K + 2P,).
        pairs: P.
        epsilon: relative rounding of the engine's numbers.
    """

    rows: NDArray[np.intp]
    z: Array
    w: Array
    gain: Array
    pairs: int
    epsilon: float = EPSILON

    @property
    def count(self) -> int:
        """K, without the companions."""
        return len(self.rows) - 2 * self.pairs

    def observed_rounding(self, values: Array) -> Array:
        """What rounding does to a value at most, by component, (C,), from all values (K + 2P, C).

        Pairs of which a value is not finite show nothing.
        """
        if not self.pairs:
            return np.zeros(values.shape[1])
        one, other = values[self.count : -self.pairs], values[-self.pairs :]
        between = values[self.rows[-self.pairs :]]
        known = np.isfinite(one) & np.isfinite(other) & np.isfinite(between)
        with np.errstate(invalid="ignore"):
            bend = np.where(known, np.abs(one + other - 2 * between), 0.0)
        largest: Array = np.max(bend, axis=0) / 2
        return largest

    def last_digits(self, values: Array) -> Array:
        """What is rounded alike in every run does to a value at most, by component, (C,).

        That is `ALIKE` times the change for a last digit of every number of the start, from all
        values (K + 2P, C); see there. Pairs of which a value is not finite show nothing.
        """
        if not self.pairs:
            return np.zeros(values.shape[1])
        one, other = values[self.count : -self.pairs], values[-self.pairs :]
        known = np.isfinite(one) & np.isfinite(other)
        with np.errstate(invalid="ignore"):
            change = np.where(known, np.abs(one - other), 0.0)
        distance = self.epsilon**NEAR
        largest: Array = ALIKE * self.epsilon / (2 * distance) * np.max(change, axis=0)
        return largest


def unheld(values: Array, epsilon: float) -> Array:
    """What of values an engine of this epsilon does not hold: of 2^-23, past 24 binary digits.

    It starts beside where it is told to, by this much, and ends beside by as much and no more: what
    a short segment makes of it is `Starts.last_digits`.
    """
    if epsilon <= EPSILON:
        return np.zeros_like(values)
    mantissa, exponent = np.frexp(values)
    digits = 2 / epsilon
    lost: Array = values - np.ldexp(np.round(mantissa * digits) / digits, exponent)
    return lost


def without_companions(z: Array, w: Array) -> Starts:
    """Starts (K, nz) alone, where rounding is not asked for."""
    return Starts(rows=np.arange(len(z)), z=z, w=w, gain=np.ones(len(z)), pairs=0)


def with_companions(z: Array, w: Array, epsilon: float = EPSILON, every: bool = False) -> Starts:
    """Starts (K, nz) and their companions: each number moved by a share of itself, by draw.

    Where rounding is much the same from start to start, some of them show it; else `every` one has
    a pair of its own.

    The inputs are moved so too, all of a companion's by one share: a start at rest in zero has no
    digit of its own, but what its inputs make of it has.
    """
    count = len(z)
    pairs = count if every else min(PAIRS, max(LEAST, count // 4))
    # An even spread, off the ends: a start at rest, or just at a stop, tells little of the others.
    rows = ((np.arange(pairs) + 0.5) * count / pairs).astype(np.intp)
    rng = np.random.default_rng(0)  # the same companions in every run
    distance = epsilon**NEAR
    steps = [distance * rng.uniform(-1, 1, (pairs, a.shape[1])) * a[rows] for a in (z, w)]
    moved = [
        np.concatenate([a, a[rows] + step, a[rows] - step])
        for a, step in zip((z, w), steps, strict=True)
    ]
    share = distance * rng.uniform(-1, 1, pairs)
    return Starts(
        rows=np.concatenate([np.arange(count), rows, rows]),
        z=moved[0],
        w=moved[1],
        gain=np.concatenate([np.ones(count), 1 + share, 1 - share]),
        pairs=pairs,
        epsilon=epsilon,
    )
