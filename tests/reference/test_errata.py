"""The table of errata is computed, and published notation is read."""

import dataclasses
import re
from functools import cache
from time import process_time

import pytest
import sympy as sp

from physics_crosscheck import DeclarationError, PublishedEquation, Quantity
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.dynamics.errata import (
    EquationCheck,
    best_reading,
    errata,
    readings,
)
from physics_crosscheck.reference.dynamics.linearize import TaylorLinearization, linearize
from tests.reference.mechanisms import NAMES, built_in, equations_of, pendulum

AGREES, DIFFERS, UP_TO_SIGNS = "agrees", "differs", "agrees up to signs"

NUMBERS = {*(f"2.{i}" for i in range(1, 49)), *(f"3.{i}" for i in range(1, 15))}
"""Numbers of all numbered equations of the source."""

LEFT_OUT = {"3.1": "an infinite series of any function; its first order is 3.2"}

PUBLISHED = [(name, i) for name in NAMES for i in range(len(built_in(name).published))]
KINDS = {(name, built_in(name).published[i].states): (name, i) for name, i in PUBLISHED}
"""One equation of each kind in each system."""


def row(text: str, states: str, subject: str = "", driven: bool = False) -> PublishedEquation:
    return PublishedEquation("0.0", text, states, of=subject, driven=driven, note="")


@cache
def rests_of(name: str) -> tuple[TaylorLinearization, ...]:
    return tuple(linearize(equations_of(name), e) for e in built_in(name).equilibria)


def judge(name: str, *published: PublishedEquation, **changed: object) -> tuple[EquationCheck, ...]:
    system = dataclasses.replace(built_in(name), published=published, **changed)  # type: ignore[arg-type]
    return errata(dataclasses.replace(equations_of(name), system=system), rests_of(name))


def verdict(name: str, text: str, states: str, subject: str = "", driven: bool = True) -> str:
    (check,) = judge(name, row(text, states, subject, driven))
    assert (check.difference == "") == (check.verdict != DIFFERS)
    return check.verdict


def test_every_numbered_equation_of_the_source_has_a_row_or_a_reason() -> None:
    entered = [p.number for name in NAMES for p in built_in(name).published]
    assert len(entered) == len(set(entered))
    assert {*entered} | {*LEFT_OUT} == NUMBERS
    assert not {*entered} & {*LEFT_OUT}


@pytest.mark.parametrize("name", sorted({name for name, _ in PUBLISHED}))
def test_every_published_equation_agrees_but_2_25(name: str) -> None:
    table = errata(equations_of(name), rests_of(name))
    assert len(table) == len(built_in(name).published) > 0
    for check in table:
        expected = (
            DIFFERS
            if check.published.number == "2.25"
            else (UP_TO_SIGNS if "±" in check.published.text else AGREES)
        )
        assert check.verdict == expected
    assert [check.published.number for check in table if check.verdict == DIFFERS] == (
        ["2.25"] if name == "free_pair" else []
    )


def test_error_in_2_25_is_its_second_k_x2() -> None:
    published = built_in("free_pair").published
    table = {check.published.number: check for check in judge("free_pair", *published)}
    names = {c.name: c.symbol for c in built_in("free_pair").constants}
    difference = sp.sympify(table["2.25"].difference)
    k, x1, x2 = sp.symbols("k x1 x2")
    # Published minus derived: k x2 instead of k x1, with either sign.
    assert sp.expand(difference - k * (x1 - x2)) == 0 or sp.expand(difference - k * (x1 + x2)) == 0
    assert "m2*x2_ddot" in table["2.25"].derived
    assert set(names) == {"m1", "m2", "c", "k"}


def test_corrected_2_25_agrees_up_to_signs() -> None:
    text = "m2*x2'' ± c*x1' + c*x2' ± k*x1 ± k*x2 = 0"
    assert verdict("free_pair", text, "motion", "x2", False) == UP_TO_SIGNS


