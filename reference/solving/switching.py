"""Segments along which a tree's forces are smooth, found by switching functions.

A drag |u| u has a kink where u changes sign, a spring with a dead band at each end of it. Across a
kink no method of high order has its order, neither the solution's nor an engine's. Segments
therefore start where they cross no kink, and are shortened until enough of them do so.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.collocation import Field, ReferenceError

CANDIDATES_PER_SEGMENT = 4
"""One of so many sampled segments, at least, must cross no kink."""

MAX_HALVINGS = 16
"""Largest number of times that segments are halved to reach `CANDIDATES_PER_SEGMENT`."""

STEPS_PER_SEGMENT = 4
"""Runge-Kutta steps per segment; the sign of each switching function is checked after each."""

ZERO_TOLERANCE = 1e-12
"""A switching function that stays below this, relative to the largest, is zero and has no sign."""

Draw = Callable[[int], tuple[Array, Array]]
"""Sample so many states (K, 2n) and constant forces, (K, n)."""


def smooth_segments(
    equations: TreeEquations,
    field_of: Callable[[Array], Field],
    draw: Draw,
    count: int,
    length: float,
) -> tuple[Array, Array, float]:
    """Return states, forces, and the length of segments that cross no kink.

    Args:
        equations: of the tree.
        field_of: dy/dt under constant forces.
        draw: samples more states and forces.
        count: number of segments.
        length: largest length of segments, seconds.

    Raises:
        ReferenceError: if all segments cross a kink.
    """
    start, forces = draw(CANDIDATES_PER_SEGMENT * count)
    for _ in range(MAX_HALVINGS):
        free = np.flatnonzero(_free(equations, field_of(forces), start, length))
        if len(free) >= count:
            return start[free[:count]], forces[free[:count]], length
        length /= 2
    raise ReferenceError("every segment crosses a kink of the forces, however short it is")


def _free(equations: TreeEquations, field: Field, start: Array, length: float) -> NDArray[np.bool_]:
    """Return the mask of segments that cross no kink, (K,)."""
    n, h = start.shape[1] // 2, length / STEPS_PER_SEGMENT
    times, states = np.zeros(len(start)), [start]
    with np.errstate(all="ignore"):
        for _ in range(STEPS_PER_SEGMENT):
            states.append(_stepped(field, times, states[-1], h))
        values = np.stack([equations.switching_functions(at[:, :n], at[:, n:]) for at in states])
    sizes = np.max(np.abs(values), axis=(0, 1), initial=0.0)
    turned = np.any((values > 0) != (values[0] > 0), axis=0) & (
        sizes > ZERO_TOLERANCE * np.max(sizes, initial=0.0)
    )
    finite = np.isfinite(states[-1]).all(axis=1)
    result: NDArray[np.bool_] = finite & np.logical_not(turned.any(axis=1))
    return result


def _stepped(field: Field, times: Array, states: Array, h: float) -> Array:
    """Take one step of the classical Runge-Kutta method of order 4."""
    k1 = field(times, states)
    k2 = field(times, states + h / 2 * k1)
    k3 = field(times, states + h / 2 * k2)
    k4 = field(times, states + h * k3)
    result: Array = states + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return result
