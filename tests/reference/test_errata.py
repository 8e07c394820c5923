"""The table of errata is computed: one equation of the source differs, and planted faults do."""

import dataclasses
from functools import cache

import pytest
import sympy as sp

from reference import DeclarationError, PublishedEquation
from reference.derive import derive
from reference.errata import AGREES, DIFFERS, UP_TO_SIGNS, errata
from reference.linearize import linearize
from tests.reference.mechanisms import NAMES, built_in, equations_of, pendulum

PRINTED = [(name, i) for name in NAMES for i in range(len(built_in(name).printed))]


@cache
def rests_of(name: str):
    return tuple(linearize(equations_of(name), e) for e in built_in(name).equilibria)


def judge(name: str, *printed: PublishedEquation):
    system = dataclasses.replace(built_in(name), printed=printed)
    return errata(dataclasses.replace(equations_of(name), system=system), rests_of(name))


def verdict(name: str, text: str, states: str, of: str = "", driven: bool = True) -> str:
    (row,) = judge(name, PublishedEquation("0.0", text, states, of, driven, ""))
    assert (row.difference == "") == (row.verdict != DIFFERS)
    return row.verdict


@pytest.mark.parametrize("name", NAMES)
def test_every_printed_equation_agrees_but_2_25(name):
    table = errata(equations_of(name), rests_of(name))
    assert len(table) == len(built_in(name).printed) > 0
    for row in table:
        expected = (
            DIFFERS
            if row.printed.number == "2.25"
            else (UP_TO_SIGNS if "±" in row.printed.text else AGREES)
        )
        assert row.verdict == expected
    assert [row.printed.number for row in table if row.verdict == DIFFERS] == (
        ["2.25"] if name == "free_pair" else []
    )


def test_what_is_wrong_in_2_25_is_its_second_k_x2():
    table = {row.printed.number: row for row in judge("free_pair", *built_in("free_pair").printed)}
    names = {c.name: c.symbol for c in built_in("free_pair").constants}
    left = sp.sympify(table["2.25"].difference)
    k, x1, x2 = sp.symbols("k x1 x2")
    # Printed minus derived: k x2 where k x1 belongs, in one of the two signs.
    assert sp.expand(left - k * (x1 - x2)) == 0 or sp.expand(left - k * (x1 + x2)) == 0
    assert "m2*x2_ddot" in table["2.25"].derived
    assert set(names) == {"m1", "m2", "c", "k"}


def test_2_25_as_it_should_be_agrees_up_to_signs():
    text = "m2*x2'' ± c*x1' + c*x2' ± k*x1 ± k*x2 = 0"
    assert verdict("free_pair", text, "motion", "x2", False) == UP_TO_SIGNS


