"""Segments along which a tree's forces are smooth: those that pass none of their bends.

A drag |u| u has a bend where u turns, a spring with play one at each end of it. Across such a place
no method of high order has its order, neither the solution's nor an engine's. So segments start
where none is passed, and are shorter the more bends there are.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.collocation import Field, ReferenceError

SHARE = 4
"""Of so many states that are drawn, one at least passes no bend."""

HALVINGS = 16
"""How often segments are halved until that is so."""

STEPS = 4
"""Steps of a Runge-Kutta method by which a motion is looked at; bends are looked for after each."""

NOTHING = 1e-12
"""Of the largest, a quantity that is never more than this is zero, and turns nowhere."""

Draw = Callable[[int], tuple[Array, Array]]
"""So many states (K, 2n), and forces that are held, (K, n)."""


def unbent(
    equations: TreeEquations,
    field_of: Callable[[Array], Field],
    draw: Draw,
    count: int,
    length: float,
) -> tuple[Array, Array, float]:
    """States, forces, and the length of segments from there that pass no bend.

    Args:
        equations: of the tree.
        field_of: rates of states under forces that are held.
        draw: more of both.
        count: how many are wanted.
        length: of segments at most, seconds.

    Raises:
        ReferenceError: where there are none.
    """
    start, forces = draw(SHARE * count)
    for _ in range(HALVINGS):
        free = np.flatnonzero(_free(equations, field_of(forces), start, length))
        if len(free) >= count:
            return start[free[:count]], forces[free[:count]], length
        length /= 2
    raise ReferenceError("every segment crosses a kink of the forces, however short it is")


def _free(equations: TreeEquations, field: Field, start: Array, length: float) -> NDArray[np.bool_]:
    """Which segments pass none, (K,)."""
    n, h = start.shape[1] // 2, length / STEPS
    times, states = np.zeros(len(start)), [start]
    with np.errstate(all="ignore"):
        for _ in range(STEPS):
            states.append(_stepped(field, times, states[-1], h))
        bends = np.stack([equations.bends(at[:, :n], at[:, n:]) for at in states])
    sizes = np.max(np.abs(bends), axis=(0, 1), initial=0.0)
    turned = np.any((bends > 0) != (bends[0] > 0), axis=0) & (
        sizes > NOTHING * np.max(sizes, initial=0.0)
    )
    finite = np.isfinite(states[-1]).all(axis=1)
    found: NDArray[np.bool_] = finite & np.logical_not(turned.any(axis=1))
    return found


def _stepped(field: Field, times: Array, states: Array, h: float) -> Array:
    """One step of the classical method of order 4."""
    one = field(times, states)
    two = field(times, states + h / 2 * one)
    three = field(times, states + h / 2 * two)
    four = field(times, states + h * three)
    found: Array = states + h / 6 * (one + 2 * two + 2 * three + four)
    return found
