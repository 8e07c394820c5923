"""Inputs and their pieces; values that are complex, infinite or not numbers are rejected."""

import dataclasses
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np
import pytest
import sympy as sp
from sympy import (
    Abs,
    DiracDelta,
    Heaviside,
    I,
    Integral,
    Max,
    Piecewise,
    Rational,
    cos,
    cosh,
    exp,
    floor,
    log,
    sin,
    sqrt,
    tan,
)

from physics_crosscheck import DeclarationError, Equilibrium, Input, Output, Scenario, System, t
from physics_crosscheck.harness.checks.prepare import prepare_system
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.dynamics.linearize import linearize
from physics_crosscheck.reference.mechanism.signal import (
    SignalPiece,
    generator,
    numeric_inputs,
    pieces,
)
from physics_crosscheck.reference.solving.integrate import ReferenceError
from physics_crosscheck.reference.solving.segments import Motion
from physics_crosscheck.reference.solving.solve import solve
from tests.reference.mechanisms import C, F, K, M, X, constant, declared, oscillator, pendulum

W = constant("w", 2.0, "1/s")
L = constant("L", 1.0, "m")
ALL = (M, C, K, W, L)
x = X.q


def scenario(force: Any = 0, q: Any = 0.1, v: Any = 0, duration: Any = 5.0) -> Scenario:
    return Scenario("only", "of a test", q={X: q}, v={X: v}, inputs={F: force}, duration=duration)


def forced(force: Any) -> dict[str, Any]:
    return declared(scenarios=(scenario(force),))


def with_rest(place: Any, search: bool = False) -> dict[str, Any]:
    return declared(equilibria=(Equilibrium("rest", {X: place}, search, "a rest"),))


