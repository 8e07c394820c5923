"""Solve a scenario: choose the segments, then use the closed form or two integrations.

If a linear equation generates the inputs, the generator's state is appended to the system's (Van
Loan 1978). A segment is then one product with exp(A H).
"""

from collections.abc import Sequence
from dataclasses import replace

import mpmath as mp
import numpy as np
import sympy as sp
from mpmath.libmp import to_fixed
from numpy.typing import NDArray

from physics_crosscheck.reference.dynamics.derive import Equations
from physics_crosscheck.reference.dynamics.equations import EquationsOfMotion
from physics_crosscheck.reference.dynamics.linearize import TaylorLinearization, linearize
from physics_crosscheck.reference.mechanism.declaration import (
    Declaration,
    DeclarationError,
    Equilibrium,
    Scenario,
    about,
)
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.signal import (
    DIGITS,
    Generator,
    SignalPiece,
    numeric_inputs,
)
from .bounds import each, transitions, with_bounds
from .collocation import CONVERGED, ReferenceError, collocate
from .integrate import by_runge_kutta, checked_bound, field_of, solve_numerically, trajectory
from .segments import Motion, Span, chebyshev_nodes, start_times


def augmented(linearization: TaylorLinearization, generators: Sequence[Generator]) -> mp.matrix:
    """Return [[A, B e], [0, S]]: the system with the generators of its inputs appended."""
    a, b = linearization.exact["A"], linearization.exact["B"]
    size = a.rows + sum(g.matrix.rows for g in generators)
    matrix = mp.zeros(size)
    for i in range(a.rows):
        for j in range(a.cols):
            matrix[i, j] = a[i, j]
    place = a.rows
    for column, generator in enumerate(generators):
        for i in range(a.rows):
            matrix[i, place] = b[i, column]
        block = generator.matrix
        for i in range(block.rows):
            for j in range(block.cols):
                matrix[place + i, place + j] = block[i, j]
        place += block.rows
    return matrix