@pytest.mark.parametrize(
    ("name", "text", "states", "subject", "expected"),
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
        # a constant factor does not change a motion
        ("mass_spring_damper", "x'' + c*x'/m + k*x/m = f/m", "motion", "x", AGREES),
        ("mass_spring_damper", "-3*m*x'' - 3*c*x' - 3*k*x = -3*f", "motion", "x", AGREES),
        ("mass_spring_damper", "x'' + c*x'/m + k*x/m = f", "motion", "x", DIFFERS),
        ("mass_spring_damper", "x*m*x'' + x*c*x' + k*x^2 = x*f", "motion", "x", DIFFERS),
        ("mass_spring_damper", "0*x'' = 0", "motion", "x", DIFFERS),
        # an energy is compared without factors
        ("mass_spring_damper", "T = m*x'^2/2", "value", "", AGREES),
        ("mass_spring_damper", "T = m*x'^2", "value", "", DIFFERS),
        ("mass_spring_damper", "T = -m*x'^2/2", "value", "", DIFFERS),
        ("mass_spring_damper", "V = k*x^2/2 + 3*k", "value", "", AGREES),
        ("mass_spring_damper", "V = k*x^2/2 + k*x", "value", "", DIFFERS),
        ("mass_spring_damper", "D = c*x'^2/2", "value", "", AGREES),
        ("mass_spring_damper", "D = c*x'^2", "value", "", DIFFERS),
        ("mass_spring_damper", "L = m*x'^2/2 - k*x^2/2", "value", "", AGREES),
        ("mass_spring_damper", "L = m*x'^2/2 ± k*x^2/2", "value", "", UP_TO_SIGNS),
        ("mass_spring_damper", "L = m*x'^2/2 + k*x^2/2", "value", "", DIFFERS),
        # nonlinear terms
        ("simple_pendulum", "theta'' + (g/l)*sin(theta) = tau/(m*l^2)", "motion", "theta", AGREES),
        ("simple_pendulum", "theta'' + (g/l)*theta = tau/(m*l^2)", "motion", "theta", DIFFERS),
        ("simple_pendulum", "theta'' ± (g/l)*sin(theta) = tau/(m*l)", "motion", "theta", DIFFERS),
        # linearized
        ("simple_pendulum", "m*l^2*theta'' + m*g*l*theta = tau", "linear", "hanging", AGREES),
        ("simple_pendulum", "m*l^2*theta'' - m*g*l*theta = tau", "linear", "hanging", DIFFERS),
        ("simple_pendulum", "l*theta'' - g*(theta - pi) = tau/(m*l)", "linear", "upright", AGREES),
        # a linear equation has no powers; a general equation holds for each coordinate
        ("simple_pendulum", "m*l^2*theta'' + m*g*l*theta^2 = tau", "linear", "hanging", DIFFERS),
        ("free_pair", "d/dt(dL/dq') - dL/dq + dD/dq' = Q", "motion", "", AGREES),
        ("free_pair", "d/dt(dL/dq') + dL/dq + dD/dq' = Q", "motion", "", DIFFERS),
        ("free_pair", "d/dt(dL/dq') - dL/dq + dD/dq' = f", "motion", "", DIFFERS),
        ("drum_pendulum", "d/dt(dL/dq') ± dL/dq = Q, L = T + V", "motion", "", DIFFERS),
        # a derivative, and a chain, whose every side is compared
        ("mass_spring_damper", "dL/dx' = m*x'", "value", "", AGREES),
        ("mass_spring_damper", "d/dt(dL/dx') = m*x'", "value", "", DIFFERS),
        ("mass_spring_damper", "dD/dx' = c*x' = 2*c*x'/2", "value", "", AGREES),
        ("mass_spring_damper", "dD/dx' = c*x' = 2*c*x'", "value", "", DIFFERS),
        ("mass_spring_damper", "dD/dx' = 2*c*x' = c*x'", "value", "", DIFFERS),
        # substitutions
        ("mass_spring_damper", "T = p^2/(2*m), p = m*x'", "value", "", AGREES),
        ("mass_spring_damper", "T = p^2/(2*m), p = c*x'", "value", "", DIFFERS),
        ("mass_spring_damper", "T = m*v_x^2/2, v_x^2 = x'^2", "value", "", AGREES),
        # a linear part
        ("simple_pendulum", "f(theta) = f(theta0) + f'(theta0)*(theta - theta0)", "linear part",
         "theta", AGREES),
        ("simple_pendulum", "f(theta) = f(theta0) + f'(theta)*(theta - theta0)", "linear part",
         "theta", DIFFERS),
        ("simple_pendulum", "f(theta) = f(theta0)", "linear part", "theta", DIFFERS),
        ("simple_pendulum", "cos(theta) = 1, theta0 = 0", "linear part", "theta", AGREES),
        ("simple_pendulum", "cos(theta) = 1 - theta^2/2, theta0 = 0", "linear part", "theta",
         DIFFERS),
        ("simple_pendulum", "f''(theta) = -sin(theta)", "value", "", AGREES),
    ],
)  # fmt: skip
def test_published_equation_gets_its_verdict(
    name: str, text: str, states: str, subject: str, expected: str
) -> None:
    assert verdict(name, text, states, subject) == expected