COMPLEX = [
    (forced(1 + 2 * I), "input f is complex"),
    (forced(I * sin(t)), "input f is complex"),
    (forced(1j * t), "input f is complex"),
    (forced((exp(I * t) + exp(-I * t)) / 2), "write it in real functions"),
    (forced(sqrt(t - 1)), "complex at t = 0 s: sqrt(t - 1)"),
    (forced(sqrt(3 - t)), "complex at t = 3.0"),
    (forced(sqrt((t - 1.001) * (t - 1.002))), "is zero, near t = 1.001 s"),
    (forced(sqrt((sp.cos(t) + 1) ** 2 - Rational(1, 10**12))), "is zero, near t = 3.14"),
    (forced((-1) ** t), "complex at t = 0.0125 s"),
    (forced(log(t - 2)), "complex at t = 0 s"),
    (forced(sp.asin(t)), "complex at t = 1.01"),
    (declared(scenarios=(scenario(q=0.1 * I),)), "q: the value of x is complex"),
    (declared(scenarios=(scenario(q=sqrt(-K / K)),)), "the value of x is"),
    (declared(scenarios=(scenario(v=I),)), "v: the value of x is complex"),
    (declared(scenarios=(scenario(duration=5j),)), "the duration is complex"),
    (declared(V=I * K * x**2 / 2), "V is complex"),
    (declared(T=I * M * X.v**2 / 2), "T is complex"),
    (declared(D=I * C * X.v**2 / 2), "D is complex"),
    (declared(constants=ALL, V=K * L**2 * sqrt(x / L - 1)), "V at its start is"),
    (declared(constants=ALL, V=K * L**2 * log(x / L - 2)), "which is not a real number"),
    (declared(outputs=(Output("x", I * x, "m", "d"),)), "output x is complex"),
    (
        declared(constants=ALL, outputs=(Output("x", L * sqrt(x / L - 1), "m", "d"),)),
        "a slope there that is not a finite real number",
    ),
    (with_rest(I), "equilibrium 'rest': the value of x is complex"),
    (with_rest(I, search=True), "the value of x is complex"),
    (declared(constants=(M, C, constant("k", 1j, "N/m"))), "no numeric value"),  # type: ignore[arg-type]
]
INFINITE = [
    (forced(sp.oo), "not a finite number"),
    (forced(float("nan")), "not a finite number"),
    (forced(1 / (t - 1)), "not a finite number at t = 1 s"),
    (forced((t - Rational(1, 3)) ** -2), "t - 1/3 is zero, near t = 0.333"),
    (forced(tan(t)), "where cos(t) is zero"),
    (forced(log(t)), "not a finite number at t = 0 s"),
    (forced(9**9**6), "not a finite number"),
    (forced(exp(t**9)), "not a finite number at t = 2.0"),
    (forced(Piecewise((1, t < 1))), "not a finite number at t = 1 s"),
    (declared(scenarios=(scenario(q=float("nan")),)), "the value of x is nan"),
    (declared(scenarios=(scenario(q=float("inf")),)), "the value of x is inf"),
    (declared(scenarios=(scenario(v=sp.nan),)), "v: the value of x is nan"),
    (declared(scenarios=(scenario(duration=float("nan")),)), "duration is nan"),
    (declared(scenarios=(scenario(duration=10**400),)), "too large"),
    (
        declared(constants=(M, C, constant("k", 10**400, "N/m"))),
        "the constant k is too large for a double",
    ),
    (with_rest(float("nan")), "the value of x is nan"),
    (with_rest(float("nan"), search=True), "the value of x is nan"),
    (declared(V=sp.nan), "V is nan"),
    (declared(constants=(constant("m", 1e-320, "kg"), C, K)), "not finite"),
]
NO_NUMBERS = [
    (forced("sin(t)"), "value of f is 'sin(t)'"),
    (forced(None), "the value of f is None"),
    (forced(True), "the value of f is True"),
    (forced(sp.Matrix([1])), "the value of f is Matrix"),
    (forced(DiracDelta(t - 1)), "has DiracDelta(t - 1), which has no value here"),
    (forced(sp.Function("g")(t)), "has g(t), which has no value here"),
    (forced(Integral(sin(t**2), (t, 0, t))), "has Integral("),
    (forced(sp.gamma(t + 1)), "has gamma(t + 1)"),
    (declared(scenarios=(scenario(q="0.1"),)), "value of x is '0.1'"),
    (declared(scenarios=(scenario(q=None),)), "the value of x is None"),
    (declared(scenarios=(scenario(q=True),)), "the value of x is True"),
    (declared(scenarios=(scenario(duration="5"),)), "the duration is '5'"),
    (declared(T=None), "T is None"),
    (declared(V=x > 0), "V is x > 0"),
    (declared(constants=(M, C, constant("k", "a", "N/m"))), "is 'a'"),  # type: ignore[arg-type]
]
MOTIONS = [
    (declared(scenarios=(scenario(duration=1e300),)), "1e+300 s holds 9.6e+299 periods"),
    (
        declared(scenarios=(scenario(duration=1e-10),)),
        "nothing moves within the duration of 1e-10 s",
    ),
    (
        declared(constants=ALL, T=M * X.v**2 * x**2 / L**2 / 2),
        "equilibrium 'rest': the mass matrix is singular there",
    ),
    (
        declared(constants=ALL, T=M * X.v**2 * (1 - x**2 / L**2) / 2, V=-K * x**2 / 2),
        "or the mass matrix is singular there",
    ),
    (declared(constants=ALL, V=K * x**2 * (1 + sin(W * t) / 2) / 2), "depend on t"),
]


def prepared(fields: dict[str, Any]) -> list[Motion]:
    equations = derive(System(**fields))
    for equilibrium in equations.system.equilibria:
        linearize(equations, equilibrium)
    return [solve(equations, each) for each in equations.system.scenarios]


@pytest.mark.parametrize(("fields", "sentence"), [*COMPLEX, *INFINITE, *NO_NUMBERS, *MOTIONS])
def test_invalid_value_is_rejected_with_a_reason(fields: dict[str, Any], sentence: str) -> None:
    with pytest.raises((DeclarationError, ReferenceError)) as caught:
        prepared(fields)
    message = str(caught.value)
    assert sentence in message
    assert message.startswith("system 'oscillator'")
    assert "\n" not in message
    assert len(message) < 400


