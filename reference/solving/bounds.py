"""Error bounds of a reference motion: over a segment, and accumulated from its start."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from physics_crosscheck.reference.dynamics.derive import UNIT, running_error
from physics_crosscheck.reference.dynamics.equations import EquationsOfMotion
from physics_crosscheck.reference.mechanism.declaration import t
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.signal import SignalPiece
from .collocation import Field
from .integrate import field_of
from .segments import Motion, Span, chebyshev_nodes

ROUNDING_NODES = slice(None, None, 5)
"""Nodes of a segment at which rounding is estimated: start, middle and end."""

MAX_BOXES = 256
"""Largest number of error boxes propagated along a motion, besides those of the current block."""


def with_bounds(
    equations: EquationsOfMotion,
    signals: Sequence[SignalPiece],
    motion: Motion,
    *,
    exact: bool,
    flow: Array | None = None,
    along: bool = True,
) -> Motion:
    """Return a solved motion with the bounds of its segments, and along it.

    Args:
        motion: the motion, with the bound of its solution method.
        exact: whether it, and the inputs' values, were computed with more digits than a double.
        flow: transition matrices of the segments, (K, 2n, 2n), if they are known.
        along: whether to bound the error of the states against the motion from the start.
    """
    flows, turned, rates = [], [], []
    for rows, span, signal in each(motion.spans, signals):
        field = field_of(equations, signal)
        times, starts = motion.t[rows], motion.start[rows]
        flow_here = transitions(field, times, starts, span.length) if flow is None else flow[rows]
        flows.append(flow_here)
        turned.append(
            rounded_away(
                equations,
                signal,
                times,
                motion.nodes[rows],
                span.length,
                flow=flow_here,
                rounded=not exact,
            )
        )
        rates.append(field(times + span.length, motion.end[rows]))
    motion = replace(motion, bound=motion.bound + np.max(np.concatenate(turned), axis=0))
    if not along:
        return motion
    times, slopes = np.append(motion.t, motion.duration), np.concatenate(rates)
    if exact:
        return replace(motion, global_bound=_rounded(motion, times, slopes))
    return replace(motion, global_bound=_chained(motion, times, np.concatenate(flows), slopes))


def each(
    spans: Sequence[Span], signals: Sequence[SignalPiece]
) -> Iterator[tuple[slice, Span, SignalPiece]]:
    """Yield the rows of each span's segments, the span, and the inputs over it."""
    first = 0
    for span, signal in zip(spans, signals, strict=True):
        yield slice(first, first + span.count), span, signal
        first += span.count


def transitions(field: Field, times: Array, states: Array, length: float) -> Array:
    """Return the derivatives of B segments' ends by their starts, (B, 2n, 2n).

    They are differences of two steps of the classical Runge-Kutta method. Over a twentieth of the
    fastest period their relative error is 1e-6; a bound needs two digits.
    """
    size = np.maximum(np.max(np.abs(states), axis=0), 1e-6)
    base = _two_steps(field, times, states, length)
    columns = []
    for i, step in enumerate(1e-6 * size):
        moved = _two_steps(field, times, states + step * np.eye(len(size))[i], length)
        columns.append((moved - base) / step)
    return np.stack(columns, axis=2)


def _two_steps(field: Field, times: Array, states: Array, length: float) -> Array:
    h, y = length / 2, states
    for part in range(2):
        now = times + part * h
        k1 = field(now, y)
        k2 = field(now + h / 2, y + h / 2 * k1)
        k3 = field(now + h / 2, y + h / 2 * k2)
        k4 = field(now + h, y + h * k3)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return y


def rounded_away(
    equations: EquationsOfMotion,
    signal: SignalPiece,
    times: Array,
    nodes: Array,
    length: float,
    *,
    flow: Array,
    rounded: bool,
) -> Array:
    """Return the effect of rounded accelerations on the ends of B segments, (B, 2n).

    Args:
        times: start times, (B,).
        nodes: states at the Chebyshev nodes, (B, NODES, 2n).
        flow: `transitions` of the segments.
        rounded: whether the accelerations' own terms are evaluated in doubles.
    """
    forces = _acceleration_error(equations, signal, times, nodes, length, rounded=rounded)
    return _turned(flow, forces, length)


def _acceleration_error(
    equations: EquationsOfMotion,
    signal: SignalPiece,
    times: Array,
    nodes: Array,
    length: float,
    *,
    rounded: bool,
) -> Array:
    """Return a bound of the error of the accelerations over B segments, (B, n).

    A time within a segment is t = t_k + c h, with t_k = t_0 + k H. Of these four roundings, each
    sum costs half a unit in the last place of t, and both products together cost at most as much.
    So t has a relative error of 3 units of roundoff. An input u(t) has its slope times that error,
    plus the rounding of its own terms; the phase w t of sin(w t) adds one more. The accelerations
    have the effect of both, plus the rounding of their own terms if doubles evaluate them.
    """
    n = nodes.shape[-1] // 2
    node_times = times[:, None] + length * chebyshev_nodes()[ROUNDING_NODES]
    time_error = 3 * UNIT * np.abs(node_times)
    error = equations.acceleration_error(
        nodes[:, ROUNDING_NODES],
        signal.numeric(node_times[..., None]),
        node_times,
        off=running_error(signal.expressions, {t: (node_times, time_error)}),
        time_error=time_error,
        rounded=rounded,
    )
    result: Array = np.max(error.reshape(len(times), -1, n), axis=1)
    return result


