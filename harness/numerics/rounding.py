"""Effect of rounding on an engine's motion, observed in runs from nearby starts.

There are two parts. Rounding that differs between runs appears in second differences
(`observed_rounding`), and grows with the weights of an extrapolation. Rounding that all runs share
appears in no difference. It has the size of the effect of a last digit of the start
(`last_digits`).

The last digit of a position is also a force if a spring enforces a constraint. A soft equality that
is as stiff as the step allows divides it by h to obtain a velocity, so the finest rungs have the
most rounding. A rule that knows only the motion cannot predict that; other runs show it.

An engine that computes in 32 bits rounds every start and every step to 24 binary digits. Its own
epsilon replaces that of doubles throughout.

Each chosen start has a pair of companions, at the same distance on either side. In the second
difference of the three ends all smooth dependence cancels, and their different rounding remains.
Source: Hamming's difference table; More and Wild 2011, Estimating Computational Noise, SIAM J. Sci.
Comput. 33(3), with second differences alone.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.reference.mechanism.numeric import Array
from .ladder import EPSILON

MAX_PAIRS = 24
"""Largest number of starts with companions; they cost a quarter more steps for 200 segments."""

MIN_PAIRS = 4
"""Smallest number of pairs; with few, all second differences may be small by chance."""

COMPANION_EXPONENT = 2 / 3
"""Largest relative distance of a companion, as a power of epsilon. It is far above a last digit, so
that rounding differs (one digit away it repeats), and its square is far below."""

SHARED_DIGITS = 16.0
"""Last digits that an engine rounds alike in every step of a segment, in last digits of its start.

An engine computes accelerations from its own numbers: those of the file, each rounded when it is
compiled (normalized frames, principal axes of inertia), and sines and body positions that hardly
change over a segment. Their rounding is the same in every step, rung and companion. An acceleration
error d moves the end by d L in velocity and d L^2 / 2 in position over a length L, at any step. The
weights of the limit sum to one and leave it unchanged. So it appears in no increment and in no
second difference.

By backward error analysis (Wilkinson 1963, Rounding Errors in Algebraic Processes; Higham 2002, ch.
1.5 and 9.3) the computed acceleration M^-1 f is exact for numbers that are off by a few last
digits, whatever the conditioning of M. A last digit of a start's positions, velocities and inputs
passes through the same products and the same M^-1 as one of a stiffness, a mass or a sine. Its
effect is a first difference of the companions, which needs no further run.

The number of digits was measured on 300 random mechanisms in 3-D (`campaigns.mechanisms`), stepped
by RK4. They oscillate slightly about positions where springs carry their weight, so that
accelerations are small differences of large forces. Without this term three had limits outside U,
by up to 1.17 U; with it none, the worst at 0.79 U. U is larger by 37 % in the median, and by 2 %
where the weights' magnitudes sum to 40 instead of 2.5, as with integrators of first order.
"""


@dataclass(frozen=True, kw_only=True)
class Starts:
    """Starts of K segments, followed by those of P pairs of companions, in engine coordinates.

    Attributes:
        rows: segment of each start, (K + 2P,).
        z, w: positions and velocities, each (K + 2P, nz).
        gain: factor on the inputs of each, (K + 2P,).
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
        """Return the largest rounding by component, (C,), from all values (K + 2P, C).

        Pairs with a value that is not finite are ignored.
        """
        if not self.pairs:
            return np.zeros(values.shape[1])
        up, down = values[self.count : -self.pairs], values[-self.pairs :]
        between = values[self.rows[-self.pairs :]]
        finite = np.isfinite(up) & np.isfinite(down) & np.isfinite(between)
        with np.errstate(invalid="ignore"):
            bend = np.where(finite, np.abs(up + down - 2 * between), 0.0)
        largest: Array = np.max(bend, axis=0) / 2
        return largest

    def last_digits(self, values: Array) -> Array:
        """Return the largest effect of rounding shared by all runs, by component, (C,).

        It is `SHARED_DIGITS` times the change for a last digit of every number of the start, from
        all values (K + 2P, C). Pairs with a value that is not finite are ignored.
        """
        if not self.pairs:
            return np.zeros(values.shape[1])
        up, down = values[self.count : -self.pairs], values[-self.pairs :]
        finite = np.isfinite(up) & np.isfinite(down)
        with np.errstate(invalid="ignore"):
            change = np.where(finite, np.abs(up - down), 0.0)
        distance = self.epsilon**COMPANION_EXPONENT
        largest: Array = SHARED_DIGITS * self.epsilon / (2 * distance) * np.max(change, axis=0)
        return largest


def quantization_error(values: Array, epsilon: float) -> Array:
    """Return the part of values that an engine of this epsilon rounds away.

    With 2^-23 these are the digits after 24 binary digits. The engine starts off by this amount,
    and it is added again to the end. The effect over a short segment is in `Starts.last_digits`.
    """
    if epsilon <= EPSILON:
        return np.zeros_like(values)
    mantissa, exponent = np.frexp(values)
    digits = 2 / epsilon
    lost: Array = values - np.ldexp(np.round(mantissa * digits) / digits, exponent)
    return lost


def without_companions(z: Array, w: Array) -> Starts:
    """Return starts (K, nz) alone, to measure without rounding."""
    return Starts(rows=np.arange(len(z)), z=z, w=w, gain=np.ones(len(z)), pairs=0)


def with_companions(z: Array, w: Array, epsilon: float = EPSILON, every: bool = False) -> Starts:
    """Return starts (K, nz) and their companions, with each number moved by a random share.

    A few starts suffice if rounding is similar for all; with `every`, each one has a pair. All
    inputs of a companion are scaled by one factor: a start at rest in zero has no digits of its
    own, but the motion under its inputs has.
    """
    count = len(z)
    pairs = count if every else min(MAX_PAIRS, max(MIN_PAIRS, count // 4))
    # Spread evenly, away from the ends: a start at rest or at a joint limit is not representative.
    rows = ((np.arange(pairs) + 0.5) * count / pairs).astype(np.intp)
    rng = np.random.default_rng(0)  # the same companions in every run
    distance = epsilon**COMPANION_EXPONENT
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
