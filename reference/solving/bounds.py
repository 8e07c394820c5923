"""How far a reference motion may be off: over a segment, and from the start of the motion on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from physics_crosscheck.reference.dynamics.equations import EquationsOfMotion
from physics_crosscheck.reference.dynamics.roundoff import UNIT, running_error
from physics_crosscheck.reference.mechanism.declaration import t
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.signal import Piece
from physics_crosscheck.reference.solving.closed_form import Segments
from physics_crosscheck.reference.solving.collocation import Field
from physics_crosscheck.reference.solving.integrate import field_of
from physics_crosscheck.reference.solving.motion import Span, chebyshev_nodes

LOOKED_AT = slice(None, None, 5)
"""Nodes of a segment at which rounding is looked at: its start, its middle and its end."""

BLOCKS = 256
"""Boxes that are carried along a motion, at most, beside those of the present block."""


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """The bounds of a motion; the fields are those of `Motion`."""

    bound: Array
    global_bound: Array


def bounds(
    equations: EquationsOfMotion,
    signals: Sequence[Piece],
    spans: Sequence[Span],
    segments: Segments,
    *,
    exact: bool,
    flow: Array | None = None,
) -> Bounds:
    """Return the bounds of solved segments.

    Args:
        segments: with the bound of the solution itself.
        exact: whether they were solved with more digits than double has, the inputs' values too.
        flow: transition matrices of the segments, (K, 2n, 2n), if they are known.
    """
    flows, turned, rates = [], [], []
    for rows, span, piece in each(spans, signals):
        field = field_of(equations, piece)
        at, starts = segments.t[rows], segments.start[rows]
        own = transitions(field, at, starts, span.length) if flow is None else flow[rows]
        nodes = segments.nodes[rows]
        flows.append(own)
        turned.append(
            rounded_away(equations, piece, at, nodes, span.length, flow=own, rounded=not exact)
        )
        rates.append(field(at + span.length, segments.end[rows]))
    bound = segments.bound + np.max(np.concatenate(turned), axis=0)
    times = np.append(segments.t, spans[-1].start + spans[-1].length * spans[-1].count)
    slopes = np.concatenate(rates)
    if exact:
        return Bounds(bound=bound, global_bound=_rounded(segments, times, slopes))
    turns = np.concatenate(flows)
    lengths = np.concatenate([np.full(span.count, span.length) for span in spans])
    chain = _chained(segments, times, lengths, turns, slopes, bound)
    return Bounds(bound=bound, global_bound=chain)


def each(spans: Sequence[Span], signals: Sequence[Piece]) -> Iterator[tuple[slice, Span, Piece]]:
    """The rows of each span's segments, the span, and the inputs over it."""
    first = 0
    for span, piece in zip(spans, signals, strict=True):
        yield slice(first, first + span.count), span, piece
        first += span.count