def _turned(flow: Array, forces: Array, length: float) -> Array:
    """Return the effect of acceleration errors, (B, n), on the ends of B segments, (B, 2n).

    It is the integral of |transition from s to the end| [0, error] over the segment, by the
    trapezoidal rule: H for velocities, H^2 / 2 for positions, times the transition of the
    equations.
    """
    jolt = np.concatenate([np.zeros_like(forces), forces], axis=1)
    carried = np.einsum("bij,bj->bi", np.abs(flow), jolt)
    result: Array = length / 2 * (jolt + carried)
    return result


def _rounded(motion: Motion, times: Array, rates: Array) -> Array:
    """Return a bound of the error of states that are computed with more digits, (K + 1, 2n).

    It contains the rounding of a state, and of its time, to doubles.
    """
    states = np.concatenate([motion.start, motion.end[-1:]])
    slopes = np.abs(np.concatenate([rates[:1], rates]))
    slopes[1:-1] = np.maximum(slopes[1:-1], slopes[2:])
    result: Array = 2 * UNIT * np.abs(states) + 3 * UNIT * times[:, None] * slopes
    result[0] = 0.0
    return result


def _chained(motion: Motion, times: Array, flows: Array, rates: Array) -> Array:
    """Return a bound of the error of the states along the chain of segments, (K + 1, 2n).

    The motion has the error e_k at the start of segment k. The equations propagate it to the
    segment's end, and the next start differs from that end: e_(k+1) = F_k e_k + (start - end), with
    F_k the transition. This part is known with its sign. The ends have the bound b, which adds
    sum_j |F_k ... F_(j+1)| b to first order. The products are taken before the magnitudes;
    otherwise the bound would grow with each rotation (the wrapping effect; Nedialkov, Jackson,
    Corliss 1999, Applied Mathematics and Computation 105(1), section 4).
    """
    # The next start's time is a double, which differs from the segment's end by rounding.
    time_errors = np.diff(times) - motion.lengths
    starts = np.concatenate([motion.start[1:], motion.end[-1:]])
    size = np.maximum(np.max(np.abs(motion.end), axis=0), 1e-300)
    jumps = (starts - motion.end - time_errors[:, None] * rates) / size
    turns = flows * size / size[:, None]
    spread = _Spread.none(len(size), block=-(-len(jumps) // MAX_BOXES))
    error = np.zeros_like(size)
    chain = np.zeros((len(times), len(size)))
    with np.errstate(over="ignore", invalid="ignore"):
        for k, (turn, jump) in enumerate(zip(turns, jumps, strict=True), 1):
            error = turn @ error + jump
            spread = spread.carried(turn, motion.bound / size)
            chain[k] = np.abs(error) + spread.size
    return np.where(np.isfinite(chain), chain * size, np.inf)


@dataclass(frozen=True, kw_only=True)
class _Spread:
    """Error boxes, each with the transition from its origin to the current segment.

    Attributes:
        past: boxes of complete blocks, (J, 2n).
        past_turns: their transitions, (J, 2n, 2n).
        current: boxes of the segments since the last complete block.
        current_turns: their transitions.
        block: segments per block; blocks keep the cost from growing with the square of the length.
    """

    past: Array
    past_turns: Array
    current: Array
    current_turns: Array
    block: int

    @staticmethod
    def none(size: int, block: int) -> _Spread:
        """Return an empty set of boxes."""
        boxes, turns = np.zeros((0, size)), np.zeros((0, size, size))
        return _Spread(
            past=boxes, past_turns=turns, current=boxes, current_turns=turns, block=block
        )

    def carried(self, turn: Array, box: Array) -> _Spread:
        """Return the boxes one segment later, with a new box at its end."""
        past, past_turns = self.past, turn @ self.past_turns
        current = np.concatenate([self.current, box[None]])
        here = np.eye(len(box))[None]
        current_turns = np.concatenate([turn @ self.current_turns, here])
        if len(current) == self.block:
            past = np.concatenate([past, _sum(current, current_turns)[None]])
            past_turns = np.concatenate([past_turns, here])
            current, current_turns = current[:0], current_turns[:0]
        return _Spread(
            past=past,
            past_turns=past_turns,
            current=current,
            current_turns=current_turns,
            block=self.block,
        )

    @property
    def size(self) -> Array:
        """The box that encloses the sum of all boxes, (2n,)."""
        return _sum(self.past, self.past_turns) + _sum(self.current, self.current_turns)


def _sum(boxes: Array, turns: Array) -> Array:
    total: Array = np.einsum("jcd,jd->c", np.abs(turns), boxes)
    return total