def solve_closed_form(
    linearization: TaylorLinearization,
    start: Array,
    signals: Sequence[SignalPiece],
    spans: tuple[Span, ...],
) -> Motion:
    """Solve all segments of a linear system.

    Each span is stepped with `DIGITS` digits from its first state. A segment starts from that state
    rounded to doubles; the rounding is propagated to the segment's end through exp(A H).
    """
    size = len(start)
    origin = np.concatenate([linearization.position, np.zeros(size // 2)])
    starts, ends, nodes = [], [], []
    with mp.workdps(DIGITS):
        state = [mp.mpf(y) - mp.mpf(o) for y, o in zip(start, origin, strict=True)]
        for span, signal in zip(spans, signals, strict=True):
            generators = signal.generators
            assert generators is not None  # checked by the caller
            matrix = augmented(linearization, generators)
            full = list(state)
            for generator in generators:
                full += generator.state(span.start)
            shares = (*map(mp.mpf, chebyshev_nodes()), mp.mpf(1))
            *inner, rows = exponentials(matrix * mp.mpf(span.length), shares)
            exact = [full]
            for _ in range(span.count):
                exact.append([mp.fdot(row, exact[-1]) for row in rows])
            rounded = np.array([[float(y) for y in s] for s in exact])
            lost = np.array([[float(y - mp.mpf(float(y))) for y in s[:size]] for s in exact])
            forward = np.array([[float(v) for v in row[:size]] for row in rows[:size]])
            starts.append(rounded[:-1, :size])
            # A segment starts `lost` below the exact state, so it also ends below it.
            ends.append(rounded[1:, :size] + (lost[1:] - lost[:-1] @ forward.T))
            within = [rounded[:-1] @ np.array(step, dtype=np.float64).T for step in inner]
            nodes.append(np.stack(within, axis=1)[:, :, :size])
            nodes[-1][:, -1] = rounded[1:, :size]
            state = exact[-1][:size]
    end = np.concatenate(ends)
    return Motion.join(
        spans,
        numeric_inputs(signals),
        start=np.concatenate(starts) + origin,
        end=end + origin,
        nodes=np.concatenate(nodes) + origin,
        bound=np.finfo(float).eps * np.max(np.abs(end + origin), axis=0),
        method=f"matrix exponential of the linear equations, {DIGITS} digits",
    )


Integers = NDArray[np.object_]
"""Fixed-point numbers."""

FIXED_BITS = 320
"""Bits behind the point: 40 digits of entries that are 1e-50 of the largest."""

FIXED_ROUNDING = 256
"""Last digits that a term may lose; integers round down, so that -1 never vanishes."""


def exponentials(matrix: mp.matrix, shares: Sequence[mp.mpf]) -> list[list[list[mp.mpf]]]:
    """Return the rows of exp(share * matrix) for shares of at most 1, by one Taylor series.

    The matrix is halved until its norm is below 1, and each sum is squared as often. Fixed-point
    integers are ten times as fast as the library's numbers.
    """
    halvings = max(0, int(mp.ceil(mp.log(mp.mnorm(matrix, 1) + 1, 2))))
    entries = [to_fixed(x._mpf_, FIXED_BITS - halvings) for x in matrix]
    reduced = np.array(entries, dtype=object).reshape(matrix.rows, matrix.cols)
    powers: list[Integers] = [np.diag([1 << FIXED_BITS] * matrix.rows).astype(object)]
    while np.abs(powers[-1]).max() > FIXED_ROUNDING:
        powers.append((powers[-1] @ reduced >> FIXED_BITS) // len(powers))
    return [_exponential(powers, to_fixed(share._mpf_, FIXED_BITS), halvings) for share in shares]


def _exponential(powers: Sequence[Integers], share: int, halvings: int) -> list[list[mp.mpf]]:
    """Sum a Taylor series by Horner's rule, and square the sum."""
    total = powers[-1]
    for power in reversed(powers[:-1]):
        total = (total * share >> FIXED_BITS) + power
    for _ in range(halvings):
        total = total @ total >> FIXED_BITS
    return [[mp.ldexp(mp.mpf(x), -FIXED_BITS) for x in row] for row in total.tolist()]


def state_at(
    linearization: TaylorLinearization, start: Sequence[float], signal: SignalPiece, time: float
) -> list[mp.mpf]:
    """Return the state after `time` seconds under the inputs of one piece, with `DIGITS` digits.

    Raises:
        ValueError: if an input has no generator.
    """
    if signal.generators is None:
        raise ValueError("no linear equation generates an input of this piece")
    with mp.workdps(DIGITS):
        offsets = [*linearization.position, *np.zeros(len(linearization.position))]
        full = [mp.mpf(y) - mp.mpf(o) for y, o in zip(start, offsets, strict=True)]
        for generator in signal.generators:
            full += generator.state(signal.start)
        final = mp.expm(augmented(linearization, signal.generators) * mp.mpf(time)) * mp.matrix(
            full
        )
        return [final[i] + mp.mpf(o) for i, o in enumerate(offsets)]


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


SEGMENTS_A_PERIOD = 20
SEGMENTS_AT_LEAST = 200
MOST_SEGMENTS = 1_000_000
"""A motion with more segments would take hours."""

LEAST_TURN = 1e-6
"""A motion of fewer radians is lost in the rounding of its states."""

__all__ = ["ReferenceError", "solve", "start_of"]


def solve(equations: EquationsOfMotion, scenario: Scenario, *, bound_along: bool = True) -> Motion:
    """Return the reference motion of a scenario, in segments.

    Linear equations under inputs with a generator have a closed form; all others are integrated
    twice.

    Args:
        equations: derived ones, a recursion, or those of a family.
        scenario: of the system.
        bound_along: whether to bound the error along the motion, which needs each segment in turn.

    Raises:
        DeclarationError: for an input that is not smooth between identifiable breaks, or an
            impossible motion: a singular mass matrix, a zero or an excessive duration.
        ReferenceError: if the equations can't be solved to the needed accuracy.
    """
    with about("Scenario", scenario.name):
        place = f"system {equations.system.name!r}, scenario {scenario.name!r}"
        try:
            motion = _solved(equations, scenario, place, bound_along=bound_along)
        except ReferenceError as error:
            raise ReferenceError(f"{place}: {error}") from error
        check_motion(equations, motion, place)
        return motion


def start_of(system: Declaration, scenario: Scenario) -> Array:
    """Return the state at the start of a scenario, (2n,)."""
    return np.array(
        [
            float(sp.sympify(given[c]).subs(system.values))
            for given in (scenario.q, scenario.v)
            for c in system.coordinates
        ]
    )


def _solved(
    equations: EquationsOfMotion, scenario: Scenario, place: str, *, bound_along: bool
) -> Motion:
    system = equations.system
    signals, derived = equations.signals(scenario), isinstance(equations, Equations)
    start = start_of(system, scenario)
    duration = float(scenario.duration)
    fastest = fastest_rate(equations, signals, np.zeros(1), start[None])
    check_duration(fastest, duration, place)
    times = np.linspace(0.0, duration, ROUGH_SAMPLES)
    states = start[None]
    if not (derived and equations.linear):
        states = trajectory(equations, start, signals, times, rtol=ROUGH_ACCURACY)
    if not equations.linear:
        fastest = fastest_rate(equations, signals, times, states)
        check_duration(fastest, duration, place)
    spans = tile(signals, fastest)
    flow = None
    exact = (
        derived and equations.linear and all(signal.generators is not None for signal in signals)
    )
    if exact and isinstance(equations, Equations):
        at_zero = Equilibrium("zero", dict.fromkeys(system.coordinates, 0), False, "the origin")
        motion = solve_closed_form(linearize(equations, at_zero), start, signals, spans)
    elif isinstance(equations, Equations):
        motion = solve_numerically(equations, start, signals, spans)
    else:  # a recursion costs as much for one state as for many; so does a call at other constants
        motion, flow = shoot(equations, signals, spans, times, states)
    motion = with_bounds(equations, signals, motion, exact=exact, flow=flow, along=bound_along)
    return replace(motion, fastest=fastest)


def check_duration(fastest: float, duration: float, place: str) -> None:
    """Reject a motion in which nothing moves, or that needs too many segments.

    Raises:
        DeclarationError: with the duration, and the rate of the motion.
    """
    if not np.isfinite(fastest):
        raise DeclarationError(
            f"{place}: the accelerations, or their slopes, are not finite; correct "
            "T, V, D or the start"
        )
    turns = fastest * duration
    if 0 < turns < LEAST_TURN:
        raise DeclarationError(
            f"{place}: nothing moves within the duration of {duration:g} s: the "
            f"fastest motion has {fastest:.3g} rad/s; make it longer"
        )
    if turns * SEGMENTS_A_PERIOD / (2 * np.pi) > MOST_SEGMENTS:
        raise DeclarationError(
            f"{place}: the duration of {duration:g} s holds "
            f"{turns / (2 * np.pi):.1e} periods of the fastest motion, of "
            f"{fastest:.3g} rad/s; make it shorter, or stiff parts softer"
        )


def check_motion(equations: EquationsOfMotion, motion: Motion, place: str) -> None:
    """Reject a motion along which the mass matrix is not positive definite or an energy not real.

    Raises:
        DeclarationError: with the time.
    """
    n = len(equations.system.q)
    u = motion.inputs(motion.t)
    arguments = motion.start[:, :n], motion.start[:, n:], u, motion.t[:, None]
    with np.errstate(all="ignore"):
        mass = equations.numeric_mass(*arguments).reshape(-1, n, n)
        energies = equations.numeric_power(*arguments)
    finite = np.isfinite(np.concatenate([mass.reshape(-1, n * n), energies], axis=1)).all(axis=1)
    if not finite.all():
        time = float(motion.t[np.argmin(finite)])
        raise DeclarationError(
            f"{place}: T, V or D is not a finite real number at t = {time:.4g} s of "
            "the motion; correct it, or choose another start"
        )
    # Scale by the diagonal, since a light part beside a heavy one is not singular.
    size = np.sqrt(np.maximum(np.einsum("kii->ki", mass), 1e-300))
    least = np.linalg.eigvalsh(mass / size[:, :, None] / size[:, None, :])[:, 0]
    if np.min(least) <= 0:
        time = float(motion.t[np.argmax(least <= 0)])
        raise DeclarationError(
            f"{place}: the mass matrix is not positive definite at t = {time:.4g} s "
            "of the motion; correct T, or choose another start"
        )


def tile(signals: Sequence[SignalPiece], fastest: float) -> tuple[Span, ...]:
    """Divide each piece into a prime number of equal segments.

    A prime number keeps the segments from being a simple fraction of a period that divides the
    piece, where non-smooth motion could hide between them.
    """
    whole = signals[-1].stop - signals[0].start
    wanted = max(SEGMENTS_A_PERIOD * fastest / (2 * np.pi), SEGMENTS_AT_LEAST / whole)
    spans = []
    for signal in signals:
        duration = signal.stop - signal.start
        count = sp.nextprime(max(int(np.ceil(wanted * duration)) - 1, 1))
        spans.append(
            Span(
                start=signal.start,
                length=duration / int(count),
                count=int(count),
                constant_input=signal.constant,
            )
        )
    return tuple(spans)


def fastest_rate(
    equations: EquationsOfMotion, signals: Sequence[SignalPiece], times: Array, states: Array
) -> float:
    """Return the largest |eigenvalue| of the equations' Jacobian at states of a motion, rad/s.

    Rates of rotation (coordinates in rad) and of the inputs are included, since they too limit how
    fast terms of the equations change.
    """
    system = equations.system
    n = len(system.coordinates)
    inputs = numeric_inputs(signals)
    with np.errstate(all="ignore"):
        lower = equations.slopes(states, inputs(times), times)
    if not np.isfinite(lower).all():
        return float("inf")
    full = np.zeros((len(times), 2 * n, 2 * n))
    full[:, range(n), range(n, 2 * n)] = 1.0
    full[:, n:] = lower
    rates = [float(np.max(np.abs(np.linalg.eigvals(full))))]
    if len(times) > 1:
        rates += [
            float(np.max(np.abs(states[:, n + i])))
            for i, c in enumerate(system.coordinates)
            if c.unit == "rad"
        ]
    grid = np.linspace(0.0, signals[-1].stop, 2001)
    u = inputs(grid)
    for signal in signals:
        inside = (grid >= signal.start) & (grid < signal.stop)
        values = u[inside]
        if len(values) > 2 and not signal.constant:
            deviation = np.max(np.abs(values - values.mean(axis=0)), axis=0)
            slope = np.max(np.abs(np.diff(values, axis=0)), axis=0) / (grid[1] - grid[0])
            rates += [
                float(s / r)
                for s, r in zip(slope, deviation, strict=True)
                if r > 1e-12 * np.max(np.abs(u))
            ]
    return max(rates)
