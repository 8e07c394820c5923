"""Two independent methods integrate a motion and agree; bounds of its error, with 50 digits."""

import dataclasses
from typing import Any

import mpmath as mp
import numpy as np
import pytest
import sympy as sp
from sympy import Heaviside, cos, exp, sin

import physics_crosscheck.reference.solving.bounds
import physics_crosscheck.reference.solving.solve
from physics_crosscheck import Scenario, System, t
from physics_crosscheck.reference.dynamics.derive import Equations, derive, running_error
from physics_crosscheck.reference.dynamics.linearize import linearize
from physics_crosscheck.reference.mechanism.numeric import Array, compile_function
from physics_crosscheck.reference.mechanism.signal import pieces
from physics_crosscheck.reference.solving import integrate
from physics_crosscheck.reference.solving.collocation import collocate
from physics_crosscheck.reference.solving.integrate import (
    ReferenceError,
    by_runge_kutta,
    solve_numerically,
)
from physics_crosscheck.reference.solving.segments import Motion
from physics_crosscheck.reference.solving.solve import augmented, solve
from tests.reference.mechanisms import (
    CART,
    EPS,
    LINEAR,
    NAMES,
    SCENARIOS,
    equations_of,
    motion_of,
    oscillator,
)
from tests.reference.test_closed_form import textbook
from tests.reference.test_pendulum import STARTS, G, L, flow, solved

NONLINEAR = [*((n, s) for n, s in SCENARIOS if n not in LINEAR), (CART.name, "free")]
HEYOKA = integrate.heyoka_installed()


def scenario_of(name: str, scenario: str) -> tuple[Equations, Scenario]:
    equations = equations_of(name)
    return equations, equations.system.scenario(scenario)


def sizes(motion: Motion) -> Array:
    """Return the motion's size per component: the largest position, the largest velocity."""
    n = motion.end.shape[1] // 2
    largest = np.max(np.abs(motion.end), axis=0)
    return np.concatenate([np.full(n, largest[:n].max()), np.full(n, largest[n:].max())])


@pytest.mark.parametrize("name", NAMES)
def test_list_of_linear_systems_is_correct(name: str) -> None:
    assert equations_of(name).linear == (name in LINEAR)


