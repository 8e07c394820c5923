"""Units are read as dimensions, contradictions are named; declared frames of bodies."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy as sp

from physics_crosscheck import DeclarationError, Pose, System, ground, rotation
from physics_crosscheck.reference.mechanism.system import frame_function
from physics_crosscheck.reference.mechanism.units import UnitError, dimension_of, parse_unit
from tests.poses.arm import SWING, a, l

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


EYE = sp.eye(3)
TILTED = rotation((1, 2, 2), a.q)


def frames(*declared: Any) -> System:
    return replace(SWING, frames=declared)


def test_frames_and_poses_are_functions_of_q() -> None:
    turned = ground.at(0, 0, 1).hinge(a, about=(0, -1, 0)).at(0, 0, -l)
    system = frames(turned.pose("end", "the end"), Pose("tip", tuple(turned.origin), "the same"))
    values = frame_function(system)(np.array([[0.3]])).reshape(2, 12)
    place = [0.8 * np.sin(0.3), 0, 1 - 0.8 * np.cos(0.3)]
    np.testing.assert_allclose(values[:, :3], [place, place], atol=1e-16)
    c, s = np.cos(0.3), np.sin(0.3)
    np.testing.assert_allclose(values[0, 3:], [c, 0, -s, 0, 1, 0, s, 0, c], atol=1e-16)
    np.testing.assert_array_equal(values[1, 3:], np.eye(3).ravel())


def test_quaternion_equals_its_rotation() -> None:
    half = a.q / 2
    turn = Pose("rod", (0, 0, 0), "rod", (sp.cos(half), 0, -sp.sin(half), 0)).rotation
    assert sp.simplify(turn - rotation((0, -1, 0), a.q)) == sp.zeros(3, 3)


@pytest.mark.parametrize(
    ("declared", "words"),
    [
        (Pose("", (0, 0, 0), "nothing"), "a frame needs a name"),
        (Pose("world", (0, 0, 0), "all"), "'world' is taken"),
        (Pose("rod", (0, 0, 0), ""), "it has no description"),
        (Pose("rod", (0, 0), "flat"), "its position must be three expressions, (x, y, z)"),  # type: ignore[arg-type]
        (Pose("rod", (a.v, 0, 0), "rod"), "it uses a_dot; use only positions and constants"),
        (Pose("rod", (sp.Symbol("w"), 0, 0), "rod"), "it uses w"),
        (Pose("rod", (l**2, 0, 0), "rod"), "its position has the unit m^2; expected m"),
        (Pose("rod", (l + a.q, 0, 0), "rod"), "has the unit"),
        (Pose("rod", (sp.I, 0, 0), "rod"), "which is not a real number"),
        (Pose("rod", (0, 0, 0), "rod", 2 * EYE), "not orthonormal"),
        (Pose("rod", (0, 0, 0), "rod", (0, 0, 0, 0)), "not orthonormal"),
        (Pose("rod", (0, 0, 0), "rod", (2, 0, 0, 0)), "not orthonormal"),
        (Pose("rod", (0, 0, 0), "rod", sp.diag(1, 1, -1)), "its rotation mirrors"),
        (Pose("rod", (0, 0, 0), "rod", sp.eye(2)), "must be a 3 x 3 matrix or a quaternion"),
        (Pose("rod", (0, 0, 0), "rod", l * TILTED), "its rotation has the unit m; expected 1"),
        ("rod", "is not a Pose"),
    ],
)
def test_wrong_frame_is_refused(declared: Any, words: str) -> None:
    with pytest.raises(DeclarationError) as error:
        frames(declared)
    assert words in str(error.value)


def test_two_frames_of_one_name_are_refused() -> None:
    with pytest.raises(DeclarationError, match="two frames share this name"):
        frames(Pose("rod", (0, 0, 0), "one"), Pose("rod", (0, 0, 1), "other"))


def test_plain_number_beside_a_length_is_in_metres() -> None:
    assert frames(Pose("rod", (l + 1.2, 0, 3), "rod", TILTED)).frames[0].position[2] == 3


@pytest.mark.parametrize(
    ("position", "rotation"),
    [
        (("print('run')", 0, 0), None),
        ((0, 0, 0), "print('run')"),
        ((0, 0, 0), ("print('run')", 0, 0, 0)),
        ((0, 0, 0), ((1, 0, 0), (0, 1, 0), (0, 0, "print('run')"))),
    ],
)
def test_text_in_a_pose_is_not_run(
    position: Any, rotation: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(ValueError, match="write a number or an expression"):
        Pose("rod", position, "rod", rotation)
    assert capsys.readouterr().out == ""
