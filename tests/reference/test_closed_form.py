"""The closed form against the textbook's formulas, in every damping regime, under every input.

The formulas (Meirovitch, Fundamentals of Vibrations, chapters 2 and 3) are evaluated by mpmath
with 50 digits, from the constants as the doubles that they are: they are exact here.
"""

import dataclasses
from collections.abc import Sequence
from functools import cache
from typing import TypeAlias

import mpmath as mp
import numpy as np
import pytest
import sympy as sp
from sympy import exp, sin

from physics_crosscheck import Equilibrium, Scenario, t
from physics_crosscheck.reference.dynamics.derive import Equations, derive
from physics_crosscheck.reference.dynamics.linearize import linearize
from physics_crosscheck.reference.mechanism.signal import pieces
from physics_crosscheck.reference.solving.segments import Motion
from physics_crosscheck.reference.solving.solve import solve, state_at
from tests.reference.mechanisms import EPS, oscillator

REGIMES = {  # m, c, k: dyadic where a regime is a matter of equality
    "undamped": (1.3, 0.0, 47.0),
    "lightly damped": (1.3, 0.9, 47.0),
    "barely underdamped": (1.0, 4.0 * (1 - 2.0**-40), 4.0),
    "critical": (1.0, 4.0, 4.0),
    "barely overdamped": (1.0, 4.0 * (1 + 2.0**-40), 4.0),
    "overdamped": (0.7, 9.0, 5.0),
    "very overdamped": (0.5, 40.0, 3.0),
    "negatively damped": (1.3, -0.35, 47.0),
    "without stiffness": (1.3, 0.9, 0.0),
    "free": (1.3, 0.0, 0.0),
    "unstable": (1.3, 0.4, -2.0),
}
AMOUNT, RATE, FREQUENCY = 2.75, 0.3, 4.4  # of the forces, newtons and 1/s
FORCES = {
    "none": sp.Integer(0),
    "step": sp.Rational(AMOUNT),
    "ramp": sp.Rational(AMOUNT) * t,
    "exponential": sp.Rational(AMOUNT) * exp(-sp.Rational(RATE) * t),
    "harmonic": sp.Rational(AMOUNT) * sin(sp.Rational(FREQUENCY) * t),
}
Pair: TypeAlias = tuple[mp.mpf, mp.mpf]
"""Position and speed."""

EVERY = [(regime, force) for regime in REGIMES for force in FORCES]
SOLVED = [(regime, [*FORCES][i % len(FORCES)]) for i, regime in enumerate(REGIMES)]
"""Each regime and each force in a motion: their pairs differ in the closed form alone."""


def free(m: mp.mpf, c: mp.mpf, k: mp.mpf, x: mp.mpf, v: mp.mpf, time: mp.mpf) -> Pair:
    """Return position and speed of m x'' + c x' + k x = 0, by the formula of its regime."""
    half, squared = c / (2 * m), k / m
    inside = squared - half**2
    decay = mp.exp(-half * time)
    if inside == 0:
        slope = v + half * x
        return decay * (x + slope * time), decay * (v - half * slope * time)
    w = mp.sqrt(abs(inside))
    co, si = (mp.cos, mp.sin) if inside > 0 else (mp.cosh, mp.sinh)
    a, b = co(w * time), si(w * time) / w
    return decay * (x * a + (v + half * x) * b), decay * (v * a - (half * v + squared * x) * b)


def particular(m: mp.mpf, c: mp.mpf, k: mp.mpf, force: str, time: mp.mpf) -> Pair:
    """Return a position and speed that satisfy the equation under the force, whatever the start."""
    f, a, w = mp.mpf(AMOUNT), mp.mpf(RATE), mp.mpf(FREQUENCY)
    if force == "none":
        return mp.mpf(0), mp.mpf(0)
    if force == "exponential":
        x = f * mp.exp(-a * time) / (m * a**2 - c * a + k)
        return x, -a * x
    if force == "harmonic":
        z = f * mp.exp(mp.mpc(0, w * time)) / mp.mpc(k - m * w**2, c * w)
        return mp.im(z), mp.im(mp.mpc(0, w) * z)
    if force == "step":
        if k:
            return f / k, mp.mpf(0)
        return (f * time / c, f / c) if c else (f * time**2 / (2 * m), f * time / m)
    if k:
        return f * (time / k - c / k**2), f / k
    if c:
        return f * (time**2 / (2 * c) - m * time / c**2), f * (time / c - m / c**2)
    return f * time**3 / (6 * m), f * time**2 / (2 * m)


def textbook(
    constants: Sequence[float], force: str, start: Sequence[float], begin: float, time: float
) -> list[mp.mpf]:
    """Return the state `time` after `begin`, where it is `start`."""
    m, c, k = map(mp.mpf, constants)
    at_begin = particular(m, c, k, force, mp.mpf(begin))
    x, v = (mp.mpf(y) - p for y, p in zip(start, at_begin, strict=True))
    moved = free(m, c, k, x, v, mp.mpf(time))
    later = particular(m, c, k, force, mp.mpf(begin) + mp.mpf(time))
    return [a + b for a, b in zip(moved, later, strict=True)]


