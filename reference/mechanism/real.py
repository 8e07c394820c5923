"""Checks that numbers and expressions of a declaration are real, finite and supported.

Complex values are rejected everywhere: silently using a real part would change the model.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from numbers import Real

import mpmath as mp
import numpy as np
import sympy as sp

from .declaration import DeclarationError, t
from .numeric import Array, compile_function

FUNCTIONS = (
    sp.exp, sp.log, sp.sin, sp.cos, sp.tan, sp.cot, sp.sec, sp.csc, sp.asin, sp.acos, sp.atan,
    sp.acot, sp.asec, sp.acsc, sp.atan2, sp.sinh, sp.cosh, sp.tanh, sp.coth, sp.asinh, sp.acosh,
    sp.atanh, sp.sinc,
)  # fmt: skip
"""Functions that an expression may contain, besides sums, products and powers."""

SWITCHES = (
    sp.Heaviside, sp.Piecewise, sp.functions.elementary.piecewise.ExprCondPair,
    sp.Abs, sp.sign, sp.Max, sp.Min, sp.floor, sp.ceiling, sp.Mod,
)  # fmt: skip
"""Functions that an input may also contain; `mechanism.signal` finds their break points."""

MAX_DOUBLE = float(np.finfo(float).max)
MAX_CHARACTERS = 60
"""Largest number of characters of an expression in a message."""

SAMPLES = 401
"""Sample times of an input between two breaks."""


def expression_of(value: object, place: str) -> sp.Expr:
    """Return a declared value as an expression.

    Raises:
        DeclarationError: for text, None, a bool, a list or a matrix.
    """
    # sympy would parse text as code, by other rules than Python's.
    if isinstance(value, (bool, str, bytes, type(None))):
        raise DeclarationError(f"{place} is {shown(value)}: write a number or an expression")
    try:
        expression = sp.sympify(value)
    except (sp.SympifyError, TypeError, ValueError, AttributeError, RecursionError):
        expression = None
    if not isinstance(expression, sp.Expr) or getattr(expression, "is_Matrix", False):
        raise DeclarationError(f"{place} is {shown(value)}: write a number or an expression")
    return expression


def check_real(expression: sp.Expr, place: str, also: Sequence[type] = ()) -> None:
    """Reject expressions with I, without a finite value, or with unsupported functions.

    Raises:
        DeclarationError: with the offending part and the remedy.
    """
    if expression.has(sp.I):
        raise DeclarationError(
            f"{place} is complex: {shown(expression)} has I; write it in real functions,"
            " as cos(w*t) for the real part of exp(I*w*t)"
        )
    if expression.has(sp.nan, sp.oo, sp.zoo, -sp.oo):
        raise DeclarationError(f"{place} is {shown(expression)}, which is not a finite number")
    supported = (*FUNCTIONS, *also)
    for part in expression.atoms(sp.Function, sp.Derivative, sp.Integral, sp.Sum, sp.Product):
        if not isinstance(part, supported):
            raise DeclarationError(
                f"{place} has {shown(part)}, which has no value here. Write it with "
                "powers, exponentials, logarithms, trigonometric or hyperbolic "
                "functions. Write jumps of an input with Heaviside or Piecewise"
            )


def number_of(value: object, constants: Mapping[sp.Symbol, sp.Expr], place: str) -> float:
    """Return a declared value as a finite real number, with constants substituted.

    Raises:
        DeclarationError: if it is not a finite real number.
    """
    if isinstance(value, float) and not math.isfinite(value):
        raise DeclarationError(f"{place} is {value}, which is not a finite number")
    expression = expression_of(value, place)
    check_real(expression, place)
    number = expression.xreplace(dict(constants)).evalf(30)
    if number.has(sp.nan, sp.oo, sp.zoo, -sp.oo):
        raise DeclarationError(f"{place} is {shown(expression)}, which is not a finite number")
    if not number.is_real:
        raise DeclarationError(
            f"{place} is {shown(expression)} = {shown(number.evalf(5))}, which is not a real number"
        )
    if abs(number) > MAX_DOUBLE:
        raise DeclarationError(f"{place} is {shown(value)}, which is too large for a double")
    return float(number)


def check_plain(value: object, place: str) -> None:
    """Reject anything but one finite real Python number, as for a constant's value.

    Raises:
        DeclarationError: with the value.
    """
    if isinstance(value, bool) or not isinstance(value, Real) or isinstance(value, sp.Basic):
        raise DeclarationError(f"{place} has no numeric value: it is {shown(value)}; write a float")
    try:
        finite = math.isfinite(value)
    except OverflowError:
        raise DeclarationError(f"{place} is too large for a double") from None
    if not finite:
        raise DeclarationError(f"{place} is {value}, which is not a finite number")


def check_over_time(
    expression: sp.Expr, values: Callable[[Array], Array], start: float, stop: float, place: str
) -> None:
    """Reject an input that is complex or not finite at a time from start to stop.

    The check evaluates many times. Between them it searches for zeros below roots, in logarithms
    and in denominators.

    Args:
        values: the expression at given times, in doubles.

    Raises:
        DeclarationError: with the time.
    """
    times = np.linspace(start, stop, SAMPLES)
    # At the end itself another branch may apply.
    times[-1] = np.nextafter(stop, start)
    with np.errstate(all="ignore"):
        results = values(times)
    bad = ~np.isfinite(results)
    if bad.any():
        time = float(times[np.argmax(bad)])
        raise DeclarationError(f"{place} {_describe_value(expression, time)}")
    for base in _critical(expression):
        zero = _zero(base, times)
        if zero is not None:
            raise DeclarationError(
                f"{place}: {shown(expression)} is complex, infinite or not smooth where"
                f" {shown(base)} is zero, near t = {zero:.6g} s; an input must be real and finite"
                " throughout"
            )


def _critical(expression: sp.Expr) -> set[sp.Expr]:
    """Return expressions that must not vanish: denominators, radicands, arguments of logarithms."""
    bases = set()
    for part in expression.atoms(sp.Pow, sp.log, sp.tan, sp.sec, sp.cot, sp.csc):
        if isinstance(part, sp.Pow):
            whole = part.exp.is_Integer and part.exp >= 0
            if not whole and part.base.has(t):
                bases.add(part.base)
        elif part.has(t):
            angle = part.args[0]
            wave = {sp.log: angle, sp.tan: sp.cos(angle), sp.sec: sp.cos(angle)}
            bases.add(wave.get(part.func, sp.sin(angle)))
    return bases


def _zero(base: sp.Expr, times: Array) -> float | None:
    """Return a zero strictly between the first and the last time; None otherwise.

    A polynomial's real roots are isolated (Sturm). Otherwise sign changes are searched, with a
    finer search around each minimum of the magnitude.
    """
    start, stop = float(times[0]), float(times[-1])
    polynomial = sp.Poly(base, t) if base.is_polynomial(t) else None
    if polynomial is not None and polynomial.domain in (sp.ZZ, sp.QQ):
        inside = [float(root) for root in polynomial.real_roots() if start < root < stop]
        return inside[0] if inside else None
    compiled = compile_function([sp.N(base, 17)], (t,))
    with np.errstate(all="ignore"):
        size = np.abs(compiled(times[:, None])[:, 0])
        small = np.flatnonzero((size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:])) + 1
        closer = np.linspace(times[small - 1], times[small + 1], SAMPLES).T.ravel()
        every = np.sort(np.concatenate([times, closer]))
        signs = np.sign(compiled(every[:, None])[:, 0])
    changed = np.flatnonzero((signs[1:] != signs[:-1]) & (signs[:-1] != 0))
    # A zero at the first or the last time is allowed.
    return float(every[changed[0]]) if changed.size and every[changed[0] + 1] < stop else None


def _describe_value(expression: sp.Expr, time: float) -> str:
    """Describe the value of an expression at a time where it is not finite and real."""
    with mp.workdps(20):
        try:
            value = sp.N(expression.xreplace({t: sp.Float(time, 20)}), 5)
        except (TypeError, ValueError, ZeroDivisionError, OverflowError):
            value = sp.nan
    kind = "complex" if value.is_real is False and value.is_finite else "not a finite number"
    return (
        f"is {kind} at t = {time:.6g} s: {shown(expression)} is {shown(value)} there;"
        " an input must be real and finite throughout"
    )


def shown(value: object) -> str:
    """Return a value for a message, on one line and shortened."""
    try:
        text = " ".join((str(value) if isinstance(value, sp.Basic) else repr(value)).split())
    except ValueError:  # an integer with too many digits to print
        return "a number of thousands of digits"
    return text if len(text) <= MAX_CHARACTERS else f"{text[:MAX_CHARACTERS]}..."