@pytest.mark.parametrize(
    ("name", "text", "states", "of", "expected"),
    [
        # a motion
        ("mass_spring_damper", "m*x'' + c*x' + k*x = f", "motion", "x", AGREES),
        ("mass_spring_damper", "f - k*x - c*x' = m*x''", "motion", "x", AGREES),
        ("mass_spring_damper", "f ± k*x ± c*x' = m*x''", "motion", "x", UP_TO_SIGNS),
        ("mass_spring_damper", "f + k*x - c*x' = m*x''", "motion", "x", DIFFERS),
        ("mass_spring_damper", "m*x'' + 2*c*x' + k*x = f", "motion", "x", DIFFERS),
        ("mass_spring_damper", "m*x'' ± 2*c*x' ± k*x = f", "motion", "x", DIFFERS),
        ("mass_spring_damper", "m*x'' + c*x' + 1.000001*k*x = f", "motion", "x", DIFFERS),
        ("mass_spring_damper", "m*x'' + k*x = f", "motion", "x", DIFFERS),
        ("mass_spring_damper", "m*x'' + c*x + k*x' = f", "motion", "x", DIFFERS),
        # a factor of constants is no matter, for a motion
        ("mass_spring_damper", "x'' + c*x'/m + k*x/m = f/m", "motion", "x", AGREES),
        ("mass_spring_damper", "-3*m*x'' - 3*c*x' - 3*k*x = -3*f", "motion", "x", AGREES),
        ("mass_spring_damper", "x'' + c*x'/m + k*x/m = f", "motion", "x", DIFFERS),
        ("mass_spring_damper", "x*m*x'' + x*c*x' + k*x^2 = x*f", "motion", "x", DIFFERS),
        ("mass_spring_damper", "0*x'' = 0", "motion", "x", DIFFERS),
        # an energy is compared as it stands
        ("mass_spring_damper", "m*x'^2/2", "T", "", AGREES),
        ("mass_spring_damper", "m*x'^2", "T", "", DIFFERS),
        ("mass_spring_damper", "-m*x'^2/2", "T", "", DIFFERS),
        ("mass_spring_damper", "k*x^2/2 + 3*k", "V", "", AGREES),
        ("mass_spring_damper", "k*x^2/2 + k*x", "V", "", DIFFERS),
        ("mass_spring_damper", "c*x'^2/2", "D", "", AGREES),
        ("mass_spring_damper", "c*x'^2", "D", "", DIFFERS),
        ("mass_spring_damper", "m*x'^2/2 - k*x^2/2", "L", "", AGREES),
        ("mass_spring_damper", "m*x'^2/2 ± k*x^2/2", "L", "", UP_TO_SIGNS),
        ("mass_spring_damper", "m*x'^2/2 + k*x^2/2", "L", "", DIFFERS),
        # nonlinear terms
        ("simple_pendulum", "theta'' + (g/l)*sin(theta) = tau/(m*l^2)", "motion", "theta", AGREES),
        ("simple_pendulum", "theta'' + (g/l)*theta = tau/(m*l^2)", "motion", "theta", DIFFERS),
        ("simple_pendulum", "theta'' ± (g/l)*sin(theta) = tau/(m*l)", "motion", "theta", DIFFERS),
        # linearized
        ("simple_pendulum", "m*l^2*theta'' + m*g*l*theta = tau", "linear", "hanging", AGREES),
        ("simple_pendulum", "m*l^2*theta'' - m*g*l*theta = tau", "linear", "hanging", DIFFERS),
        ("simple_pendulum", "l*theta'' - g*(theta - pi) = tau/(m*l)", "linear", "upright", AGREES),
    ],
)  # fmt: skip
def test_a_printed_equation_is_classed(name, text, states, of, expected):
    assert verdict(name, text, states, of) == expected


def test_an_equation_without_inputs_is_compared_without_them():
    text = "m*x'' + c*x' + k*x = 0"
    assert verdict("mass_spring_damper", text, "motion", "x", driven=False) == AGREES
    assert verdict("mass_spring_damper", text, "motion", "x", driven=True) == DIFFERS


def test_a_system_without_inputs_has_its_linear_equations_compared():
    system = pendulum(0.1, 0.0, 1.0)
    printed = PublishedEquation("3.12", "theta'' + (g/l)*theta = 0", "linear", "hanging", False, "")
    equations = derive(dataclasses.replace(system, published=(printed,)))
    (row,) = errata(equations, (linearize(equations, system.equilibria[0]),))
    assert row.verdict == AGREES


@pytest.mark.parametrize(("name", "index"), PRINTED)
def test_a_wrong_coefficient_in_any_printed_equation_is_told(name, index):
    """The last term scaled: no sign can repair it."""
    printed = built_in(name).printed[index]
    left, equals, right = printed.text.partition("=")
    head, sign, tail = left.rstrip().rpartition(" ") if " " in left.strip() else ("", "", left)
    spoiled = f"{head}{sign}(1.5)*{tail.strip()} {equals}{right}"
    if printed.states in ("motion", "linear") and not head:
        pytest.skip("one term: a factor is no matter")
    (row,) = judge(name, dataclasses.replace(printed, text=spoiled))
    assert row.verdict == DIFFERS


@pytest.mark.parametrize(
    ("text", "states", "of", "sentence"),
    [
        ("m*x'' + = f", "motion", "x", "can't read"),
        ("m*x'' + q*x = f", "motion", "x", "q is declared nowhere"),
        ("m*x'' = f", "motion", "y", "'y' is no coordinate"),
        ("m*x'' = f", "linear", "upright", "'upright' is no equilibrium"),
    ],
)
def test_an_equation_that_cannot_be_read_is_refused_by_a_sentence(text, states, of, sentence):
    with pytest.raises(DeclarationError) as caught:
        verdict("mass_spring_damper", text, states, of)
    assert sentence in str(caught.value)
    assert "Eq. 0.0" in str(caught.value)
