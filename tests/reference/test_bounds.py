"""Error bounds of a motion, against solutions with 50 digits."""

import dataclasses
from functools import cache
from typing import Any

import mpmath as mp
import numpy as np
import pytest
import sympy as sp
from sympy import Heaviside, cos, exp, sin

import physics_crosscheck.reference.solving.bounds
import physics_crosscheck.reference.solving.solve
from physics_crosscheck import t
from physics_crosscheck.reference.dynamics.derive import Equations, derive, running_error
from physics_crosscheck.reference.dynamics.linearize import linearize
from physics_crosscheck.reference.mechanism.numeric import Array, compile_function
from physics_crosscheck.reference.mechanism.signal import pieces
from physics_crosscheck.reference.solving.integrate import solve_numerically
from physics_crosscheck.reference.solving.segments import Motion
from physics_crosscheck.reference.solving.solve import augmented, solve
from tests.reference.mechanisms import EPS, LINEAR, SCENARIOS, equations_of, motion_of, oscillator
from tests.reference.test_closed_form import FREQUENCY, textbook
from tests.reference.test_pendulum import STARTS, G, L, flow, solved

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


DRAWS = range(10)


@cache
def drawn(seed: int) -> tuple[tuple[float, float, float], Motion]:
    rng = np.random.default_rng(seed)
    constants = 0.5 + rng.random(), 2 * rng.random() ** 2, 10 ** (3 * rng.random())
    force = sp.Rational(2.75) * sin(sp.Rational(FREQUENCY) * t)
    x, v = rng.normal(size=2)
    system = oscillator(*constants, force, x=float(x), v=float(v), duration=6 + 30 * rng.random())
    return constants, solve(derive(system), system.scenarios[0])


@pytest.mark.parametrize("seed", DRAWS)
def test_random_oscillators_stay_within_their_bounds(seed: int) -> None:
    constants, motion = drawn(seed)
    (span,) = motion.spans
    worst = []
    with mp.workdps(50):
        for k in range(0, span.count, 23):
            start, time = motion.start[k].tolist(), float(motion.t[k])
            end = textbook(constants, "harmonic", start, time, span.length)
            error = [abs(float(a - b)) for a, b in zip(motion.end[k].tolist(), end, strict=True)]
            worst.append(np.max(error / motion.bound))
            exact = textbook(constants, "harmonic", motion.start[0].tolist(), 0, time)
            drift = [abs(float(a - b)) for a, b in zip(start, exact, strict=True)]
            # The formulas are accurate to 50 digits.
            assert np.all(np.array(drift) <= motion.global_bound[k] + 1e-40)
    assert max(worst) <= 1
    assert max(worst) > 0.05


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
