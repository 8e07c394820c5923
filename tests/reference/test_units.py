"""Units are read as dimensions, and contradictions are named."""

import pytest
import sympy as sp

from physics_crosscheck.reference.mechanism.units import UnitError, dimension_of, parse_unit

x, y, m, angle = sp.symbols("x y m angle", real=True)
DIMENSIONS = {x: parse_unit("m"), y: parse_unit("s"), m: parse_unit("kg"), angle: parse_unit("1")}


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("m", "m"),
        ("1", "1"),
        ("rad", "1"),
        ("N", "kg*m*s^-2"),
        ("kg*m/s^2", "kg*m*s^-2"),
        ("kg*m^2", "kg*m^2"),
        ("N*m/rad", "kg*m^2*s^-2"),
        ("J/s", "kg*m^2*s^-3"),
        ("W", "kg*m^2*s^-3"),
        ("m**2", "m^2"),
        ("1/s", "s^-1"),
        ("N * s / m", "kg*s^-1"),
        ("m/s/s", "m*s^-2"),
    ],
)
def test_unit_is_read_and_written_as_a_dimension(text: str, written: str) -> None:
    assert str(parse_unit(text)) == written


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
    ("expression", "written"),
    [
        (m * x**2 / y**2, "kg*m^2*s^-2"),
        (sp.sqrt(x) ** 2 * sp.cos(angle), "m"),
        (sp.sqrt(x), "m^1/2"),
        (sp.atan2(x, 2 * x), "1"),
        (sp.exp(angle), "1"),
        (3 * x - x, "m"),
        (sp.sin(angle) ** angle, "1"),
        (sp.pi, "1"),
        (sp.Integer(0), "None"),
    ],
)
def test_expression_has_a_dimension(expression: sp.Expr, written: str) -> None:
    assert str(dimension_of(expression, DIMENSIONS)) == written


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
