"""Typesetting of expressions as text and as LaTeX."""

import pytest
import sympy as sp

from physics_crosscheck import System
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.render.terminal.primes import primed
from physics_crosscheck.harness.render.terminal.typeset import (
    Latex,
    Style,
    Text,
    latex_name,
    latex_number,
)
from physics_crosscheck.reference.dynamics.modes import s
from physics_crosscheck.reference.load import load_system


def latex_of(system: System) -> Latex:
    return Latex(system.q, system.v, system.a)


@pytest.fixture(scope="module")
def drum() -> System:
    return load_system(builtin() / "drum_pendulum")


def test_derivatives_have_dots_and_greek_names_are_letters(drum: System) -> None:
    write = latex_of(drum).math
    (x, theta) = drum.coordinates
    assert write(x.v) == r"\dot{x}"
    assert write(theta.a**2) == r"\ddot{\theta}^{2}"
    assert write(sp.Rational(3, 2) * x.q) == r"\frac{3 x}{2}"
    pair = load_system(builtin() / "free_pair")
    first = pair.coordinates[0]
    assert latex_of(pair).math(first.v) == r"\dot{x}_{1}", "the dot is on the letter"
    text = Text(pair.q, pair.v, pair.a)
    assert text.math(first.a * first.v**2) == "x1''*x1'^2"


def test_transfer_function_has_descending_powers_and_positive_lead(
    drum: System,
) -> None:
    latex, text = latex_of(drum), Text(drum.q, drum.v, drum.a)
    k, m = (next(c.symbol for c in drum.constants if c.name == name) for name in "km")
    assert latex.rational(-1 / (k - m * s**2), s) == r"\frac{1}{m \, s^{2} - k}"
    assert text.rational(-1 / (k - m * s**2), s) == "1 / (m*s^2 - k)"
    assert latex.matrix([["k", "0"], ["0", "m"]]) == r"\begin{bmatrix} k & 0 \\ 0 & m \end{bmatrix}"


@pytest.mark.parametrize("style", [Latex((), (), ()), Text((), (), ())])
def test_denominator_of_one_is_omitted(style: Style) -> None:
    assert style.rational(sp.Integer(0), s) == "0"
    assert style.rational(s + 1, s) == "s + 1"


@pytest.mark.parametrize("style", [Latex((), (), ()), Text((), (), ())])
def test_coefficient_of_one_is_omitted(style: Style) -> None:
    x = sp.Symbol("x")
    assert style.sum([(sp.Float(1.0), x), (sp.Float(0.0), x), (sp.Integer(-1), s)]) == "x - s"
    assert style.sum([(sp.Float(0.0), x)]) == "0"


def test_subtracted_sum_keeps_its_brackets() -> None:
    a, b = sp.symbols("a b")
    addends = [(a, s), (-a - b, sp.Integer(1))]
    assert Text((), (), ()).sum(addends) == "a*s - (a + b)"
    assert Latex((), (), ()).sum(addends) == r"a \, s - \left(a + b\right)"


@pytest.mark.parametrize(
    ("name", "latex"),
    [
        ("m1", "m_{1}"),
        ("k_theta", r"k_{\theta}"),
        ("lambda", r"\lambda"),
        ("varphi", r"\varphi"),
        ("Gamma", r"\Gamma"),
        ("mass", r"\text{mass}"),
        ("chat", r"\text{chat}"),  # sympy would put a hat on a c
        ("boom_centre_x", r"\text{boom}_{\text{centre},x}"),
        ("a{b", r"\text{a\{b}"),
    ],
)
def test_name_is_a_letter_or_a_word_with_indices(name: str, latex: str) -> None:
    assert latex_name(name) == latex


def test_numbers_have_six_digits() -> None:
    x = sp.Symbol("x")
    assert latex_number(-1.23456789e-7) == r"-1.23457 \times 10^{-7}"
    assert latex_number(47.0) == "47"
    digits = sp.Rational(198669330795061215459413, 10**24)
    assert Text((), (), ()).math(digits * x) == "0.198669*x"
    assert Latex((), (), ()).math(digits * x) == "0.198669 x"
    assert Text((), (), ()).math(sp.Rational(2, 3) * x) == "2*x/3"


def test_sympy_output_gets_primes_and_carets() -> None:
    assert primed("x_ddot + theta_x_dot**2 - x_dot", ["x", "theta_x"]) == "x'' + theta_x'^2 - x'"


@pytest.mark.parametrize(
    ("text", "latex"),
    [
        ("f ± k*x1' = m*x1''", r"f \pm k \dot{x}_{1} = m \ddot{x}_{1}"),
        ("dL/dx' - D = 0", r"d L/d \dot{x} - D = 0"),
        ("d/dt(dT/dx') = sin(theta)^2", r"d /d t(d T/d \dot{x}) = \sin(\theta)^{2}"),
        ("d1/d2", "d_{1}/d_{2}"),
    ],
)
def test_equation_text_is_converted_to_latex(text: str, latex: str) -> None:
    assert Latex((), (), ()).equation(text) == latex
