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
from physics_crosscheck.reference.mechanism.signal import SignalPiece, numeric_inputs
from .bounds import each, transitions
from .collocation import CONVERGED, ReferenceError, collocate
from .integrate import by_runge_kutta, checked_bound, field_of, trajectory
from .segments import Motion, Span, start_times

ROUGH_ACCURACY = 1e-6
"""Relative accuracy of the rough motion."""

MAX_SHOTS = 8
"""Largest number of Newton iterations; two are typical."""

JOIN_TOLERANCE = 1e-12
"""Shooting converges if starts move by less than this, relative to the motion's size."""

STALLED = 1e-9
"""Smaller moves that hardly decrease are caused by rounding."""

MAX_NEWTON_MOVE = 0.1
"""Newton's method is not tried if starts must move by more, relative to the motion's size."""

TRANSITION_REUSE_MOVE = 1e-3
"""Starts that move by less keep their transition matrices, relative to the motion's size."""

FIRST_SHOT_CHANGE = 1e-8
"""Change of rates that ends the iterations of the first shot, see `collocate`."""

ROUGH_SAMPLES = 400
"""Samples of the rough motion; Newton's method squares its error."""


def shoot(
    equations: EquationsOfMotion,
    signals: Sequence[SignalPiece],
    spans: tuple[Span, ...],
    times: Array,
    states: Array,
) -> tuple[Motion, Array]:
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
    import scipy.interpolate  # slow import, not needed by every command

    segment_times = start_times(spans)
    guess = scipy.interpolate.CubicSpline(times, states)(segment_times)
    guess[0] = states[0]
    solved = equations, signals, spans, segment_times
    try:
        with np.errstate(all="ignore"):
            starts, end, nodes, flow = _joined(*solved, guess)
    except ReferenceError:
        starts = trajectory(equations, states[0], signals, segment_times)
        starts[0] = states[0]
        end, nodes = _segments(*solved, starts, CONVERGED)
        flow = _transitions(*solved, starts)
    checks = [
        by_runge_kutta(field_of(equations, signal), segment_times[rows], starts[rows], span.length)
        for rows, span, signal in each(spans, signals)
    ]
    motion = Motion.join(
        spans,
        numeric_inputs(signals),
        start=starts,
        end=end,
        nodes=nodes,
        bound=checked_bound(end, np.concatenate(checks)),
        method="multiple shooting by Gauss collocation, checked by DOP853",
    )
    return motion, flow


def _segments(
    equations: EquationsOfMotion,
    signals: Sequence[SignalPiece],
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
    for rows, span, signal in each(spans, signals):
        field = field_of(equations, signal)
        end, nodes = collocate(field, times[rows], starts[rows], span.length, converged=converged)
        ends.append(end)
        inner.append(nodes)
    return np.concatenate(ends), np.concatenate(inner)


def _transitions(
    equations: EquationsOfMotion,
    signals: Sequence[SignalPiece],
    spans: Sequence[Span],
    times: Array,
    starts: Array,
) -> Array:
    """Return the derivatives of segments' ends by their starts, (K, 2n, 2n)."""
    return np.concatenate(
        [
            transitions(field_of(equations, signal), times[rows], starts[rows], span.length)
            for rows, span, signal in each(spans, signals)
        ]
    )


def _joined(
    equations: EquationsOfMotion,
    signals: Sequence[SignalPiece],
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
    for shot in range(MAX_SHOTS):
        # Newton's method corrects these starts, so few digits suffice.
        end, nodes = _segments(*solved, starts, FIRST_SHOT_CHANGE if shot == 0 else CONVERGED)
        if worst > TRANSITION_REUSE_MOVE:
            flow = _transitions(*solved, starts)
        moved = _moves(flow, end[:-1] - starts[1:])
        worst, before = float(np.max(np.abs(moved) / size, initial=0.0)), worst
        # If it no longer decreases, only rounding along the chain remains.
        joined = worst <= JOIN_TOLERANCE or (worst < STALLED and worst > before / 4)
        if joined and shot > 0:
            return starts, end, nodes, flow
        if not worst <= MAX_NEWTON_MOVE:
            break
        starts = np.concatenate([starts[:1], starts[1:] + moved])
    raise ReferenceError("the segments of the motion can't be joined because it grows too fast")


def _moves(flow: Array, jumps: Array) -> Array:
    """Return Newton's step: the move of each start except the first, (K - 1, 2n)."""
    moved = np.empty_like(jumps)
    carried = np.zeros(flow.shape[1])
    with np.errstate(over="ignore", invalid="ignore"):
        for k, (turn, jump) in enumerate(zip(flow, jumps, strict=False)):
            carried = turn @ carried + jump
            moved[k] = carried
    return moved
