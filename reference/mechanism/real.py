"""Numbers and expressions as a declaration may have them: real, finite, of functions known here.

What is complex is refused wherever it turns up: a real part that is taken in silence would be
another model.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from numbers import Real

import mpmath as mp
import numpy as np
import sympy as sp

from physics_crosscheck.reference.mechanism.declaration import DeclarationError, t
from physics_crosscheck.reference.mechanism.numeric import Array, compile_function

FUNCTIONS = (
    sp.exp, sp.log, sp.sin, sp.cos, sp.tan, sp.cot, sp.sec, sp.csc, sp.asin, sp.acos, sp.atan,
    sp.acot, sp.asec, sp.acsc, sp.atan2, sp.sinh, sp.cosh, sp.tanh, sp.coth, sp.asinh, sp.acosh,
    sp.atanh, sp.sinc,
)  # fmt: skip
"""What an expression may be made of, beside sums, products and powers."""

SWITCHES = (
    sp.Heaviside, sp.Piecewise, sp.functions.elementary.piecewise.ExprCondPair,
    sp.Abs, sp.sign, sp.Max, sp.Min, sp.floor, sp.ceiling, sp.Mod,
)  # fmt: skip
"""What else stands in an input; where it is not smooth is told elsewhere."""

LARGEST = float(np.finfo(float).max)
LONGEST = 60
"""Characters of an expression that a message shows."""

SAMPLES = 401
"""Times at which an input is looked at between two breaks."""


def expression_of(value: object, place: str) -> sp.Expr:
    """A declared value as an expression.

    Raises:
        DeclarationError: for text, nothing, a truth value, a list, a matrix.
    """
    # Text would be read as code, by other rules than those of the file that it stands in.
    if isinstance(value, (bool, str, bytes, type(None))):
        raise DeclarationError(f"{place} is {shown(value)}: write a number or an expression")
    try:
        found = sp.sympify(value)
    except (sp.SympifyError, TypeError, ValueError, AttributeError, RecursionError):
        found = None
    if not isinstance(found, sp.Expr) or getattr(found, "is_Matrix", False):
        raise DeclarationError(f"{place} is {shown(value)}: write a number or an expression")
    return found


def check_real(expression: sp.Expr, place: str, also: Sequence[type] = ()) -> None:
    """Refuse what is written with I, with no number, or with functions that have no value here.

    Raises:
        DeclarationError: naming the part, and what to write.
    """
    if expression.has(sp.I):
        raise DeclarationError(
            f"{place} is complex: {shown(expression)} has I; write it in real functions,"
            " as cos(w*t) for the real part of exp(I*w*t)"
        )
    if expression.has(sp.nan, sp.oo, sp.zoo, -sp.oo):
        raise DeclarationError(f"{place} is {shown(expression)}, which is not a finite number")
    known = (*FUNCTIONS, *also)
    for part in expression.atoms(sp.Function, sp.Derivative, sp.Integral, sp.Sum, sp.Product):
        if not isinstance(part, known):
            raise DeclarationError(
                f"{place} has {shown(part)}, which has no value here. Write it with "
                "powers, exponentials, logarithms, trigonometric or hyperbolic "
                "functions. Write jumps of an input with Heaviside or Piecewise"
            )


def number_of(value: object, constants: Mapping[sp.Symbol, sp.Expr], place: str) -> float:
    """The finite real number that a declared value is, constants put in.

    Raises:
        DeclarationError: where it is none.
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
    if abs(number) > LARGEST:
        raise DeclarationError(f"{place} is {shown(value)}, which is too large for a double")
    return float(number)


def check_plain(value: object, place: str) -> None:
    """Refuse what is not one finite real number as Python has it, such as a constant's value.

    Raises:
        DeclarationError: naming what it is.
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
    """Refuse an input that is complex, infinite or nothing at a time from start to stop.

    Looked for at many times, and in between where what stands beneath a root, a logarithm or a
    fraction is zero.

    Args:
        values: the expression at given times, in doubles.

    Raises:
        DeclarationError: naming the time.
    """
    times = np.linspace(start, stop, SAMPLES)
    # At the very end another branch may hold.
    times[-1] = np.nextafter(stop, start)
    with np.errstate(all="ignore"):
        found = values(times)
    bad = ~np.isfinite(found)
    if bad.any():
        time = float(times[np.argmax(bad)])
        raise DeclarationError(f"{place} {_at(expression, time)}")
    for base in _critical(expression):
        zero = _zero(base, times)
        if zero is not None:
            raise DeclarationError(
                f"{place}: {shown(expression)} is complex, infinite or not smooth where"
                f" {shown(base)} is zero, near t = {zero:.6g} s; an input must be real and finite"
                " throughout"
            )


def _critical(expression: sp.Expr) -> set[sp.Expr]:
    """What must not vanish between two times: beneath fractions and roots, and in logarithms."""
    found = set()
    for part in expression.atoms(sp.Pow, sp.log, sp.tan, sp.sec, sp.cot, sp.csc):
        if isinstance(part, sp.Pow):
            whole = part.exp.is_Integer and part.exp >= 0
            if not whole and part.base.has(t):
                found.add(part.base)
        elif part.has(t):
            angle = part.args[0]
            wave = {sp.log: angle, sp.tan: sp.cos(angle), sp.sec: sp.cos(angle)}
            found.add(wave.get(part.func, sp.sin(angle)))
    return found


def _zero(base: sp.Expr, times: Array) -> float | None:
    """About when it is zero between the first time and the last, those apart; None if never.

    A polynomial's roots are counted (Sturm); of anything else signs are looked at, and looked at
    again about each time at which it is small.
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
    # At the first time it may be zero, and at the last.
    return float(every[changed[0]]) if changed.size and every[changed[0] + 1] < stop else None


def _at(expression: sp.Expr, time: float) -> str:
    """What an expression is at a time at which it is no finite real number."""
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
    """A value in a message, on one line and not longer than a reader needs."""
    try:
        text = " ".join((str(value) if isinstance(value, sp.Basic) else repr(value)).split())
    except ValueError:  # an integer of too many digits to be written
        return "a number of thousands of digits"
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."