def test_equation_without_inputs_is_compared_without_them() -> None:
    text = "m*x'' + c*x' + k*x = 0"
    assert verdict("mass_spring_damper", text, "motion", "x", driven=False) == AGREES
    assert verdict("mass_spring_damper", text, "motion", "x", driven=True) == DIFFERS


def test_system_without_inputs_has_its_linear_equations_compared() -> None:
    system = pendulum(0.1, 0.0, 1.0)
    published = row("theta'' + (g/l)*theta = 0", "linear", "hanging")
    equations = derive(dataclasses.replace(system, published=(published,)))
    (check,) = errata(equations, (linearize(equations, system.equilibria[0]),))
    assert check.verdict == AGREES


def altered_texts(published: PublishedEquation) -> list[str]:
    """Return the text with 1.5 times one term or factor, for each of them.

    Names on a value's left side and names that a substitution defines are not changed.
    """
    start = published.text.index("=") if published.states == "value" else 0
    zeros = re.findall(r", (\w+) = 0", published.text)
    altered = []
    pattern = r"d/dt\([^()]*\)|d\w+/d\w+'*|[A-Za-z_]\w*'*(?![\w'(])"
    for match in re.finditer(pattern, published.text):
        explained = re.match(r"(\^2)? = ", published.text[match.end() :])
        setting = "," in published.text[: match.start()]
        if match.start() < start or match[0] in zeros or (setting and explained):
            continue
        head, tail = published.text[: match.start()], published.text[match.end() :]
        altered.append(f"{head}(1.5*{match[0]}){tail}")
    return altered


@pytest.mark.parametrize(("name", "index"), KINDS.values())
def test_wrong_coefficient_is_detected(name: str, index: int) -> None:
    """Multiply each term and factor by 1.5, which no sign can compensate."""
    published = built_in(name).published[index]
    altered = [dataclasses.replace(published, text=text) for text in altered_texts(published)]
    assert altered
    for wrong in altered:  # without the text of a record, which takes most of the time
        best = best_reading(wrong, equations_of(name), rests_of(name))
        assert any(difference != 0 for _, difference in best), wrong.text


@pytest.mark.parametrize(
    ("name", "quantity", "numbers"),
    [
        ("mass_spring_damper", "F", ["2.1", "2.4"]),
        ("drum_pendulum", "T_M", ["2.34", "2.35"]),
        ("simple_pendulum", "a_t", ["3.3", "3.5"]),
    ],
)
def test_wrong_quantity_is_detected_in_its_equations(
    name: str, quantity: str, numbers: list[str]
) -> None:
    system = built_in(name)
    wrong = tuple(
        dataclasses.replace(q, expression=2 * q.expression) if q.name == quantity else q
        for q in system.quantities
    )
    table = judge(name, *system.published, quantities=wrong)
    assert [check.published.number for check in table if check.verdict == DIFFERS] == numbers