@pytest.mark.parametrize(
    ("name", "scenario", "heyoka"),
    [*((*one, HEYOKA) for one in NONLINEAR[:-1]), ("simple_pendulum", "free", False),
     ("drum_pendulum", "driven", False),
     pytest.param(*NONLINEAR[-1], HEYOKA, marks=pytest.mark.slow)],
)  # fmt: skip
def test_two_integrations_agree_to_1e_12_of_the_motion(
    name: str, scenario: str, heyoka: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if heyoka == HEYOKA:
        motion = motion_of(name, scenario)
    else:
        monkeypatch.setattr(integrate, "heyoka_installed", lambda: heyoka)
        motion = solve(*scenario_of(name, scenario))
    # The requirement is 1e-12; a hundredth of it is reached, and must not get worse.
    assert np.all(motion.bound <= 1e-14 * sizes(motion))
    checked_by = "heyoka's Taylor series" if heyoka else "DOP853"
    assert motion.method == f"Gauss collocation of order 16, checked by {checked_by}"


@pytest.mark.parametrize(
    ("off", "heyoka"), [(1e-11, True), (1e-11, False), (np.nan, False), (np.inf, False)]
)
def test_disagreeing_integrations_are_an_error(
    off: float, heyoka: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    equations, scenario = scenario_of("simple_pendulum", "free")
    right = motion_of("simple_pendulum", "free")
    wrong = right.end + np.array([0.0, off * sizes(right)[1]])
    monkeypatch.setattr(integrate, "heyoka_installed", lambda: heyoka)
    name = "_taylor_series" if heyoka else "by_runge_kutta"
    monkeypatch.setattr(integrate, name, lambda *_: wrong)
    with pytest.raises(ReferenceError, match="two integrations of component 1 are"):
        solve(equations, scenario)


def test_check_within_the_agreement_widens_the_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(integrate, "heyoka_installed", lambda: False)
    equations, scenario = scenario_of("simple_pendulum", "free")
    right = motion_of("simple_pendulum", "free")
    off = 5e-13 * sizes(right)
    monkeypatch.setattr(integrate, "by_runge_kutta", lambda *_: right.end + off)
    assert np.all(solve(equations, scenario).bound >= off * (1 - 1e-3))


def falling_apart() -> System:
    """Declare x'' = +b x^3, which reaches infinity within a second."""
    base = oscillator(1.0, 0.0, 1.0, x=2.0, v=1.0, duration=5.0)
    (x,) = base.coordinates
    b = dataclasses.replace(base.constants[2], name="b", value=8.0, unit="N/m^3")
    return dataclasses.replace(base, V=-b * x.q**4 / 4, constants=(*base.constants, b))


@pytest.mark.filterwarnings("ignore:overflow encountered:RuntimeWarning")
@pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")
@pytest.mark.filterwarnings("ignore:divide by zero encountered:RuntimeWarning")
def test_motion_to_infinity_is_an_error_with_its_time() -> None:
    system = falling_apart()
    with pytest.raises(ReferenceError, match=r"the equations cannot be integrated past 0\.\d+ s"):
        solve(derive(system), system.scenarios[0])


def test_collocation_has_order_16() -> None:
    """Integrate y'' = -y from (0, 1) in one coarse segment: error ~ length^17."""

    def field(times: Array, states: Array) -> Array:
        return np.stack([states[..., 1], -states[..., 0]], axis=-1)

    def error(length: float) -> float:
        end, _ = collocate(field, np.zeros(1), np.array([[0.0, 1.0]]), length)
        return float(np.hypot(end[0, 0] - np.sin(length), end[0, 1] - np.cos(length)))

    # Between 1e-8 and 1e-12, far above rounding; the next power enters with (length/16)^2.
    observed = np.log2(error(7.0) / error(3.5))
    assert abs(observed - 17) < 0.5


def test_rates_with_rounding_noise_converge() -> None:
    """Catch a solver that iterates on noise of 1e-12, as of a light part of a heavy body."""
    calls = 0

    def field(times: Array, states: Array) -> Array:
        nonlocal calls
        calls += 1
        noise = 3e-12 * np.cos(np.arange(states[..., 0].size) * calls).reshape(states.shape[:-1])
        return np.stack([states[..., 1], -states[..., 0] * (1 + noise)], axis=-1)

    start = np.array([[0.0, 1.0]])
    end, _ = collocate(field, np.zeros(1), start, 0.5)
    assert end[0] == pytest.approx([np.sin(0.5), np.cos(0.5)], abs=1e-11)
    assert calls < 40
    again = by_runge_kutta(field, np.zeros(1), start, 0.5, rounded=True)
    assert again[0] == pytest.approx(end[0], abs=1e-11)
    assert calls < 120


def test_too_long_segment_names_the_diverging_rate() -> None:
    def field(times: Array, states: Array) -> Array:
        return np.stack([states[..., 1], -900 * states[..., 0]], axis=-1)

    with pytest.raises(ReferenceError, match="converge: the rate of elbow_dot changes by"):
        collocate(field, np.zeros(1), np.array([[1.0, 0.0]]), 1.0, ["elbow", "elbow_dot"])


def test_large_rounding_is_rejected_with_a_remedy() -> None:
    """Simulate a chain of 120 hinges, whose accelerations have nine correct digits."""
    rng = np.random.default_rng(0)

    def field(times: Array, states: Array) -> Array:
        return -states * (1 + 1e-8 * rng.uniform(-1, 1, states.shape))

    with pytest.raises(ReferenceError, match=r"rounding hides .*e-0[89] of the rate of hip.*parts"):
        collocate(field, np.zeros(1), np.array([[1.0, 0.5]]), 0.1, ["hip", "hip_dot"])


def test_rounding_below_the_accepted_difference_is_no_failure() -> None:
    """Catch a chain of 70 hinges that no engine's result is compared with."""
    rng = np.random.default_rng(0)

    def field(times: Array, states: Array) -> Array:
        return -states * (1 + 3e-10 * rng.uniform(-1, 1, states.shape))

    end, _ = collocate(field, np.zeros(1), np.array([[1.0, 0.5]]), 0.1, ["hip", "hip_dot"])
    np.testing.assert_allclose(end, np.exp(-0.1) * np.array([[1.0, 0.5]]), rtol=1e-10)


MOTIONS = [(name, scenario) for name, scenario in SCENARIOS if name in LINEAR]
EVERY = 9  # the ninth part of the segments is checked


def segment_errors(equations: Equations, name: str, motion: Motion) -> Array:
    """Return |end - exact| of some segments of a linear system, each from its start in doubles."""
    linear = linearize(equations, equations.system.equilibria[0])
    size = motion.start.shape[1]
    errors, first = [], 0
    with mp.workdps(50):
        signals = pieces(equations.system, equations.system.scenario(name))
        for span, signal in zip(motion.spans, signals, strict=True):
            assert signal.generators is not None
            matrix = augmented(linear, signal.generators) * mp.mpf(span.length)
            step = mp.expm(matrix, method="taylor")
            slopes = [
                sp.diff(g.expression, t, i) for g in signal.generators for i in range(g.matrix.rows)
            ]
            inputs = sp.lambdify(t, slopes, "mpmath")
            for k in range(first, first + span.count, EVERY):
                pushed = [mp.re(u) for u in inputs(mp.mpf(float(motion.t[k])))]
                exact = step * mp.matrix([*map(mp.mpf, motion.start[k].tolist()), *pushed])
                errors.append([abs(float(motion.end[k, i] - exact[i])) for i in range(size)])
            first += span.count
    return np.array(errors)


@pytest.mark.parametrize(("name", "scenario"), MOTIONS)
def test_every_segment_of_a_linear_system_ends_within_its_bound(name: str, scenario: str) -> None:
    motion = motion_of(name, scenario)
    assert motion.method.startswith("matrix exponential")
    error = segment_errors(equations_of(name), scenario, motion)
    assert np.all(error <= motion.bound)
    # The bound is tight: the worst segment comes near it.
    assert np.max(error / motion.bound) > 0.1


def test_motion_through_a_break_of_its_input_stays_within_its_global_bound() -> None:
    force = 2.75 * Heaviside(t - sp.Rational(7, 3))
    system = oscillator(1.3, 0.0, 47.0, force, x=0.3, v=-0.25, duration=20.0)
    motion = solve(derive(system), system.scenarios[0])
    first, second = motion.spans
    constants = 1.3, 0.0, 47.0
    with mp.workdps(50):
        at_break = textbook(constants, "none", [0.3, -0.25], 0, second.start)
        for k in range(first.count, len(motion.t), 5):
            passed = mp.mpf(float(motion.t[k])) - mp.mpf(second.start)
            exact = textbook(constants, "step", at_break, 0, passed)
            error = [
                abs(float(a - b)) for a, b in zip(motion.start[k].tolist(), exact, strict=True)
            ]
            assert np.all(error <= motion.global_bound[k])


@pytest.mark.parametrize("name", STARTS)
def test_pendulum_stays_within_its_global_bound(name: str) -> None:
    motion = solved(*STARTS[name], duration=5.0)
    (span,) = motion.spans
    ratios = []
    with mp.workdps(25):
        w = mp.sqrt(mp.mpf(G) / L)
        for k in range(1, span.count, 12):
            exact = flow(STARTS[name], mp.mpf(float(motion.t[k])), w)
            error = np.array(
                [abs(float(a - b)) for a, b in zip(motion.start[k], exact, strict=True)]
            )
            ratios.append(np.max(error / motion.global_bound[k]))
    assert max(ratios) <= 1
    # Errors add up with their signs, not as in the worst case.
    assert max(ratios) > 0.01


def test_between_the_nodes_a_motion_stays_within_its_global_bound() -> None:
    motion = solved(*STARTS["large"], duration=5.0)
    times = np.linspace(0.01, 4.99, 23)
    bound = motion.global_bound_at(times)
    with mp.workdps(25):
        w = mp.sqrt(mp.mpf(G) / L)
        exact = [flow(STARTS["large"], mp.mpf(float(time)), w) for time in times]
    error = np.abs(motion.states_at(times) - np.array([[float(y) for y in e] for e in exact]))
    assert np.all(error <= bound)
    assert np.max(bound / motion.amplitude) < 1e-8


def test_jump_between_segments_is_in_the_global_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    """Move a start by 1e-9 of itself: each segment is right, and the whole is not."""
    whole = solve_numerically

    def moved(equations: Equations, start: Array, *given: Any) -> Motion:
        solution = whole(equations, start, *given)
        states = solution.start.copy()
        states[100] *= 1 + 1e-9
        return dataclasses.replace(solution, start=states)

    monkeypatch.setattr(physics_crosscheck.reference.solving.solve, "solve_numerically", moved)
    motion = solved(1.1, 0.0, duration=5.0)
    jump = 1e-9 * np.abs(motion.start[100])
    assert np.all(motion.global_bound[100] >= 0.99 * jump)


X = sp.Symbol("x", real=True)
FORMULAS = (
    sin(9 * t),
    sin(9 * t) - cos(sp.Rational(1, 3) * t),
    sin((4 + t / 3) * t),
    exp(-(t**2) / 3) * cos(sp.pi * t),
    (t - sp.Rational(19, 3)) ** 3 / (1 + t**2),
    sp.sqrt(2 + t) * sp.tanh(t - 1) + sp.atan(3 * t),
    sp.atan2(t, 2) ** 2,
    t ** sp.Rational(3, 10),
)


@pytest.mark.parametrize("formula", FORMULAS, ids=str)
def test_doubles_evaluate_a_formula_within_its_running_error(formula: sp.Expr) -> None:
    times = np.random.default_rng(3).uniform(0.1, 12.5, 200)
    # The true time may differ from the double by half a unit.
    rounding = EPS / 2 * times
    (bound,) = running_error([formula], {t: (times, rounding)}).T
    values = compile_function([sp.N(formula, 17)], (t,))(times[:, None])[:, 0]
    with mp.workdps(40):
        exact = sp.lambdify(t, formula, "mpmath")
        true = [
            exact(mp.mpf(float(a)) + mp.mpf(float(b))) for a, b in zip(times, rounding, strict=True)
        ]
        error = np.array(
            [abs(float(mp.mpf(float(a)) - b)) for a, b in zip(values, true, strict=True)]
        )
    assert np.all(error <= bound)
    assert np.max(error / bound) > 0.05
