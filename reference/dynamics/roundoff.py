"""Running error analysis: first-order bounds of rounding errors of expressions in doubles.

Source: Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., section 3.3. Every
operation adds its own rounding to the errors of its operands, weighted by its partial derivatives.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache

import numpy as np
import sympy as sp

from physics_crosscheck.reference.mechanism.numeric import Array

UNIT = float(np.finfo(float).eps) / 2
"""Largest relative error of a sum, a product, a quotient or a root."""

LIBRARY = 4 * UNIT
"""Largest relative error of a sine, an exponential or another function in numpy."""

BoundedValue = tuple[Array, Array]
"""A value and its error bound, of one shape."""


def running_error(
    expressions: Sequence[sp.Expr],
    variables: Mapping[sp.Symbol, BoundedValue],
    rounded: bool = True,
) -> Array:
    """Return error bounds of expressions, (..., len(expressions)).

    Args:
        expressions: of the variables alone.
        variables: values and errors, all of one shape (...).
        rounded: whether to include rounding of the operations, besides the variables' errors.
    """
    bounded: dict[sp.Basic, BoundedValue] = dict(variables)
    shape = np.broadcast_shapes(*(np.shape(value) for value, _ in bounded.values()))
    with np.errstate(all="ignore"):
        results = [_walk(sp.sympify(e), bounded, float(rounded))[1] for e in expressions]
    errors = np.empty((*shape, len(results)))
    for i, error in enumerate(results):
        errors[..., i] = error
    return errors


def _walk(
    expression: sp.Expr, bounded: dict[sp.Basic, BoundedValue], rounded: float
) -> BoundedValue:
    if expression in bounded:
        return bounded[expression]
    if not expression.args:
        number = float(expression)
        exact = expression.is_Rational and sp.Rational(number) == expression
        off = 0.0 if exact else 2 * UNIT * abs(number) * rounded
        result = np.asarray(number), np.asarray(off)
    else:
        operands = [_walk(operand, bounded, rounded) for operand in expression.args]
        value, carried, rounding = _operation(expression, operands)
        result = value, carried + rounding * rounded
    bounded[expression] = result
    return result


def _operation(expression: sp.Expr, operands: Sequence[BoundedValue]) -> tuple[Array, Array, Array]:
    """Return the value, the propagated error of the operands, and the operation's own rounding."""
    values = [value for value, _ in operands]
    errors = [error for _, error in operands]
    match expression:
        case sp.Add():
            total = np.asarray(sum(values))
            size = np.asarray(sum(np.abs(value) for value in values))
            return total, np.asarray(sum(errors)), (len(values) - 1) * UNIT * size
        case sp.Mul():
            product = np.asarray(np.prod(np.broadcast_arrays(*values), axis=0))
            others = [
                np.prod(np.broadcast_arrays(1.0, *values[:i], *values[i + 1 :]), axis=0)
                for i in range(len(values))
            ]
            carried = sum(np.abs(o) * e for o, e in zip(others, errors, strict=True))
            return product, np.asarray(carried), (len(values) - 1) * UNIT * np.abs(product)
        case sp.Pow() if expression.exp.is_Rational:
            power = float(expression.exp)
            raised = np.power(values[0], power)
            slope = np.abs(power * np.power(values[0], power - 1))
            return raised, slope * errors[0], LIBRARY * np.abs(raised)
    return _function(expression, values, errors)


@lru_cache(maxsize=64)
def _with_slopes(function: type[sp.Expr], count: int) -> Callable[..., Sequence[Array]]:
    """Return a function of `count` operands with its partial derivatives."""
    places = sp.symbols(f"x:{count}")
    form = function(*places)
    compiled: Callable[..., Sequence[Array]] = sp.lambdify(
        places, [form, *(sp.diff(form, x) for x in places)], "numpy"
    )
    return compiled


def _function(
    expression: sp.Expr, values: Sequence[Array], errors: Sequence[Array]
) -> tuple[Array, Array, Array]:
    compiled = _with_slopes(expression.func, len(values))
    value, *slopes = (np.asarray(array) for array in compiled(*values))
    # An exact operand adds no error, even where its derivative has no value.
    carried = sum(np.where(e > 0, np.abs(s) * e, 0.0) for s, e in zip(slopes, errors, strict=True))
    return value, np.asarray(carried), LIBRARY * np.abs(value)
