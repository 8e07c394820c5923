"""What rounding does to an engine's motion, seen in runs from starts close by.

The last digit of a position is a force too, where a constraint is held by a spring: a soft
equality, as stiff as the step allows, makes a velocity of it by dividing it by h, so that the
finest rungs have the most. No rule that knows only the motion foresees that; other runs show it.

Each chosen start has a pair of companions, at the same distance on either side. What the three ends
depend on smoothly drops out of their second difference, and leaves how differently they were
rounded. Source: Hamming's difference table; More and Wild 2011, Estimating Computational Noise,
SIAM J. Sci. Comput. 33(3), with second differences alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harness.numerics.ladder import EPSILON
from reference.numeric import Array

PAIRS = 24
"""Segments with companions: they cost a quarter more steps where there are 200 segments."""

APART = EPSILON ** (2 / 3)
"""Relative distance of a companion, at most: far above a last digit, so that it is rounded
otherwise (one digit away the same roundings come again), and its square far below."""


@dataclass(frozen=True)
class Starts:
    """The starts of K segments, and after them those of the companions, in engine coordinates.

    Attributes:
        rows: segment that each start belongs to, (K + 2 PAIRS,).
        z, w: positions and velocities, each (K + 2 PAIRS, nz).
    """

    rows: NDArray[np.intp]
    z: Array
    w: Array

    def seen(self, ends: Array) -> Array:
        """What rounding does to an end at most, by component, (2n,), from all ends."""
        one, other = ends[-2 * PAIRS : -PAIRS], ends[-PAIRS:]
        between = ends[self.rows[-PAIRS:]]
        largest: Array = np.max(np.abs(one + other - 2 * between), axis=0) / 2
        return largest


def with_companions(z: Array, w: Array) -> Starts:
    """Starts (K, nz) and their companions: each number moved by a share of itself, by draw."""
    count = len(z)
    # An even spread, off the ends: a start at rest, or just at a stop, tells little of the others.
    rows = ((np.arange(PAIRS) + 0.5) * count / PAIRS).astype(np.intp)
    rng = np.random.default_rng(0)  # the same companions in every run
    steps = [APART * rng.uniform(-1, 1, (PAIRS, a.shape[1])) * a[rows] for a in (z, w)]
    moved = [
        np.concatenate([a, a[rows] + step, a[rows] - step])
        for a, step in zip((z, w), steps, strict=True)
    ]
    return Starts(np.concatenate([np.arange(count), rows, rows]), *moved)
