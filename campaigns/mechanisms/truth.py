"""Where segments must end, to eighteen digits or so, and how many of these were reached.

Gauss collocation (Hairer, Norsett and Wanner, Solving ODEs I, II.7) in `longdouble`, all segments
and stages at once. The stages are found by Picard's iteration, whose error falls as L^k / k! with
L the segment's length times the fastest rate. Each segment is done in one step and in two; the
ends are those of the two, and their distance bounds their error.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import mpmath as mp
import numpy as np

from campaigns.mechanisms.dynamics import Dynamics, Real

STAGES = 8
"""Order 16: a step of a twentieth of the fastest period errs by some 1e-22 of the motion."""

MOST = 40
"""Iterations until nothing changes, at most; a dozen are usual."""

SETTLED = 1e-15
"""What rounding may leave of accelerations, where light bodies hang on heavy ones."""

EPSILON = float(np.finfo(np.longdouble).eps)


class TruthError(RuntimeError):
    """The equations could not be solved to the digits that are needed."""


@dataclass(frozen=True, kw_only=True)
class Ends:
    """Of K segments of n joints.

    Attributes:
        states: (q, v) at the ends, (K, 2n), in `longdouble`.
        error: of each component at most, (2n,): the distance of one step and two, and rounding.
    """

    states: Real
    error: Real


def ends(dynamics: Dynamics, t: Real, states: Real, length: float) -> Ends:
    """Where segments from times t (K,) and states (K, 2n), all of one length in seconds, end.

    Raises:
        TruthError: where the iterations don't settle.
    """
    times, start = t.astype(np.longdouble), states.T.astype(np.longdouble)
    whole: Real = np.array(length, np.longdouble)
    half: Real = whole / 2
    once = step(dynamics, times, start, whole)
    twice = step(dynamics, times + half, step(dynamics, times, start, half), half)
    rounding = 8 * EPSILON * np.max(np.abs(twice), axis=1)
    error = np.max(np.abs(once - twice), axis=1) + rounding
    return Ends(states=twice.T, error=error)


@np.errstate(all="ignore")
def step(dynamics: Dynamics, t: Real, states: Real, h: Real) -> Real:
    """States (2n, K) after one step of h from times (K,)."""
    nodes, weights, matrix = gauss()
    n, count = len(states) // 2, len(t)
    times = (t + h * nodes[:, None]).ravel()
    v = np.repeat(states[n:, None], STAGES, axis=1)
    a = np.zeros_like(v)
    before = np.inf
    for _ in range(MOST):
        velocities = states[n:, None] + h * np.einsum("ij,njk->nik", matrix, a)
        positions = states[:n, None] + h * np.einsum("ij,njk->nik", matrix, velocities)
        new = dynamics.acceleration(times, positions.reshape(n, -1), velocities.reshape(n, -1))
        new = new.reshape(n, STAGES, count)
        change = np.max(np.abs(new - a))
        size = np.max(np.abs(new))
        v, a = velocities, new
        # Where it falls no more, rounding is left.
        if change <= 64 * EPSILON * size or before / 2 <= change <= SETTLED * size:
            break
        before = change
    else:
        raise TruthError(f"the collocation does not settle: {float(change / size):.0e} is left")
    v = states[n:, None] + h * np.einsum("ij,njk->nik", matrix, a)
    q_end = states[:n] + h * np.einsum("j,njk->nk", weights, v)
    v_end = states[n:] + h * np.einsum("j,njk->nk", weights, a)
    return np.concatenate([q_end, v_end])


@lru_cache(maxsize=1)
def gauss() -> tuple[Real, Real, Real]:
    """Nodes on [0, 1], weights, and the integrals of the Lagrange polynomials up to each node."""
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
    """Coefficients from the constant on, by Bonnet's recursion."""
    before, here = [mp.mpf(1)], [mp.mpf(0), mp.mpf(1)]
    for k in range(1, degree):
        after = [mp.mpf(0), *((2 * k + 1) * c / (k + 1) for c in here)]
        for i, c in enumerate(before):
            after[i] -= k * c / (k + 1)
        before, here = here, after
    return here


def _long(value: mp.mpf) -> np.longdouble:
    return np.longdouble(mp.nstr(value, 30))