@pytest.mark.parametrize(
    "force",
    [
        sp.re(exp(I * t)),
        sqrt(t + 1) + 1 / (1 + t**2),
        Rational(1, 2) ** t,
        Heaviside(t - 1) * sqrt(t),
        Piecewise((sin(t), t < 2), (0, True)),
        sp.atan2(t, 2) * sp.tanh(t),
        sqrt(1 + sin(t) / 2),
    ],
    ids=str,
)
def test_real_forces_are_accepted(force: sp.Expr) -> None:
    system = System(**forced(force))
    assert solve(derive(system), system.scenarios[0]).bound.max() < 1e-13


def test_mass_matrix_of_a_light_and_a_heavy_part_is_regular() -> None:
    heavy = constant("m", 1e9, "kg")
    light = constant("n", 1e-9, "kg")
    y = type(X)("y", "m", "of a speck")
    fields = declared(
        coordinates=(X, y),
        constants=(heavy, light, C, K),
        T=heavy * X.v**2 / 2 + light * (X.v + y.v) ** 2 / 2,
        V=K * x**2 / 2 + 1e-18 * K * y.q**2,
        equilibria=(Equilibrium("rest", {X: 0, y: 0}, False, "relaxed"),),
        scenarios=(
            Scenario(
                "only", "let go", q={X: 0.1, y: 0.1}, v={X: 0, y: 0}, inputs={F: 0}, duration=50
            ),
        ),
    )
    system = System(**fields)
    assert solve(derive(system), system.scenarios[0]).duration == pytest.approx(50)


def test_long_motion_is_accepted() -> None:
    system = pendulum(0.05, 0.0, duration=100.0)
    assert len(solve(derive(system), system.scenarios[0]).t) > 900


FILE = """\
from sympy import sqrt
from physics_crosscheck import (
    Constant, Coordinate, Equilibrium, Input, Output, Scenario, System, t)

x = Coordinate("x", "m", "displacement")
m = Constant("m", {mass}, "kg", "mass", "chosen")
k = Constant("k", 47.0, "N/m", "stiffness", "chosen")
f = Input("f", "N", "force", on={{x: 1}})
system = System(
    name="block",
    title="A block",
    source="a test",
    coordinates=(x,),
    constants=(m, k),
    inputs=(f,),
    outputs=(Output("x", x.q, "m", "displacement"),),
    T=m * x.v**2 / 2,
    V=k * x.q**2 / 2,
    D=0,
    equilibria=(Equilibrium("rest", at={{x: {rest}}}, search=False, description="relaxed"),),
    scenarios=(
        Scenario("still", "let go", q={{x: 0.1}}, v={{x: 0}}, inputs={{f: 0}}, duration=2.0),
        Scenario("pushed", "let go", q={{x: {start}}}, v={{x: 0}}, inputs={{f: {force}}},
                 duration=2.0),
    ),
    published=(),
)
"""


@pytest.mark.parametrize(
    ("changed", "line", "sentence"),
    [
        ({"force": "sqrt(t - 1)"}, 23, "scenario 'pushed': the input f is complex at t = 0 s"),
        ({"force": "1j"}, 23, "scenario 'pushed', input f is complex"),
        ({"start": "float('nan')"}, 23, "the value of x is nan"),
        ({"mass": "2j"}, 6, "the constant m has no numeric value: it is 2j"),
        ({"rest": "0.3"}, 20, "equilibrium 'rest': is not an equilibrium"),
        ({"force": "1 / 0"}, 23, "ZeroDivisionError: division by zero"),
    ],
)
def test_errors_are_reported_with_file_and_line(
    changed: dict[str, str], line: int, sentence: str, tmp_path: Path
) -> None:
    given = {"mass": "1.3", "rest": "0", "start": "0.1", "force": "0"} | changed
    path = tmp_path / "system.py"
    path.write_text(FILE.format(**given))
    with pytest.raises(DeclarationError) as caught:
        prepare_system(tmp_path, described=False)
    assert str(caught.value).startswith(f"{path}:{line}: ")
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


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