def transitions(field: Field, times: Array, states: Array, length: float) -> Array:
    """Derivatives of B segments' ends by their starts, (B, 2n, 2n).

    Differences of two steps of the classical Runge-Kutta method: over a twentieth of the fastest
    period they are good to 1e-6 of themselves, and a bound needs two digits.
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
        at = times + part * h
        k1 = field(at, y)
        k2 = field(at + h / 2, y + h / 2 * k1)
        k3 = field(at + h / 2, y + h / 2 * k2)
        k4 = field(at + h, y + h * k3)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return y


def rounded_away(
    equations: EquationsOfMotion,
    piece: Piece,
    times: Array,
    nodes: Array,
    length: float,
    *,
    flow: Array,
    rounded: bool,
) -> Array:
    """What rounding of the accelerations makes of the ends of B segments, (B, 2n).

    Args:
        times: at which they start, (B,).
        nodes: states at the Chebyshev nodes, (B, NODES, 2n).
        flow: `transitions` of them.
        rounded: whether doubles evaluate the accelerations' own terms.
    """
    forces = _acceleration_error(equations, piece, times, nodes, length, rounded=rounded)
    return _turned(flow, forces, length)


def _acceleration_error(
    equations: EquationsOfMotion,
    piece: Piece,
    times: Array,
    nodes: Array,
    length: float,
    *,
    rounded: bool,
) -> Array:
    """Bound of the error of the accelerations over B segments, (B, n).

    A time within a segment is t = t_k + c h, and t_k = t_0 + k H: four roundings, of which the two
    sums are half a unit in the last place of t each, and the products no more than that together.
    So t is off by 3 units of roundoff of itself, an input u(t) by its slope times that, besides the
    rounding of its own terms (the phase w t of sin(w t) by one more), and the accelerations by
    what inputs and time, and where doubles evaluate them their own terms, make of it.
    """
    n = nodes.shape[-1] // 2
    at = times[:, None] + length * chebyshev_nodes()[LOOKED_AT]
    late = 3 * UNIT * np.abs(at)
    error = equations.acceleration_error(
        nodes[:, LOOKED_AT],
        piece.numeric(at[..., None]),
        at,
        off=running_error(piece.expressions, {t: (at, late)}),
        late=late,
        rounded=rounded,
    )
    result: Array = np.max(error.reshape(len(times), -1, n), axis=1)
    return result


def _turned(flow: Array, forces: Array, length: float) -> Array:
    """What errors of the accelerations, (B, n), make of the ends of B segments, (B, 2n).

    The integral of |transition from s to the end| [0, error] over the segment, by the trapezoidal
    rule: H for velocities, H^2 / 2 for positions, times what the equations make of it.
    """
    jolt = np.concatenate([np.zeros_like(forces), forces], axis=1)
    carried = np.einsum("bij,bj->bi", np.abs(flow), jolt)
    result: Array = length / 2 * (jolt + carried)
    return result


def _rounded(segments: Segments, times: Array, rates: Array) -> Array:
    """Bound of the error of states that are known with more digits, (K + 1, 2n).

    A state is rounded to doubles, and so is the time at which it is taken.
    """
    states = np.concatenate([segments.start, segments.end[-1:]])
    slopes = np.abs(np.concatenate([rates[:1], rates]))
    slopes[1:-1] = np.maximum(slopes[1:-1], slopes[2:])
    result: Array = 2 * UNIT * np.abs(states) + 3 * UNIT * times[:, None] * slopes
    result[0] = 0.0
    return result


def _chained(
    segments: Segments, times: Array, lengths: Array, flows: Array, rates: Array, bound: Array
) -> Array:
    """Bound of the error of the states along the chain of segments, (K + 1, 2n).

    The motion errs by e_k at the start of segment k. The equations carry it to the segment's end,
    and the next start lies off the end that was found: e_(k+1) = F_k e_k + (start - end), F_k the
    transition. That is known with its sign. The ends are known to their bound b: to first order
    sum_j |F_k ... F_(j+1)| b besides, the products taken before the magnitudes, which alone would
    grow with each turn (the wrapping effect; Nedialkov, Jackson, Corliss 1999, Applied Mathematics
    and Computation 105(1), section 4).
    """
    # The next start's time is a double, and not just where the segment ends.
    late = np.diff(times) - lengths
    starts = np.concatenate([segments.start[1:], segments.end[-1:]])
    size = np.maximum(np.max(np.abs(segments.end), axis=0), 1e-300)
    jumps = (starts - segments.end - late[:, None] * rates) / size
    turns = flows * size / size[:, None]
    spread = _Spread.none(len(size), block=-(-len(jumps) // BLOCKS))
    known = np.zeros_like(size)
    chain = np.zeros((len(times), len(size)))
    with np.errstate(over="ignore", invalid="ignore"):
        for k, (turn, jump) in enumerate(zip(turns, jumps, strict=True), 1):
            known = turn @ known + jump
            spread = spread.carried(turn, bound / size)
            chain[k] = np.abs(known) + spread.size
    return np.where(np.isfinite(chain), chain * size, np.inf)


@dataclass(frozen=True, kw_only=True)
class _Spread:
    """Boxes of what is not known, each with the transition from where it was met to here.

    Attributes:
        past: boxes of whole blocks, (J, 2n), with
        past_turns: their transitions, (J, 2n, 2n); and of the segments since then
        recent: and
        recent_turns: likewise.
        block: segments to a block, which keeps long motions from taking the square of their length.
    """

    past: Array
    past_turns: Array
    recent: Array
    recent_turns: Array
    block: int

    @staticmethod
    def none(size: int, block: int) -> _Spread:
        """Everything is known."""
        boxes, turns = np.zeros((0, size)), np.zeros((0, size, size))
        return _Spread(past=boxes, past_turns=turns, recent=boxes, recent_turns=turns, block=block)

    def carried(self, turn: Array, box: Array) -> _Spread:
        """A segment later, at whose end a box is added."""
        past, past_turns = self.past, turn @ self.past_turns
        recent = np.concatenate([self.recent, box[None]])
        here = np.eye(len(box))[None]
        recent_turns = np.concatenate([turn @ self.recent_turns, here])
        if len(recent) == self.block:
            past = np.concatenate([past, _sum(recent, recent_turns)[None]])
            past_turns = np.concatenate([past_turns, here])
            recent, recent_turns = recent[:0], recent_turns[:0]
        return _Spread(
            past=past,
            past_turns=past_turns,
            recent=recent,
            recent_turns=recent_turns,
            block=self.block,
        )

    @property
    def size(self) -> Array:
        """The box around all of it, (2n,)."""
        return _sum(self.past, self.past_turns) + _sum(self.recent, self.recent_turns)


def _sum(boxes: Array, turns: Array) -> Array:
    total: Array = np.einsum("jcd,jd->c", np.abs(turns), boxes)
    return total
