"""Numerical solution of nonlinear systems, segment by segment, by two independent methods.

Gauss collocation (`solving.collocation`) integrates all segments at once. scipy's DOP853 checks it,
or heyoka's Taylor series if heyoka is installed.
"""

import importlib.util
from collections.abc import Callable, Sequence

import numpy as np
import sympy as sp

from physics_crosscheck.reference.dynamics.derive import Equations
from physics_crosscheck.reference.dynamics.equations import EquationsOfMotion
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.signal import SignalPiece, numeric_inputs
from .collocation import STAGES, Field, collocate, once_per_times
from .collocation import ReferenceError as ReferenceError
from .segments import Motion, Span, start_times

AGREEMENT = 1e-12
"""Largest difference of the two integrations over a segment, relative to the motion's size."""

MOST_OPERATIONS = 2500
"""Operations in the equations above which heyoka's compilation takes minutes."""


def field_of(equations: EquationsOfMotion, signal: SignalPiece) -> Field:
    """Return dy/dt under the inputs of one piece, vectorized."""
    acceleration = equations.numeric_acceleration
    n = len(equations.system.coordinates)
    inputs = once_per_times(lambda times: signal.numeric(times.reshape(-1, 1)))

    def field(times: Array, states: Array) -> Array:
        u = inputs(times).reshape(*times.shape, -1)
        out = np.empty_like(states)
        out[..., :n] = states[..., n:]
        out[..., n:] = acceleration(states[..., :n], states[..., n:], u, times[..., None])
        return out

    return field


def trajectory(
    equations: EquationsOfMotion,
    start: Array,
    signals: Sequence[SignalPiece],
    times: Array,
    rtol: float = 1e-13,
) -> Array:
    """Return states at ascending times, (len(times), 2n), by DOP853 between input breaks."""
    from scipy.integrate import solve_ivp  # slow import, not needed by every command

    acceleration = equations.numeric_acceleration.scalar
    n = len(equations.system.coordinates)
    values = np.empty((len(times), 2 * n))
    state = np.asarray(start, dtype=float)
    for signal in signals:
        drive = signal.numeric.scalar

        def rate(time: float, y: Array, drive: Callable[..., Sequence[float]] = drive) -> Array:
            return np.array([*y[n:], *acceleration(*y, *drive(time), time)])

        last = signal is signals[-1]
        chosen = (times >= signal.start) & (
            (times <= signal.stop) if last else (times < signal.stop)
        )
        solved = solve_ivp(
            rate,
            (signal.start, signal.stop),
            state,
            method="DOP853",
            rtol=rtol,
            atol=rtol * 1e-2,
            t_eval=np.append(times[chosen], [] if last and signal.stop in times else signal.stop),
        )
        if not solved.success or not np.isfinite(solved.y).all():
            raise ReferenceError(
                f"the equations cannot be integrated past {solved.t[-1]:g} s: the "
                "motion blows up, a force is complex or the mass matrix is "
                "singular there; shorten the motion, or correct T, V, D or the "
                "start"
            )
        values[chosen] = solved.y.T[: chosen.sum()]
        state = solved.y[:, -1]
    return values


def solve_numerically(
    equations: EquationsOfMotion,
    start: Array,
    signals: Sequence[SignalPiece],
    spans: tuple[Span, ...],
    onto: Callable[[Array, Array], Array] | None = None,
) -> Motion:
    """Solve all segments of a nonlinear system.

    Args:
        onto: projects states (K, 2n) at times (K,) onto constraints that the equations keep.

    Raises:
        ReferenceError: if the two integrations differ by more than `AGREEMENT` over a segment.
    """
    times = start_times(spans)
    starts = trajectory(equations, start, signals, times)
    if onto is not None:
        starts = onto(times, starts)
    starts[0] = start
    ends, nodes, checks = [], [], []
    by_series = isinstance(equations, Equations) and _size(equations) <= MOST_OPERATIONS
    by_series = by_series and heyoka_installed()
    first = 0
    for span, signal in zip(spans, signals, strict=True):
        chosen = slice(first, first + span.count)
        first += span.count
        field = field_of(equations, signal)
        end, inner = collocate(field, times[chosen], starts[chosen], span.length)
        ends.append(end)
        nodes.append(inner)
        given = signal, times[chosen], starts[chosen], span.length
        if isinstance(equations, Equations) and by_series:
            checks.append(_taylor_series(equations, *given))
        else:
            checks.append(by_runge_kutta(field, *given[1:]))
    end = np.concatenate(ends)
    bound = checked_bound(end, np.concatenate(checks))
    other = "heyoka's Taylor series" if by_series else "DOP853"
    return Motion.join(
        spans,
        numeric_inputs(signals),
        start=starts,
        end=end,
        nodes=np.concatenate(nodes),
        bound=bound,
        method=f"Gauss collocation of order {2 * STAGES}, checked by {other}",
    )


