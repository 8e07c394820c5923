"""Many short segments at once by Gauss collocation, in numbers alone.

Eight stages, order 16 (Hairer, Norsett, Wanner, Solving ODEs I, II.7). It has a file of its own
because what solves no other way need not load scipy, which takes half a second.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from reference.declaration import LocatedError
from reference.motion import chebyshev_nodes
from reference.numeric import Array

STAGES = 8

CONVERGED = 1e-12
"""Change of the stages' slopes in an iteration, relative to the largest of their kind, below which
they are known as well as rounding lets them, once two more do not halve it."""

Field = Callable[[Array, Array], Array]
"""dy/dt of (times (...,), states (..., 2n))."""


class ReferenceError(LocatedError, RuntimeError):
    """The reference could not be solved to the accuracy that a comparison needs."""


def collocate(field: Field, times: Array, states: Array, length: float) -> tuple[Array, Array]:
    """Integrate B segments at once: ends (B, 2n) and states at the Chebyshev nodes (B, NODES, 2n).

    Two steps a segment; each stage equation is solved by fixed-point iteration, to rounding.
    """
    nodes, weights, matrix, integrals = gauss(STAGES)
    half = length / 2
    output = np.empty((len(times), len(chebyshev_nodes()), states.shape[1]))
    current = states
    for part in range(2):
        at = times + part * half
        stage_times = at[:, None] + half * nodes
        slopes = np.repeat(field(at, current)[:, None, :], STAGES, axis=1)
        before, last, change = np.inf, np.inf, np.inf
        for _ in range(60):
            before, last = last, change
            stages = current[:, None, :] + half * np.einsum("ij,bjc->bic", matrix, slopes)
            new = field(stage_times, stages)
            change = np.max(np.abs(new - slopes) / (1e-300 + np.max(np.abs(new), axis=(0, 1))))
            slopes = new
            # What no longer shrinks is rounding, of which some equations have more than others.
            if change < 4e-16 or before / 2 < change < CONVERGED:
                break
        if not np.isfinite(change) or change > CONVERGED:
            raise ReferenceError("the stage equations of the collocation do not converge")
        inside = [
            (i, 2 * c - part) for i, c in enumerate(chebyshev_nodes()) if part <= 2 * c <= part + 1
        ]
        for i, c in inside:
            output[:, i] = current + half * np.einsum("j,bjc->bc", integrals(c), slopes)
        current = current + half * np.einsum("j,bjc->bc", weights, slopes)
    output[:, 0] = states
    output[:, -1] = current
    return current, output


def gauss(stages: int) -> tuple[Array, Array, Array, Callable[[float], Array]]:
    """Gauss collocation: nodes, weights, the matrix of its stages, and integrals from 0 to c."""
    points, weights = np.polynomial.legendre.leggauss(stages)
    nodes = (points + 1) / 2
    # Integral of each Lagrange basis polynomial from 0 to c, through Legendre's own integrals:
    # l_j(x) = sum_k (2k+1)/2 w_j P_k(x_j) P_k(x), exact for Gauss points.
    degrees = np.arange(stages)
    values = np.polynomial.legendre.legvander(points, stages - 1)
    coefficients = (2 * degrees[:, None] + 1) / 2 * (values * weights[:, None]).T

    def integrals(c: float) -> Array:
        x = 2 * c - 1
        primitive = np.polynomial.legendre.legint(coefficients, lbnd=-1, axis=0)
        result: Array = np.asarray(np.polynomial.legendre.legval(x, primitive), dtype=float) / 2
        return result

    matrix = np.array([integrals(c) for c in nodes])
    return nodes, weights / 2, matrix, integrals
