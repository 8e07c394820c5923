"""Gauss collocation of many short segments at once.

It has eight stages and order 16 (Hairer, Norsett, Wanner, Solving ODEs I, II.7). This module does
not import scipy, whose import takes half a second.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np

from physics_crosscheck.reference.mechanism.declaration import LocatedError
from physics_crosscheck.reference.mechanism.numeric import Array
from .segments import chebyshev_nodes

STAGES = 8

ITERATIONS = 60
CONVERGED = 4e-16
"""Iteration ends at this change of the stages' rates, relative to the largest of each component."""

NOISE = 1e-12
"""A change below this is rounding if two more iterations do not halve it."""

ROUNDED = 1e-10
"""Change at which an iteration ends early if it no longer decreases."""

MAX_ROUNDED = 1e-9
"""Largest accepted change after all iterations. Rounding disturbs some systems more, such as a
light finger on a heavy body. Two solutions may differ as much; the difference enters the bound."""

STAGNATED = 1e-6
"""A final change below this is rounding; divergence leaves a much larger one."""

STATE_CHANGE, LEAST_STATE = 1e-7, 1e-3
"""Change of a state for the Jacobian of stiff segments, as a share of its size; smallest size."""

Field = Callable[[Array, Array], Array]
"""dy/dt of (times (...,), states (..., 2n))."""


class ReferenceError(LocatedError, RuntimeError):
    """The reference could not be solved to the accuracy that a comparison needs."""

    kind = "reference"


def once_per_times(inputs: Callable[[Array], Array]) -> Callable[[Array], Array]:
    """Return inputs that are not evaluated again for the same array of times.

    All iterations of a step of `collocate` have the same one.
    """
    last, values = np.empty(0), np.empty(0)

    def evaluated(times: Array) -> Array:
        nonlocal last, values
        if times is not last:
            last, values = times, inputs(times)
        return values

    return evaluated


def collocate(
    field: Field,
    times: Array,
    states: Array,
    length: float,
    names: Sequence[str] = (),
    converged: float = CONVERGED,
    floor: Array | float = 1e-300,
) -> tuple[Array, Array]:
    """Integrate B segments: ends (B, 2n) and states at the Chebyshev nodes (B, NODES, 2n).

    A segment takes two steps. Fixed-point iteration solves each stage equation to rounding.

    Args:
        field: dy/dt.
        times: start times, (B,).
        states: start states, (B, 2n).
        length: seconds per segment.
        names: names of the components, for messages.
        converged: change of the stages' rates that ends the iteration.
        floor: sizes of the rates, (2n,), below which they converge absolutely.

    Raises:
        ReferenceError: if the stage equations do not converge.
    """
    nodes, weights, matrix, integrals = gauss(STAGES)
    half = length / 2
    output = np.empty((len(times), len(chebyshev_nodes()), states.shape[1]))
    current = states
    for part in range(2):
        step_times = times + part * half
        stage_times = step_times[:, None] + half * nodes

        def rates(slopes: Array, start: Array = current, times: Array = stage_times) -> Array:
            stages = start[:, None, :] + half * _weighted(matrix, slopes)
            return field(times, stages)

        initial = np.repeat(field(step_times, current)[:, None, :], STAGES, axis=1)
        slopes = _iterated(rates, initial, names, converged, floor)
        inside = [
            (i, 2 * c - part) for i, c in enumerate(chebyshev_nodes()) if part <= 2 * c <= part + 1
        ]
        for i, c in inside:
            output[:, i] = current + half * np.einsum("j,bjc->bc", integrals(c), slopes)
        current = current + half * np.einsum("j,bjc->bc", weights, slopes)
    output[:, 0] = states
    output[:, -1] = current
    return current, output