def checked_bound(end: Array, checked: Array) -> Array:
    """Return an error bound, (2n,), of ends (K, 2n), from a second integration of them.

    Raises:
        ReferenceError: if the two differ by more than `AGREEMENT`.
    """
    apart = np.max(np.abs(end - checked), axis=0)
    size = np.max(np.abs(end), axis=0)
    n = len(size) // 2
    sizes = np.concatenate([np.full(n, size[:n].max()), np.full(n, size[n:].max())])
    allowed = AGREEMENT * np.maximum(sizes, 1e-300)
    if not np.all(apart <= allowed):  # so that nan is rejected as well
        worst = int(np.argmax(apart / allowed))
        raise ReferenceError(
            f"two integrations of component {worst} are {apart[worst]:.1e} apart over a segment"
        )
    bound: Array = apart + 2 * np.finfo(float).eps * size
    return bound


def by_runge_kutta(
    field: Field, times: Array, states: Array, length: float, *, rounded: bool = False
) -> Array:
    """Integrate all segments as one system, by DOP853 with at least four steps.

    Args:
        field: dy/dt.
        times, states: start times and states, (B,) and (B, 2n).
        length: seconds per segment.
        rounded: whether rates have more rounding than their last digits. Then the tolerance is
            `AGREEMENT` of the largest component of the same kind; a smaller one would shrink the
            steps without end.
    """
    from scipy.integrate import solve_ivp  # slow import, not needed by every command

    shape, half = states.shape, states.shape[-1] // 2
    rtol, atol = 3e-14, np.full(states.size, 1e-16)
    if rounded:
        sizes = [np.max(np.abs(part), initial=0.0) for part in np.split(states, 2, axis=1)]
        rtol = AGREEMENT
        atol = np.maximum(atol, rtol * np.tile(np.repeat(sizes, half), len(states)))

    def rate(elapsed: float, flat: Array) -> Array:
        return field(times + elapsed, flat.reshape(shape)).ravel()

    solved = solve_ivp(
        rate,
        (0.0, length),
        states.ravel(),
        method="DOP853",
        rtol=rtol,
        atol=atol,
        first_step=length / 4,
        max_step=length / 4,
    )
    if not solved.success:
        raise ReferenceError(f"DOP853 stops within a segment: {solved.message}")
    end: Array = solved.y[:, -1].reshape(shape)
    return end


def _size(equations: Equations) -> int:
    return sum(sp.count_ops(e) for e in (*equations.mass, *equations.force))


def heyoka_installed() -> bool:
    """Return whether the extra `heyoka` is installed."""
    return importlib.util.find_spec("heyoka") is not None


def _taylor_series(
    equations: Equations, signal: SignalPiece, times: Array, states: Array, length: float
) -> Array:
    """Integrate each segment by heyoka's adaptive Taylor series, in double precision."""
    import heyoka as hy

    from physics_crosscheck.reference.mechanism.declaration import t

    system = equations.system
    inputs = dict(zip(system.u, signal.expressions, strict=True))
    # from_sympy rejects rationals, so every number becomes a float. evalf alone would leave those
    # within a function's argument, such as sin((4 + t/3)*t).
    right = [
        sp.sympify(e)
        .xreplace(system.values)
        .xreplace(inputs)
        .evalf(17)
        .replace(
            lambda part: part.is_number and part.is_real and not part.is_Integer,
            lambda part: sp.Float(part, 17),
        )
        for e in equations.first_order
    ]
    names = {t: hy.time}
    converted = [
        hy.from_sympy(e, names) if e.free_symbols else hy.expression(float(e)) for e in right
    ]
    variables = hy.make_vars(*(str(x) for x in (*system.q, *system.v)))
    variables = [variables] if isinstance(variables, hy.expression) else list(variables)
    integrator = hy.taylor_adaptive(
        list(zip(variables, converted, strict=True)), states[0].tolist()
    )
    ends = np.empty_like(states)
    for i, (time, state) in enumerate(zip(times, states, strict=True)):
        integrator.time = time
        integrator.state[:] = state
        # `propagate_for` keeps time in two doubles; time + length would be rounded.
        outcome = integrator.propagate_for(length)[0]
        if outcome != hy.taylor_outcome.time_limit:
            raise ReferenceError(f"heyoka stops within the segment from {time:g} s: {outcome}")
        ends[i] = integrator.state
    return ends
