"""Inputs: their breaks, their pieces, and the linear equations that generate them."""

import dataclasses

import mpmath as mp
import numpy as np
import pytest
import sympy as sp
from sympy import Abs, Heaviside, Max, Piecewise, Rational, cos, cosh, exp, floor, log, sin, sqrt

from physics_crosscheck import DeclarationError, Input, System, t
from physics_crosscheck.reference.mechanism.signal import (
    DIGITS,
    SignalPiece,
    generator,
    numeric_inputs,
    pieces,
)
from tests.reference.mechanisms import EPS, declared, oscillator


def cut(force: sp.Expr, duration: float = 6.0) -> tuple[SignalPiece, ...]:
    system = oscillator(1.0, 0.0, 1.0, force, duration=duration)
    return pieces(system, system.scenarios[0])


@pytest.mark.parametrize(
    ("force", "breaks"),
    [
        (0, []),
        (sin(t), []),
        (Heaviside(t - 2), [2.0]),
        (3 - Heaviside(2 * t - 3), [1.5]),
        (Heaviside(t - 1) - Heaviside(4 - t) + t, [1.0, 4.0]),
        (Piecewise((t, t < 1), (2 - t, t < 2), (0, True)), [1.0, 2.0]),
        (Heaviside(t - 1) * Piecewise((1, t <= 3), (2, True)), [1.0, 3.0]),
        (Heaviside(t - 7) + Heaviside(t + 1), []),
        (Heaviside(t - Rational(1, 10)), [0.1]),
        (Heaviside(t - 0.1), [0.1]),
        (Heaviside(t - Rational(1, 3)), [1 / 3]),
    ],
)
def test_an_input_is_cut_at_its_breaks(force: sp.Expr, breaks: list[float]) -> None:
    found = cut(force)
    assert [p.start for p in found] == [0.0, *breaks]
    assert [p.stop for p in found] == [*breaks, 6.0]


def test_a_piece_has_the_branch_that_holds_in_it() -> None:
    first, second, third = cut(2 * Heaviside(t - 1) + Piecewise((t**2, t < 4), (sin(t), True)))
    assert first.expressions == (t**2,)
    assert second.expressions == (t**2 + 2,)
    assert third.expressions == (sin(t) + 2,)
    assert [p.constant for p in cut(5 * Heaviside(t - 1))] == [True, True]
    assert not first.constant


def test_the_breaks_of_all_inputs_cut_all_of_them() -> None:
    base = declared()
    x = base["coordinates"][0]
    second = Input("g", "N", "another force", on={x: -1})
    scenario = dataclasses.replace(
        base["scenarios"][0],
        inputs={base["inputs"][0]: Heaviside(t - 1), second: t * Heaviside(t - 2)},
    )
    system = System(**base | {"inputs": (*base["inputs"], second), "scenarios": (scenario,)})
    found = pieces(system, scenario)
    assert [p.expressions for p in found] == [(0, 0), (1, 0), (1, t)]


def test_a_decimal_means_the_double_that_it_is() -> None:
    (piece,) = cut(sin(8.6 * t))
    assert piece.expressions == (sin(sp.Rational(8.6) * t),)


def test_numeric_inputs_take_the_right_hand_value_at_a_break() -> None:
    inputs = numeric_inputs(cut(3 * Heaviside(t - 2) + t * Heaviside(t - 4)))
    times = np.array([0.0, 1.9, 2.0, 3.9, 4.0, 6.0])
    np.testing.assert_array_equal(inputs(times)[:, 0], [0, 0, 3, 3, 7, 9])


@pytest.mark.parametrize(
    ("force", "order"),
    [
        (sp.Integer(0), 1),
        (sp.Integer(7), 1),
        (t, 2),
        (3 + t**2 / 2, 3),
        (exp(-t / 4), 1),
        (2 * exp(-t / 4) + t, 3),
        (sin(3 * t), 2),
        (cos(3 * t + 1), 2),
        (sin(Rational(86, 10) * t) - 2 * cos(t), 4),
        (t * exp(-t) * sin(2 * t), 4),
        (t**2 * exp(-t), 3),
        (sin(t) ** 2, 3),
        (sin(t) * cos(2 * t), 4),
        (cosh(t / 3), 2),
        (exp(2 - t), 1),
        ((1 + t) ** 2 * exp(t / 5), 3),
        (Rational(1, 2) + Rational(7, 10) * sin(Rational(23, 10) * t), 3),
    ],
)
def test_a_generator_reproduces_its_signal(force: sp.Expr, order: int) -> None:
    made = generator(sp.sympify(force))
    assert made is not None
    assert len(made.coefficients) == order
    with mp.workdps(DIGITS):
        start, length = mp.mpf("0.4"), mp.mpf("1.7")
        moved = mp.expm(made.matrix * length, method="taylor") * mp.matrix(made.state(start))
        exact = made.state(start + length)
        size = max(1, *(abs(value) for value in exact))
        # Ten digits of 40 for the norms of exp(S t), of companion matrices up to 9^4.
        assert all(abs(moved[i] - exact[i]) <= mp.mpf(10) ** -30 * size for i in range(order))


def test_a_generator_has_its_digits_whoever_asks_first() -> None:
    """Precision in force elsewhere must not enter: a piece keeps the generators it made."""
    with mp.workdps(15):
        made = generator(sin(sp.Rational(5.9) * t))
    assert made is not None
    with mp.workdps(DIGITS):
        exact = mp.mpf(5.9) ** 2
        assert abs(made.coefficients[0] - exact) <= exact * mp.mpf(10) ** (1 - DIGITS)


def test_a_wrong_generator_is_told() -> None:
    made = generator(sin(3 * t))
    assert made is not None
    off = dataclasses.replace(made, coefficients=(made.coefficients[0] * (1 + EPS), 0))
    with mp.workdps(DIGITS):
        moved = mp.expm(off.matrix * 2) * mp.matrix(made.state(0))
        assert abs(moved[0] - made.state(2)[0]) > mp.mpf(10) ** -17


@pytest.mark.parametrize(
    "force", [sin((2 + t) * t), 1 / (1 + t), log(1 + t), sqrt(1 + t), exp(-(t**2)), sin(sin(t))]
)
def test_what_no_linear_equation_generates_has_no_generator(force: sp.Expr) -> None:
    assert generator(force) is None
    (piece,) = cut(force)
    assert piece.generators is None


@pytest.mark.parametrize(
    ("force", "sentence"),
    [
        (Abs(sin(t)), "the input f is not smooth"),
        (Max(0, sin(t)), "the input f is not smooth"),
        (sp.sign(sin(3 * t)), "the input f is not smooth"),
        (floor(t), "the input f is not smooth"),
        (Heaviside(t**2 - 1), "input f: the switch at t**2 - 1 = 0 must be linear in t"),
        (Heaviside(sin(t)), "input f: the switch at sin(t) = 0 must be linear in t"),
        (Piecewise((1, cos(t) > 0), (0, True)), "must be linear in t"),
    ],
)
def test_an_input_whose_breaks_cannot_be_told_is_refused_by_a_sentence(
    force: sp.Expr, sentence: str
) -> None:
    with pytest.raises(DeclarationError) as caught:
        cut(force)
    assert sentence in str(caught.value)
    assert "system 'oscillator', scenario 'only'" in str(caught.value)
