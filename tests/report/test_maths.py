"""Formulas on the page: typeset and harmless."""

from collections.abc import Callable
from xml.etree.ElementTree import Element, fromstring

import pytest
import sympy as sp

from physics_crosscheck.harness.render.html.maths import ELEMENTS, mathml
from physics_crosscheck.harness.render.terminal.typeset import (
    Latex,
    latex_name,
    latex_number,
    latex_words,
)
from tests.cases.arms import arm

HOSTILE = (
    "<script>alert(1)</script>", "</math><img src=x onerror=alert(1)>", '"><b onclick="alert(1)">',
    "&lt;script&gt;", "<!--", "]]>", "a\u202eb\x1b\x00\ud800",
)  # fmt: skip


def flat(latex: str) -> str:
    """Return the text of MathML with its structure as brackets."""

    def walk(element: Element) -> str:
        inner = [walk(child) for child in element]
        match element.tag:
            case "mfrac":
                return f"({inner[0]})/({inner[1]})"
            case "msup":
                return f"{inner[0]}^{inner[1]}"
            case "msub":
                return f"{inner[0]}_{inner[1]}"
            case "mover":
                return f"{inner[0]}{inner[1]}"
        return (element.text or "") * (not inner) + "".join(inner)

    return walk(fromstring(mathml(latex))).replace("\u2062", " ").replace("\u2061", "")


@pytest.mark.parametrize(
    ("latex", "text"),
    [
        (r"\dot{x}", "x\u02d9"),
        (r"\ddot{\theta}^{2}", "θ\u00a8^2"),
        (r"\frac{3 x}{2}", "(3 x)/(2)"),
        (r"\dot{x}_{1}", "x\u02d9_1"),
        (r"\frac{1}{m \, s^{2} - k}", "(1)/(m s^2−k)"),
        (r"\begin{bmatrix} k & 0 \\ 0 & m \end{bmatrix}", "[k00m]"),
        (r"l m \cos{\left(\theta \right)} \sin^{2}{\left(x \right)}", "l m cos(θ) sin^2(x)"),
        (r"\left(a + b\right) \, s", "(a+b) s"),
        (r"\text{mass} \text{length}_{\text{arm},x}", "mass length_arm,x"),
        (r"-1.5 \times 10^{-7}", "−1.5×10^−7"),
    ],
)
def test_latex_becomes_mathml(latex: str, text: str) -> None:
    assert flat(latex) == text


def test_formula_is_inline_or_block() -> None:
    assert mathml("x") == "<math><mi>x</mi></math>"
    assert mathml("x", block=True) == '<math display="block"><mi>x</mi></math>'


def test_brackets_are_as_high_as_their_matrix() -> None:
    two = r"\begin{bmatrix} a \\ b \end{bmatrix} \begin{bmatrix} c \end{bmatrix}"
    (row,) = fromstring(mathml(two))
    assert [[e.tag for e in child] for child in row if child.tag == "mrow"] == [
        ["mo", "mtable", "mo"]
    ] * 2


def test_minus_after_equals_is_a_sign() -> None:
    assert '<mo>=</mo><mo form="prefix">−</mo>' in mathml("a = -b - c")
    assert mathml("a = -b - c").count("prefix") == 1


def test_very_long_formula_is_typeset() -> None:
    system = arm()
    formula = Latex(system.q, system.v, system.a).math(system.T)
    assert mathml(formula, block=True).startswith("<math")


@pytest.mark.parametrize("text", HOSTILE)
@pytest.mark.parametrize("written", [str, latex_name, latex_words, r"\text{{{}}}".format])
def test_hostile_name_is_text_or_dropped(text: str, written: Callable[[str], str]) -> None:
    element = fromstring(mathml(written(text)))
    assert element.tag in ("math", "code")
    assert {child.tag for child in element.iter()} - {"math", "code"} <= ELEMENTS
    assert {name for child in element.iter() for name in child.attrib} <= {
        "accent",
        "display",
        "fence",
        "form",
        "mathvariant",
        "rspace",
        "stretchy",
    }


@pytest.mark.parametrize(
    "latex",
    [r"\foo", "x^{", r"\frac{1}", r"\boxed{x}", r"\begin{bmatrix}", r"\left(", "{" * 10_000],
)
def test_unsupported_latex_is_shown_verbatim(latex: str) -> None:
    assert mathml(latex) == f"<code>{latex}</code>"


def test_character_references_are_escaped() -> None:
    assert "<b" not in mathml(r"\text{&lt;b&gt;}")
    assert "<" not in (fromstring(mathml(r"\unicode{x3c}")).text or "")


def test_special_functions_of_sympy_are_typeset() -> None:
    x = sp.Symbol("x")
    latex = Latex((), (), ())
    for e in (abs(x), sp.sign(x), sp.sqrt(x), sp.exp(-x), sp.log(x), sp.atan2(x, 1), x**sp.pi):
        assert mathml(latex.math(e)).startswith("<math>"), latex.math(e)


@pytest.mark.parametrize(
    ("quotient", "latex"),
    [("-1/(k - m*s**2)", r"\frac{1}{m \, s^{2} - k}"), ("s + 1", "s + 1"), ("0", "0")],
)
def test_quotient_has_a_positive_lead_and_no_denominator_of_one(quotient: str, latex: str) -> None:
    expression = sp.sympify(quotient)
    assert Latex((), (), ()).rational(expression, sp.Symbol("s")) == latex


def test_sum_keeps_brackets_and_omits_ones_and_zeros() -> None:
    a, b, s = sp.symbols("a b s")
    write = Latex((), (), ()).sum
    assert write([(a, s), (-a - b, sp.Integer(1))]) == r"a \, s - \left(a + b\right)"
    assert write([(sp.Float(1.0), a), (sp.Float(0.0), a), (sp.Integer(-1), s)]) == "a - s"
    assert write([(sp.Float(0.0), a)]) == "0"


def test_number_has_six_digits() -> None:
    assert latex_number(-1.23456789e-7) == r"-1.23457 \times 10^{-7}"
    long = sp.Rational(198669330795061215459413, 10**24)
    assert Latex((), (), ()).math(long * sp.Symbol("x")) == "0.198669 x"


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
