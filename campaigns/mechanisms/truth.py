"""Ends of segments by the equations, to about eighteen digits, with a bound of their error.

The method is Gauss collocation (Hairer, Norsett and Wanner, Solving ODEs I, II.7) in `longdouble`,
for all segments and stages at once. Picard's iteration solves for the stages; its error falls as
L^k / k!, where L is the segment's length times the fastest rate. Each segment is solved in one step
and in two. The ends are those of two steps; the distance to one step bounds their error.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import mpmath as mp
import numpy as np

from campaigns.mechanisms.dynamics import MechanismDynamics, Real

STAGES = 8
"""Stages of a step: order 16, relative error about 1e-22 at 1/20 of the fastest period."""

MAX_ITERATIONS = 40
"""Largest number of iterations; a dozen are usual."""

ROUNDING = 1e-15
"""Largest relative rounding of accelerations, for light bodies on heavy ones."""

EPSILON = float(np.finfo(np.longdouble).eps)


class TruthError(RuntimeError):
    """An error of equations that could not be solved to the required digits."""


@dataclass(frozen=True, kw_only=True)
class SegmentEnds:
    """Ends of K segments of n joints.

    Attributes:
        states: (q, v) at the ends, (K, 2n), in `longdouble`.
        error: bound for each component, (2n,): distance from one step to two, plus rounding.
    """

    states: Real
    error: Real


def ends(dynamics: MechanismDynamics, t: Real, states: Real, length: float) -> SegmentEnds:
    """Return the ends of segments from times t (K,) and states (K, 2n), of equal length, s.

    Raises:
        TruthError: if the iterations don't converge.
    """
    times, start = t.astype(np.longdouble), states.T.astype(np.longdouble)
    whole: Real = np.array(length, np.longdouble)
    half: Real = whole / 2
    once = step(dynamics, times, start, whole)
    twice = step(dynamics, times + half, step(dynamics, times, start, half), half)
    rounding = 8 * EPSILON * np.max(np.abs(twice), axis=1)
    error = np.max(np.abs(once - twice), axis=1) + rounding
    return SegmentEnds(states=twice.T, error=error)


@np.errstate(all="ignore")
def step(dynamics: MechanismDynamics, t: Real, states: Real, h: Real) -> Real:
    """Return the states (2n, K) after a step h, s, from times t (K,)."""
    nodes, weights, matrix = gauss()
    n, count = len(states) // 2, len(t)
    times = (t + h * nodes[:, None]).ravel()
    v = np.repeat(states[n:, None], STAGES, axis=1)
    a = np.zeros_like(v)
    before = np.inf
    for _ in range(MAX_ITERATIONS):
        velocities = states[n:, None] + h * np.einsum("ij,njk->nik", matrix, a)
        positions = states[:n, None] + h * np.einsum("ij,njk->nik", matrix, velocities)
        new = dynamics.acceleration(times, positions.reshape(n, -1), velocities.reshape(n, -1))
        new = new.reshape(n, STAGES, count)
        change = np.max(np.abs(new - a))
        size = np.max(np.abs(new))
        v, a = velocities, new
        # A change that no longer falls is rounding.
        if change <= 64 * EPSILON * size or before / 2 <= change <= ROUNDING * size:
            break
        before = change
    else:
        raise TruthError(
            f"the collocation does not converge: relative change {float(change / size):.0e}"
        )
    v = states[n:, None] + h * np.einsum("ij,njk->nik", matrix, a)
    q_end = states[:n] + h * np.einsum("j,njk->nk", weights, v)
    v_end = states[n:] + h * np.einsum("j,njk->nk", weights, a)
    return np.concatenate([q_end, v_end])


@lru_cache(maxsize=1)
def gauss() -> tuple[Real, Real, Real]:
    """Return nodes on [0, 1], weights, and integrals of the Lagrange polynomials to each node."""
    with mp.workdps(40):
        roots = sorted(mp.polyroots(_legendre(STAGES)[::-1], maxsteps=200, extraprec=200))
        points = [(1 + x) / 2 for x in roots]
        table = mp.matrix(STAGES)
        for power in range(STAGES):
            for j, c in enumerate(points):
                table[power, j] = c**power
        # Row i of the matrix integrates every power up to c_i exactly, the weights up to 1.
        rows = []
        for upper in (*points, mp.mpf(1)):
            exact = mp.matrix([upper ** (k + 1) / (k + 1) for k in range(STAGES)])
            rows.append([_long(x) for x in mp.lu_solve(table, exact)])
        nodes = np.array([_long(c) for c in points])
    return nodes, np.array(rows[-1]), np.array(rows[:-1])


def _legendre(degree: int) -> list[mp.mpf]:
    """Return the coefficients of a Legendre polynomial, constant first, by Bonnet's recursion."""
    before, here = [mp.mpf(1)], [mp.mpf(0), mp.mpf(1)]
    for k in range(1, degree):
        after = [mp.mpf(0), *((2 * k + 1) * c / (k + 1) for c in here)]
        for i, c in enumerate(before):
            after[i] -= k * c / (k + 1)
        before, here = here, after
    return here


def _long(value: mp.mpf) -> np.longdouble:
    return np.longdouble(mp.nstr(value, 30))
