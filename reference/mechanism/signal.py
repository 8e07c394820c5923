"""Inputs over time: smooth pieces between breaks, each with the linear equation that generates it.

A step, ramp, exponential, harmonic, or a sum or product of these solves a linear equation with
constant coefficients: u is the first component of w' = S w. Appending w to the state (augmentation;
Van Loan 1978, IEEE TAC 23(3), 395-404) makes a forced linear system autonomous.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import mpmath as mp
import numpy as np
import sympy as sp
from sympy.core.relational import Relational

from .declaration import Declaration, DeclarationError, Scenario, t
from .numeric import Array, NumericFunction, Rows, compile_function
from .real import check_over_time

DIGITS = 40
"""Digits of the closed form: the 16 of a double and 24 in reserve."""


@dataclass(frozen=True)
class Generator:
    """A linear equation w' = S w whose first component is the signal.

    Attributes:
        coefficients: c_0 ... c_(d-1) of the characteristic polynomial s^d + c_(d-1) s^(d-1) + ... +
            c_0, to `DIGITS` digits.
        expression: the signal, whose derivatives are the state w = (u, u', ...).
    """

    coefficients: tuple[mp.mpf, ...]
    expression: sp.Expr

    @cached_property
    def matrix(self) -> mp.matrix:
        """Companion matrix S, d x d."""
        order = len(self.coefficients)
        matrix = mp.zeros(order)
        for i in range(order - 1):
            matrix[i, i + 1] = mp.mpf(1)
        for j, coefficient in enumerate(self.coefficients):
            matrix[order - 1, j] = -coefficient
        return matrix

    def state(self, time: float) -> list[mp.mpf]:
        """Return w = (u, u', ..., u^(d-1)) at a time, at the working precision."""
        derivatives = [sp.diff(self.expression, t, i) for i in range(len(self.coefficients))]
        evaluate = sp.lambdify(t, derivatives, modules="mpmath")
        return [mp.mpf(value) for value in evaluate(mp.mpf(time))]


@dataclass(frozen=True, kw_only=True)
class SignalPiece:
    """The inputs between two breaks, where all are smooth."""

    start: float
    stop: float
    expressions: tuple[sp.Expr, ...]

    @cached_property
    def generators(self) -> tuple[Generator, ...] | None:
        """One generator per input; None if an input, such as a chirp, has none."""
        generators = [generator(expression) for expression in self.expressions]
        return None if None in generators else tuple(g for g in generators if g is not None)

    @cached_property
    def constant(self) -> bool:
        """True if all inputs are constant over the piece."""
        return all(t not in expression.free_symbols for expression in self.expressions)

    @cached_property
    def numeric(self) -> NumericFunction:
        """u(t): argument group (t,)."""
        return compile_function([sp.N(e, 17) for e in self.expressions], (t,))


def pieces(system: Declaration, scenario: Scenario) -> tuple[SignalPiece, ...]:
    """Split a scenario's inputs at their breaks.

    Raises:
        DeclarationError: if a break time can't be determined, or an input is not smooth between
            breaks.
    """
    values = system.values
    inputs = [_exact(sp.sympify(scenario.inputs[i]).xreplace(values)) for i in system.inputs]
    breaks = {0.0, float(scenario.duration)}
    place = f"system {system.name!r}, scenario {scenario.name!r}"
    for declared, expression in zip(system.inputs, inputs, strict=True):
        break_times = _breaks(expression, f"{place}, input {declared.name}")
        breaks |= {b for b in break_times if 0 < b < scenario.duration}
    times = sorted(breaks)
    result = []
    for start, stop in pairwise(times):
        middle = sp.Rational((start + stop) / 2)
        smooth = tuple(_resolve(expression, middle) for expression in inputs)
        for declared, expression in zip(system.inputs, smooth, strict=True):
            if expression.atoms(sp.Abs, sp.sign, sp.Max, sp.Min, sp.floor, sp.ceiling, sp.Mod):
                raise DeclarationError(
                    f"{place}: the input {declared.name} is not smooth: {expression};"
                    " use Heaviside or Piecewise"
                )
        signal = SignalPiece(start=start, stop=stop, expressions=smooth)
        _check_values(signal, [i.name for i in system.inputs], place)
        result.append(signal)
    return tuple(result)


def _check_values(signal: SignalPiece, names: Sequence[str], place: str) -> None:
    for i, (name, expression) in enumerate(zip(names, signal.expressions, strict=True)):

        def values(times: Array, i: int = i) -> Array:
            result: Array = signal.numeric(times[:, None])[:, i]
            return result

        check_over_time(expression, values, signal.start, signal.stop, f"{place}: the input {name}")


def _exact(expression: sp.Expr) -> sp.Expr:
    """Replace floats by their exact rationals, so that 8.6 means one number everywhere."""
    return expression.xreplace({f: sp.Rational(float(f)) for f in expression.atoms(sp.Float)})


def _breaks(expression: sp.Expr, place: str) -> set[float]:
    switches = [h.args[0] for h in expression.atoms(sp.Heaviside)]
    switches += [r.lhs - r.rhs for r in expression.atoms(Relational)]
    times = set()
    for switch in switches:
        polynomial = sp.Poly(switch, t) if switch.is_polynomial(t) else None
        if polynomial is None or polynomial.degree() != 1:
            raise DeclarationError(f"{place}: the switch at {switch} = 0 must be linear in t")
        slope, offset = polynomial.all_coeffs()
        times.add(float(-offset / slope))
    return times


def _resolve(expression: sp.Expr, middle: sp.Rational) -> sp.Expr:
    """Return the branch that applies around `middle`."""
    switches = {
        h: sp.Integer(int(bool(h.args[0].subs(t, middle) > 0)))
        for h in expression.atoms(sp.Heaviside)
    }
    resolved = expression.xreplace(switches)
    conditions = {
        r: sp.true if r.subs(t, middle) == sp.true else sp.false for r in resolved.atoms(Relational)
    }
    return sp.sympify(resolved.xreplace(conditions))


def generator(expression: sp.Expr) -> Generator | None:
    """Return the generator of a sum of c t^p exp(a t), a complex; None otherwise."""
    if t not in expression.free_symbols:
        return Generator((mp.mpf(0),), expression)
    rates: dict[sp.Expr, int] = {}
    for term in sp.Add.make_args(sp.expand(expression.rewrite(sp.exp), power_exp=False)):
        parsed = _rate_and_power(term)
        if parsed is None:
            return None
        rate, power = parsed
        rates[rate] = max(power, rates.get(rate, 0))
    s = sp.Symbol("s")
    polynomial = sp.Poly(
        sp.expand(sp.Mul(*((s - rate) ** (power + 1) for rate, power in rates.items()))), s
    )
    # Use a fixed precision: a piece caches its generators for all later callers.
    with mp.workdps(DIGITS):
        coefficients = [mp.mpf(sp.re(sp.N(c, DIGITS + 5))) for c in polynomial.all_coeffs()]
    return Generator(tuple(reversed(coefficients[1:])), expression)


def _rate_and_power(term: sp.Expr) -> tuple[sp.Expr, int] | None:
    rate, power = sp.Integer(0), 0
    _, varying = term.as_independent(t, as_Add=False)
    for factor in sp.Mul.make_args(varying):
        if factor == 1:
            continue
        base, exponent = factor.as_base_exp()
        if base == t and exponent.is_Integer and exponent > 0:
            power += int(exponent)
        elif isinstance(factor, sp.exp):
            slope = sp.diff(factor.args[0], t)
            if t in slope.free_symbols:
                return None
            rate += slope
        else:
            return None
    return sp.expand(rate), power


@dataclass(frozen=True)
class Inputs:
    """The inputs of a motion as numbers: picklable, without sympy."""

    starts: tuple[float, ...]
    functions: tuple[NumericFunction, ...]

    def __call__(self, times: Array, slack: float = 0.0) -> Array:
        """Return u at given times, (len(times), inputs); at a break, the right-hand value.

        A time within `slack` seconds before a break counts as the break, to absorb rounding.
        """
        which = np.clip(np.searchsorted(self.starts, times + slack, side="right") - 1, 0, None)
        values = np.zeros((len(times), self.functions[0].size))
        for index, function in enumerate(self.functions):
            chosen = which == index
            if chosen.any():
                values[chosen] = function(times[chosen, None])
        return values

    def over_steps(self, rows: Rows, t: Array, lengths: Array, steps: int) -> Array:
        """Return u at the starts of equal steps of B segments from times t, (B, steps, inputs)."""
        h = lengths[:, None] / steps
        times = t[:, None] + h * np.arange(steps)
        return self(times.ravel(), slack=float(np.min(h)) / 4).reshape(len(t), steps, -1)

    def within(self, rows: Rows, t: Array, lengths: Array, times: Array) -> Array:
        """Return u at times (B, S) within B segments, (B, S, inputs)."""
        return self(times.ravel()).reshape(*times.shape, -1)

    def pick(self, rows: Rows) -> Inputs:
        """Return the same function of time, for chosen segments."""
        return self


def numeric_inputs(signals: Sequence[SignalPiece]) -> Inputs:
    """Return the inputs of all pieces as one numeric function of time."""
    return Inputs(tuple(p.start for p in signals), tuple(p.numeric for p in signals))