def stiff_ends(field: Field, states: Array, length: float) -> Array:
    """Integrate B stiff segments in two steps of Radau IIA, by simplified Newton iteration.

    Radau IIA damps what decays within a step. With 8 stages the worst error of such a decay is 2 %
    of its first size, of two steps 0.04 %; what lasts for a step has six digits or more.
    Source: Hairer, Wanner, Solving Ordinary Differential Equations II, IV.5 and IV.8.

    Args:
        field: dy/dt, which does not depend on time.
        states: start states, (B, 2n).
        length: seconds per segment.

    Raises:
        ReferenceError: if the stage equations do not converge.
    """
    step, clock, matrix = length / 2, np.zeros(len(states)), _radau(STAGES)
    values, vectors = np.linalg.eig(matrix)  # to solve for one stage after the other
    back, unit = np.linalg.inv(vectors), np.eye(states.shape[1])
    with np.errstate(all="ignore"):
        for _ in range(2):
            by = STATE_CHANGE * np.maximum(np.abs(states).max(axis=0), LEAST_STATE)
            rates = field(clock, states)[:, None, :]
            apart = field(clock, states[:, None, :] + np.diag(by)) - rates
            jacobian = np.swapaxes(apart / by[:, None], 1, 2)[:, None]
            inverse = np.linalg.inv(unit - step * values[:, None, None] * jacobian)
            slopes, share = np.repeat(rates, STAGES, axis=1), np.inf
            for _ in range(ITERATIONS):
                stages = states[:, None, :] + step * _weighted(matrix, slopes)
                residual = back @ (field(clock, stages) - slopes)
                change = (vectors @ (inverse @ residual[..., None])[..., 0]).real
                slopes = slopes + change
                sizes = np.maximum(np.abs(slopes).max(axis=(0, 1)), 1e-300)
                share = float(np.max(np.abs(change).max(axis=(0, 1)) / sizes))
                if not share > MAX_ROUNDED:
                    break
            if not share <= STAGNATED:
                raise ReferenceError("the stage equations of stiff segments do not converge")
            states = states + step * _weighted(matrix, slopes)[:, -1]
    return states


@lru_cache(maxsize=1)
def _radau(stages: int) -> Array:
    from scipy.special import roots_jacobi  # slow import, for stiff trees only

    nodes = np.append((1 + roots_jacobi(stages - 1, 1, 0)[0]) / 2, 1.0)
    powers = np.arange(1, stages + 1)
    result: Array = nodes[:, None] ** powers / powers @ np.linalg.inv(np.vander(nodes)[:, ::-1])
    return result


def _weighted(matrix: Array, slopes: Array) -> Array:
    """Return weighted sums (B, S, 2n) of the stages' rates (B, S, 2n), as one matrix product."""
    return np.tensordot(matrix, slopes, axes=(1, 1)).swapaxes(0, 1)


def _iterated(
    rates: Callable[[Array], Array],
    slopes: Array,
    names: Sequence[str],
    converged: float,
    floor: Array | float,
) -> Array:
    """Iterate the rates at the stages, (B, STAGES, 2n), to a fixed point.

    Raises:
        ReferenceError: if they do not converge, with the component that changes most.
    """
    before, last, change = np.inf, np.inf, np.inf
    for _ in range(ITERATIONS):
        before, last = last, change
        new = rates(slopes)
        size = np.maximum(np.max(np.abs(new), axis=(0, 1)), floor)
        changes = np.max(np.abs(new - slopes), axis=(0, 1)) / size
        change, slopes = float(np.max(changes)), new
        # A change that no longer shrinks is rounding, which is larger in some equations.
        if change < converged or before / 2 < change < NOISE or last <= change < ROUNDED:
            return slopes
        if not np.isfinite(change):
            break
    worst = int(np.argmax(np.where(np.isfinite(changes), changes, np.inf)))
    name, by = names[worst] if names else f"component {worst}", changes[worst]
    if change < MAX_ROUNDED:
        return slopes
    if by < STAGNATED:
        raise ReferenceError(
            f"rounding hides {by:.1e} of the rate of {name}; a reference needs "
            f"{MAX_ROUNDED:.0e}, and the chain is too long or some parts are too light "
            "for doubles; check parts of the robot in separate files"
        )
    raise ReferenceError(
        "the stage equations of the collocation do not converge: the rate of"
        f" {name} changes by {by:.1e} of its size"
    )


@lru_cache(maxsize=8)
def gauss(stages: int) -> tuple[Array, Array, Array, Callable[[float], Array]]:
    """Return the nodes, weights and matrix of Gauss collocation, and integrals from 0 to c."""
    points, weights = np.polynomial.legendre.leggauss(stages)
    nodes = (points + 1) / 2
    # Integrate each Lagrange basis polynomial from 0 to c through Legendre's integrals: l_j(x) =
    # sum_k (2k+1)/2 w_j P_k(x_j) P_k(x), exact for Gauss points.
    degrees = np.arange(stages)
    values = np.polynomial.legendre.legvander(points, stages - 1)
    coefficients = (2 * degrees[:, None] + 1) / 2 * (values * weights[:, None]).T

    @lru_cache(maxsize=64)
    def integrals(c: float) -> Array:
        x = 2 * c - 1
        primitive = np.polynomial.legendre.legint(coefficients, lbnd=-1, axis=0)
        result: Array = np.asarray(np.polynomial.legendre.legval(x, primitive), dtype=float) / 2
        return result

    matrix = np.array([integrals(c) for c in nodes])
    return nodes, weights / 2, matrix, integrals