@pytest.mark.parametrize("name", NAMES)
def test_published_equations_do_not_change_derived_ones(name: str) -> None:
    bare = dataclasses.replace(built_in(name), published=(), quantities=(), sketch=())
    ours, theirs = equations_of(name), derive(bare)
    for attribute in ("mass", "force", "energy", "dissipated", "supplied"):
        assert getattr(ours, attribute) == getattr(theirs, attribute)


@pytest.mark.parametrize(
    ("text", "states", "subject", "sentence"),
    [
        ("m*x'' + = f", "motion", "x", "can't read"),
        ("m*x'' + q*x = f", "motion", "x", "q is not declared"),
        ("m*x'' = f", "motion", "y", "'y' is not a coordinate"),
        ("m*x'' = f", "linear", "upright", "'upright' is not an equilibrium"),
        ("x = x0", "linear part", "y", "'y' is not a coordinate"),
        ("m*x'' + k*x", "motion", "x", "has 1 sides; expected two"),
        ("m*x'' = k*x = f", "motion", "x", "has 3 sides; expected two"),
        ("m*x'' = w, w", "motion", "x", "can't read"),
        ("m*x'' = w, 2*w = f", "motion", "x", "'2*w' is not a name"),
        ("m*x'' = f, m = 2", "motion", "x", "m is declared already"),
        ("F(x) = f", "value", "", "is not a function of one coordinate"),
        # an equation is not compared with itself
        ("T = T", "value", "", "must name"),
        ("m*x' = m*x'", "value", "", "must name"),
        ("x = x", "value", "", "must name"),
        ("dL/dx' = m*x' + dL/dx' - m*x'", "value", "", "must name"),
    ],
)
def test_invalid_equation_is_rejected_with_a_reason(
    text: str, states: str, subject: str, sentence: str
) -> None:
    still: tuple[Quantity, ...] = (Quantity("F", sp.Integer(0), "N", "nothing"),)
    with pytest.raises(DeclarationError) as caught:
        judge("mass_spring_damper", row(text, states, subject, True), quantities=still)
    assert sentence in str(caught.value)
    assert "Eq. 0.0" in str(caught.value)


def refused(text: str) -> str:
    published = PublishedEquation("9.9", text, "motion", of="theta", driven=False, note="")
    began = process_time()
    with pytest.raises(DeclarationError, match=r"Eq\. 9\.9") as caught:
        readings(published, built_in("simple_pendulum"))
    assert process_time() - began < 2
    assert caught.value.about == ("PublishedEquation", "9.9")
    return str(caught.value)


@pytest.mark.parametrize("text", [
    "theta'' = 9**9**9", "theta'' = (9**64)**64", "theta'' = theta^(10^9)", "theta'' = 9**(-9**9)",
    f"theta'' = {'*'.join(['theta'] * (400 + 1))}",
    "theta'' = 1e999992", "theta'' = 2*1.5E-99_9992 + theta",
])  # fmt: skip
def test_powers_that_keep_a_worker_busy_are_refused(text: str) -> None:
    assert "exponent" in refused(text) or "too large to compute" in refused(text)


@pytest.mark.parametrize("text", [
    "theta'' = (lambda: 0)()", "theta'' = theta.__class__", "theta'' = [theta][0]",
    "theta'' = f'{theta}'", "theta'' = (theta if g else 0)", "theta'' = sin(*[theta])",
])  # fmt: skip
def test_program_is_rejected(text: str) -> None:
    assert "is not a number, a name or arithmetic" in refused(text)


def test_number_of_ambiguous_signs_is_limited() -> None:
    assert f"at most {8} are allowed" in refused(f"theta'' = {'± g ' * (8 + 1)}")


def test_root_is_an_exponent() -> None:
    published = PublishedEquation("1", "g = (g^2)^(1/2)", "value", of="", driven=False, note="")
    ((sides, _),) = readings(published, built_in("simple_pendulum"))
    assert sides[0] == sides[1]
