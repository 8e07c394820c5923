"""Multiple shooting: all segments of a motion at once, joined by Newton's method.

A rough motion gives the first starts. Gauss collocation solves all segments from there, and
Newton's method moves the starts until the segments join. Source: Deuflhard and Bornemann 2002,
Scientific Computing with Ordinary Differential Equations, section 8.1. A second integration checks
each segment, as in `solving.integrate`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from physics_crosscheck.reference.dynamics.equations import EquationsOfMotion
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.signal import Piece
from physics_crosscheck.reference.solving.bounds import each, transitions
from physics_crosscheck.reference.solving.closed_form import Segments
from physics_crosscheck.reference.solving.collocation import CONVERGED, ReferenceError, collocate
from physics_crosscheck.reference.solving.integrate import (
    by_runge_kutta,
    field_of,
    held_together,
    trajectory,
)
from physics_crosscheck.reference.solving.motion import Span

ROUGH_ACCURACY = 1e-6
"""Relative accuracy of the rough motion."""

SHOTS = 8
"""Newton iterations at most; two are the rule."""

JOINED = 1e-12
"""Of the motion's size: by so much starts may still move where the shooting ends."""

SETTLED = 1e-9
"""Where they move by less, and by hardly less than before, rounding is what moves them."""

FAR = 0.1
"""Of the motion's size: where starts are to be moved by more, Newton's method is not begun."""

NEAR = 1e-3
"""Of the motion's size: starts that move by less keep their transition matrices."""

ROUGHLY = 1e-8
"""Change of rates that ends the iterations of the first shot, see `collocate`."""

ROUGH = 400
"""Samples of the rough motion, as in `solving.solve`: Newton's method squares what it is off."""


def shoot(
    equations: EquationsOfMotion,
    signals: Sequence[Piece],
    spans: Sequence[Span],
    times: Array,
    states: Array,
) -> tuple[Segments, Array]:
    """Solve all segments of a motion, and return them with their transition matrices (K, 2n, 2n).

    A chaotic motion, from which the rough one is too far, is integrated step by step instead.

    Args:
        equations: of motion.
        signals: the inputs.
        spans: how segments tile the motion.
        times: of the rough motion, (S,).
        states: of the rough motion, (S, 2n); the first is the start.

    Raises:
        ReferenceError: where the equations can't be solved, or the two integrations differ.
    """
    import scipy.interpolate  # takes a part of a second, in every command

    at = np.concatenate([s.start + s.length * np.arange(s.count) for s in spans])
    guess = scipy.interpolate.CubicSpline(times, states)(at)
    guess[0] = states[0]
    solved = equations, signals, spans, at
    try:
        with np.errstate(all="ignore"):
            starts, end, nodes, flow = _joined(*solved, guess)
    except ReferenceError:
        starts = trajectory(equations, states[0], signals, at)
        starts[0] = states[0]
        end, nodes = _segments(*solved, starts, CONVERGED)
        flow = _transitions(*solved, starts)
    checks = [
        by_runge_kutta(field_of(equations, piece), at[rows], starts[rows], span.length)
        for rows, span, piece in each(spans, signals)
    ]
    segments = Segments(
        t=at,
        start=starts,
        end=end,
        nodes=nodes,
        bound=held_together(end, np.concatenate(checks)),
        method="multiple shooting by Gauss collocation, checked by DOP853",
    )
    return segments, flow


def _segments(
    equations: EquationsOfMotion,
    signals: Sequence[Piece],
    spans: Sequence[Span],
    times: Array,
    starts: Array,
    converged: float,
) -> tuple[Array, Array]:
    """Return the ends and the nodes of segments.

    Raises:
        ReferenceError: where the collocation does not converge.
    """
    ends, inner = [], []
    for rows, span, piece in each(spans, signals):
        field = field_of(equations, piece)
        end, nodes = collocate(field, times[rows], starts[rows], span.length, converged=converged)
        ends.append(end)
        inner.append(nodes)
    return np.concatenate(ends), np.concatenate(inner)


def _transitions(
    equations: EquationsOfMotion,
    signals: Sequence[Piece],
    spans: Sequence[Span],
    times: Array,
    starts: Array,
) -> Array:
    """Return the derivatives of segments' ends by their starts, (K, 2n, 2n)."""
    return np.concatenate(
        [
            transitions(field_of(equations, piece), times[rows], starts[rows], span.length)
            for rows, span, piece in each(spans, signals)
        ]
    )


def _joined(
    equations: EquationsOfMotion,
    signals: Sequence[Piece],
    spans: Sequence[Span],
    times: Array,
    starts: Array,
) -> tuple[Array, Array, Array, Array]:
    """Return joined starts of segments, their ends, nodes and transitions.

    Raises:
        ReferenceError: where Newton's method does not join them.
    """
    solved = equations, signals, spans, times
    size = np.maximum(np.max(np.abs(starts), axis=0), 1e-300)
    worst = np.inf
    for shot in range(SHOTS):
        # Newton's method corrects these starts, so few digits suffice.
        end, nodes = _segments(*solved, starts, ROUGHLY if shot == 0 else CONVERGED)
        if worst > NEAR:
            flow = _transitions(*solved, starts)
        moved = _moves(flow, end[:-1] - starts[1:])
        worst, before = float(np.max(np.abs(moved) / size, initial=0.0)), worst
        # Where it falls no more, rounding along the chain is all that is left of it.
        joined = worst <= JOINED or (worst < SETTLED and worst > before / 4)
        if joined and shot > 0:
            return starts, end, nodes, flow
        if not worst <= FAR:
            break
        starts = np.concatenate([starts[:1], starts[1:] + moved])
    raise ReferenceError("the segments of the motion can't be joined because it grows too fast")


def _moves(flow: Array, jumps: Array) -> Array:
    """By how much each start but the first is to be moved, (K - 1, 2n): Newton's step."""
    moved = np.empty_like(jumps)
    carried = np.zeros(flow.shape[1])
    with np.errstate(over="ignore", invalid="ignore"):
        for k, (turn, jump) in enumerate(zip(flow, jumps, strict=False)):
            carried = turn @ carried + jump
            moved[k] = carried
    return moved
