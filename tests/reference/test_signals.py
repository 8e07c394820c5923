"""Inputs: their breaks, their pieces, and the linear equations that generate them."""

import dataclasses

import mpmath as mp
import numpy as np
import pytest
import sympy as sp
from sympy import Abs, Heaviside, Max, Piecewise, Rational, cos, cosh, exp, floor, log, sin, sqrt

from physics_crosscheck import DeclarationError, Input, System, t
from physics_crosscheck.reference.mechanism.signal import (
    SignalPiece,
    generator,
    numeric_inputs,
    pieces,
)
from tests.reference.mechanisms import declared, oscillator


def split_input(force: sp.Expr, duration: float = 6.0) -> tuple[SignalPiece, ...]:
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
def test_input_is_cut_at_its_breaks(force: sp.Expr, breaks: list[float]) -> None:
    signals = split_input(force)
    assert [p.start for p in signals] == [0.0, *breaks]
    assert [p.stop for p in signals] == [*breaks, 6.0]


def test_piece_has_its_branch() -> None:
    first, second, third = split_input(
        2 * Heaviside(t - 1) + Piecewise((t**2, t < 4), (sin(t), True))
    )
    assert first.expressions == (t**2,)
    assert second.expressions == (t**2 + 2,)
    assert third.expressions == (sin(t) + 2,)
    assert [p.constant for p in split_input(5 * Heaviside(t - 1))] == [True, True]
    assert not first.constant


def test_breaks_of_one_input_split_all_inputs() -> None:
    base = declared()
    x = base["coordinates"][0]
    second = Input("g", "N", "another force", on={x: -1})
    scenario = dataclasses.replace(
        base["scenarios"][0],
        inputs={base["inputs"][0]: Heaviside(t - 1), second: t * Heaviside(t - 2)},
    )
    system = System(**base | {"inputs": (*base["inputs"], second), "scenarios": (scenario,)})
    signals = pieces(system, scenario)
    assert [p.expressions for p in signals] == [(0, 0), (1, 0), (1, t)]


def test_decimal_is_an_exact_double() -> None:
    (signal,) = split_input(sin(8.6 * t))
    assert signal.expressions == (sin(sp.Rational(8.6) * t),)


def test_numeric_inputs_take_the_right_hand_value_at_a_break() -> None:
    inputs = numeric_inputs(split_input(3 * Heaviside(t - 2) + t * Heaviside(t - 4)))
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
def test_generator_reproduces_its_signal(force: sp.Expr, order: int) -> None:
    result = generator(sp.sympify(force))
    assert result is not None
    assert len(result.coefficients) == order
    with mp.workdps(40):
        start, length = mp.mpf("0.4"), mp.mpf("1.7")
        moved = mp.expm(result.matrix * length, method="taylor") * mp.matrix(result.state(start))
        exact = result.state(start + length)
        size = max(1, *(abs(value) for value in exact))
        # Ten digits of 40 for the norms of exp(S t), of companion matrices up to 9^4.
        assert all(abs(moved[i] - exact[i]) <= mp.mpf(10) ** -30 * size for i in range(order))


def test_generator_precision_does_not_depend_on_the_context() -> None:
    """Catch a generator that caches the precision of its first caller."""
    with mp.workdps(15):
        result = generator(sin(sp.Rational(5.9) * t))
    assert result is not None
    with mp.workdps(40):
        exact = mp.mpf(5.9) ** 2
        assert abs(result.coefficients[0] - exact) <= exact * mp.mpf(10) ** (1 - 40)


@pytest.mark.parametrize(
    "force", [sin((2 + t) * t), 1 / (1 + t), log(1 + t), sqrt(1 + t), exp(-(t**2)), sin(sin(t))]
)
def test_input_of_no_linear_equation_has_no_generator(force: sp.Expr) -> None:
    assert generator(force) is None
    (signal,) = split_input(force)
    assert signal.generators is None


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
def test_input_with_unknown_breaks_is_rejected_with_a_reason(force: sp.Expr, sentence: str) -> None:
    with pytest.raises(DeclarationError) as caught:
        split_input(force)
    assert sentence in str(caught.value)
    assert "system 'oscillator', scenario 'only'" in str(caught.value)