@cache
def derived(regime: str, force: str) -> tuple[Equations, Scenario]:
    system = oscillator(*REGIMES[regime], FORCES[force], x=0.3, v=-0.25, duration=6.0)
    return derive(system), system.scenarios[0]


@cache
def solved(regime: str, force: str) -> Motion:
    return solve(*derived(regime, force))


@pytest.mark.parametrize(("regime", "force"), EVERY)
def test_closed_form_matches_the_textbook_to_30_digits(regime: str, force: str) -> None:
    equations, scenario = derived(regime, force)
    linearization = linearize(equations, equations.system.equilibria[0])
    (signal,) = pieces(equations.system, scenario)
    with mp.workdps(60):
        ours = state_at(linearization, [0.3, -0.25], signal, 5.3)
        exact = textbook(REGIMES[regime], force, [0.3, -0.25], 0, 5.3)
        size = max(abs(y) for y in exact)
        # 40 digits, minus the loss in the exponential of a matrix of norm |A| t = 430.
        assert max(abs(a - b) for a, b in zip(ours, exact, strict=True)) < size * 1e-30


@pytest.mark.parametrize(("regime", "force"), SOLVED)
def test_segment_ends_match_the_textbook(regime: str, force: str) -> None:
    motion = solved(regime, force)
    assert motion.method.startswith("matrix exponential")
    (span,) = motion.spans
    size = motion.amplitude
    with mp.workdps(50):
        length = mp.mpf(span.length)
        for i in range(0, span.count, 13):
            exact = textbook(REGIMES[regime], force, motion.start[i], length * i, length)
            gap = [abs(mp.mpf(a) - b) for a, b in zip(motion.end[i], exact, strict=True)]
            # An end is rounded once: half a unit in the last place, of up to twice the amplitude.
            assert all(g <= EPS * a for g, a in zip(gap, size, strict=True))


@pytest.mark.parametrize(("regime", "force"), SOLVED)
def test_segment_starts_match_the_textbook_from_time_zero(regime: str, force: str) -> None:
    motion = solved(regime, force)
    (span,) = motion.spans
    with mp.workdps(50):
        for i in range(0, span.count, 17):
            exact = textbook(REGIMES[regime], force, [0.3, -0.25], 0, mp.mpf(span.length) * i)
            gap = [abs(mp.mpf(a) - b) for a, b in zip(motion.start[i], exact, strict=True)]
            assert all(g <= EPS * a for g, a in zip(gap, motion.amplitude, strict=True))


def test_input_without_a_generator_has_no_closed_form() -> None:
    equations = derive(oscillator(1.3, 0.9, 47.0, sin(t**2)))
    linearization = linearize(equations, equations.system.equilibria[0])
    (signal,) = pieces(equations.system, equations.system.scenarios[0])
    with pytest.raises(ValueError, match="no linear equation generates"):
        state_at(linearization, [0, 0], signal, 1.0)


@pytest.mark.parametrize(
    "force", [sin((4 + t / 3) * t), 3 * sin(t * (t + sp.pi)), sp.sqrt(2 + t), exp(-(t**2) / 3)]
)
def test_input_without_a_generator_is_integrated_numerically(force: str) -> None:
    system = oscillator(1.3, 0.9, 47.0, force)
    motion = solve(derive(system), system.scenarios[0])
    assert motion.method.startswith("Gauss collocation")
    assert np.all(motion.bound <= 16 * EPS * motion.amplitude)


def test_linear_systems_are_distinguished_from_others() -> None:
    base = oscillator(1.3, 0.9, 47.0)
    x = base.coordinates[0]
    assert derive(base).linear
    length = dataclasses.replace(base.constants[0], name="L", unit="m")
    constants = (*base.constants, length)
    nonlinear = dataclasses.replace(base, V=base.V * (1 + x.q**2 / length**2), constants=constants)
    assert not derive(nonlinear).linear
    displaced = dataclasses.replace(
        base,
        V=base.constants[2] * (x.q - length) ** 2 / 2,
        constants=constants,
        equilibria=(Equilibrium("rest", {x: length}, False, "relaxed"),),
    )
    assert not derive(displaced).linear
    rate = dataclasses.replace(base.constants[0], name="w", unit="1/s")
    moving = dataclasses.replace(
        base, V=base.V * (1 + sin(rate * t) / 2), constants=(*base.constants, rate)
    )
    assert not derive(moving).linear
    variable = dataclasses.replace(base, T=base.T * (1 + x.q**2 / length**2), constants=constants)
    assert not derive(variable).linear
