"""Units as dimensions, enough to reject physically impossible expressions.

A unit is a product of powers of SI symbols, such as ``kg*m^2`` or ``N*s/m``. The radian is
dimensionless, as in the SI Brochure (9th edition, table 4).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

import sympy as sp


class UnitError(ValueError):
    """A unit that can't be parsed, or an expression with inconsistent dimensions."""


@dataclass(frozen=True)
class Dimension:
    """Exponents of mass, length and time."""

    mass: Fraction = Fraction(0)
    length: Fraction = Fraction(0)
    time: Fraction = Fraction(0)

    def __mul__(self, other: Dimension) -> Dimension:
        return Dimension(self.mass + other.mass, self.length + other.length, self.time + other.time)

    def __pow__(self, power: Fraction) -> Dimension:
        return Dimension(self.mass * power, self.length * power, self.time * power)

    def __truediv__(self, other: Dimension) -> Dimension:
        return self * other ** Fraction(-1)

    def __str__(self) -> str:
        parts = [("kg", self.mass), ("m", self.length), ("s", self.time)]
        text = "*".join(name if e == 1 else f"{name}^{e}" for name, e in parts if e)
        return text or "1"


DIMENSIONLESS = Dimension()
MASS = Dimension(mass=Fraction(1))
LENGTH = Dimension(length=Fraction(1))
TIME = Dimension(time=Fraction(1))
FORCE = MASS * LENGTH / TIME ** Fraction(2)
ENERGY = FORCE * LENGTH
POWER = ENERGY / TIME

_SYMBOLS = {
    "1": DIMENSIONLESS,
    "rad": DIMENSIONLESS,
    "kg": MASS,
    "m": LENGTH,
    "s": TIME,
    "N": FORCE,
    "J": ENERGY,
    "W": POWER,
    "Hz": TIME ** Fraction(-1),
    "Pa": FORCE / LENGTH ** Fraction(2),
}
_FACTOR = re.compile(r"([A-Za-z]+|1)(?:(?:\^|\*\*)(-?\d+))?$")


def parse_unit(text: str) -> Dimension:
    """Return the dimension of a unit such as ``N*s/m``.

    Raises:
        UnitError: with the part that is not a known SI symbol.
    """
    if not isinstance(text, str) or not text.strip():
        raise UnitError(f"the unit {text!r} is empty; write '1' for a dimensionless number")
    result = DIMENSIONLESS
    tokens = re.split(r"(?<!\*)([*/])(?!\*)", text.replace(" ", ""))
    operators = ["*", *tokens[1::2]]
    for operator, factor in zip(operators, tokens[::2], strict=True):
        match = _FACTOR.match(factor)
        if match is None or match[1] not in _SYMBOLS:
            symbols = ", ".join(_SYMBOLS)
            raise UnitError(
                f"the unit {text!r} has an unknown part {factor!r}; known units: {symbols}"
            )
        dimension = _SYMBOLS[match[1]] ** Fraction(match[2] or 1)
        result = result * dimension if operator == "*" else result / dimension
    return result


def dimension_of(expression: sp.Expr, symbols: Mapping[sp.Symbol, Dimension]) -> Dimension | None:
    """Return the dimension of an expression; None for zero, which has every dimension.

    Raises:
        UnitError: with the sum, power or function whose parts have inconsistent dimensions.
    """
    if expression.is_zero:
        return None
    if expression.is_number:
        return DIMENSIONLESS
    match expression:
        case sp.Symbol():
            return symbols[expression]
        case sp.Add():
            return _dimension_of_sum(expression, symbols)
        case sp.Mul():
            return _dimension_of_product(expression, symbols)
        case sp.Pow() if expression.exp.is_Rational:
            base = dimension_of(expression.base, symbols)
            return base and base ** Fraction(int(expression.exp.p), int(expression.exp.q))
        case sp.atan2():
            return _dimension_of_angle(expression, symbols)
    return _dimension_of_function(expression, symbols)


def _dimension_of_product(
    expression: sp.Mul, symbols: Mapping[sp.Symbol, Dimension]
) -> Dimension | None:
    product = DIMENSIONLESS
    for factor in expression.args:
        dimension = dimension_of(factor, symbols)
        if dimension is None:
            return None
        product = product * dimension
    return product


def _dimension_of_angle(expression: sp.Expr, symbols: Mapping[sp.Symbol, Dimension]) -> Dimension:
    """Check that y and x of `atan2(y, x)` have one unit; the angle is dimensionless."""
    y, x = (dimension_of(argument, symbols) for argument in expression.args)
    if y is not None and x is not None and y != x:
        raise UnitError(f"{expression} compares {y} with {x}")
    return DIMENSIONLESS


def _dimension_of_function(
    expression: sp.Expr, symbols: Mapping[sp.Symbol, Dimension]
) -> Dimension:
    """Check that the arguments of a function such as the sine are dimensionless."""
    for argument in expression.args:
        dimension = dimension_of(argument, symbols)
        if dimension not in (None, DIMENSIONLESS):
            raise UnitError(
                f"{argument} in {expression} has the unit {dimension}; expected a "
                "dimensionless number"
            )
    return DIMENSIONLESS


def _dimension_of_sum(
    expression: sp.Add, symbols: Mapping[sp.Symbol, Dimension]
) -> Dimension | None:
    first: tuple[sp.Expr, Dimension] | None = None
    for term in expression.args:
        dimension = dimension_of(term, symbols)
        if dimension is None:
            continue
        if first is None:
            first = (term, dimension)
        elif dimension != first[1]:
            raise UnitError(f"{first[0]} has the unit {first[1]}, but {term} has {dimension}")
    return first and first[1]
