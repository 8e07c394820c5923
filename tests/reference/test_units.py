"""Units are read as dimensions, and contradictions are named."""

from fractions import Fraction

import pytest
import sympy as sp

from physics_crosscheck.reference.mechanism.units import (
    DIMENSIONLESS,
    ENERGY,
    FORCE,
    LENGTH,
    MASS,
    POWER,
    TIME,
    Dimension,
    UnitError,
    dimension_of,
    parse_unit,
)

x, y, m, angle = sp.symbols("x y m angle", real=True)
DIMENSIONS = {x: LENGTH, y: TIME, m: MASS, angle: DIMENSIONLESS}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("m", LENGTH),
        ("1", DIMENSIONLESS),
        ("rad", DIMENSIONLESS),
        ("N", FORCE),
        ("kg*m/s^2", FORCE),
        ("kg*m^2", MASS * LENGTH ** Fraction(2)),
        ("N*m/rad", ENERGY),
        ("J/s", POWER),
        ("W", POWER),
        ("m**2", LENGTH ** Fraction(2)),
        ("1/s", TIME ** Fraction(-1)),
        ("N * s / m", MASS / TIME),
        ("m/s/s", LENGTH / TIME / TIME),
    ],
)
def test_unit_is_read(text: str, expected: Dimension) -> None:
    assert parse_unit(text) == expected


@pytest.mark.parametrize(
    "text", ["Nm", "lb", "kg*", "m^", "m^x", "s^-", "deg", "2*m", "N m", "m^1/2"]
)
def test_unit_with_an_unknown_part_is_refused_naming_it(text: str) -> None:
    with pytest.raises(UnitError, match="has an unknown part"):
        parse_unit(text)


@pytest.mark.parametrize("text", ["", "  ", None, 1])
def test_missing_unit_is_refused_with_the_remedy(text: str) -> None:
    with pytest.raises(UnitError, match="write '1' for a dimensionless number"):
        parse_unit(text)


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        (m * x**2 / y**2, ENERGY),
        (sp.sqrt(x) ** 2 * sp.cos(angle), LENGTH),
        (sp.sqrt(x), LENGTH ** Fraction(1, 2)),
        (sp.atan2(x, 2 * x), DIMENSIONLESS),
        (sp.exp(angle), DIMENSIONLESS),
        (3 * x - x, LENGTH),
        (sp.sin(angle) ** angle, DIMENSIONLESS),
        (sp.pi, DIMENSIONLESS),
        (sp.Integer(0), None),
    ],
)
def test_expression_has_a_dimension(expression: sp.Expr, expected: Dimension) -> None:
    assert dimension_of(expression, DIMENSIONS) == expected


@pytest.mark.parametrize(
    ("expression", "named"),
    [
        (x + y, "but"),
        (x + 1, "but"),
        (sp.sin(x), "x in sin"),
        (sp.exp(y), "expected a dimensionless number"),
        (sp.Integer(2) ** x, "expected a dimensionless number"),
        (sp.atan2(x, y), "compares"),
        (m * (x + y), "but"),
    ],
)
def test_contradiction_is_named(expression: sp.Expr, named: str) -> None:
    with pytest.raises(UnitError, match=named):
        dimension_of(expression, DIMENSIONS)


def test_dimension_is_written_for_a_reader() -> None:
    assert str(FORCE) == "kg*m*s^-2"
    assert str(DIMENSIONLESS) == "1"
