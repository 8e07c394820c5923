"""Soft constraints against closed forms of one contact, and the bound of a solver's error."""

from __future__ import annotations

import numpy as np
import pytest

from physics_crosscheck.reference.laws.constraints import mix_surfaces
from physics_crosscheck.reference.laws.soft import Kind, Part, Rows, gains, impedance
from physics_crosscheck.reference.mechanism.laws import Softness
from tests.laws.ball import GRAVITY, SLIDES, ball, on_plane, surface

T, Z, D = 0.03, 0.7, 0.9
FLAT = Softness(reference=(T, Z), impedance=(D, D, 0.001, 0.5, 2.0))


def test_pressed_ball_is_a_damped_spring() -> None:
    """Catch wrong stiffness, damping or share of the weight in the normal direction.

    Of an inverse weight 1/m: z'' = -(1 - d) g - 2/T z' - z/(T Z)^2 with z = -depth.
    """
    for depth, speed in ((1e-3, 0.0), (5e-4, -0.2), (2e-3, -0.05)):
        _, a = on_plane(ball(FLAT), depth, [0, 0, 0, 0, 0, speed])
        expected = -(1 - D) * GRAVITY - 2 / T * speed + depth / (T * Z) ** 2
        assert a[5] == pytest.approx(expected, rel=1e-12)


def test_ball_rests_at_its_depth_and_not_elsewhere() -> None:
    """Catch an impedance that does not scale the weight: rest depth (1 - d) g T^2 Z^2."""
    depth = (1 - D) * GRAVITY * T**2 * Z**2
    for model in (ball(FLAT), ball(FLAT, elliptic=False)):
        _, a = on_plane(model, depth, np.zeros(6))
        share = 1.0 if model.laws.elliptic else 0.0
        assert abs(a[5]) * share < 1e-12


def test_direct_numbers_equal_a_time_constant_and_a_damping_ratio() -> None:
    """Catch a format of solref that is read as the other one."""
    full = 0.95
    standard = gains((T, Z), full, 0.002, safe=True)
    direct = gains((-1 / (T * Z) ** 2, -2 / T), full, 0.002, safe=True)
    assert direct == pytest.approx(standard, rel=1e-14)
    assert gains((1e-6, 1.0), full, 0.002, safe=True) == gains((0.004, 1.0), full, 0.002, safe=True)
    assert gains((1e-6, 1.0), full, 0.002, safe=False)[1] == pytest.approx(2 / full / 1e-6)
    assert gains((-1.0, 1.0), full, 0.002, safe=True) == gains((0.02, 1.0), full, 0.002, safe=True)


def test_body_that_sticks_creeps_down_an_incline() -> None:
    """Catch a wrong softness of friction: creep (1 - d) g sin(th) T / (2 impratio)."""
    tilt = 0.2
    depth = (1 - D) * GRAVITY * np.cos(tilt) * T**2 * Z**2
    for ratio in (1.0, 10.0):
        model = ball(FLAT, tilt, SLIDES, friction_ratio=ratio)
        creep = (1 - D) * GRAVITY * np.sin(tilt) * T / (2 * ratio)
        _, a = on_plane(model, depth, [creep, 0.0, 0.0])
        assert np.max(np.abs(a)) < 1e-12


def test_impedance_rises_from_one_end_to_the_other() -> None:
    """Catch a curve that is not continuous or leaves its ends."""
    soft = Softness(reference=(0.02, 1.0), impedance=(0.2, 0.8, 0.01, 0.3, 3.0))
    values = [impedance(soft, x)[0] for x in np.linspace(0, 0.012, 500)]
    assert values[0] == 0.2
    assert values[-1] == 0.8
    assert np.all(np.diff(values) >= 0)
    assert max(np.diff(values)) < 0.01
    assert impedance(soft, -0.003)[0] == pytest.approx(0.2 + 0.6 * 0.3, rel=1e-12)


def test_two_surfaces_mix_by_maximum_weight_and_priority() -> None:
    """Catch friction by product or mean, and a mix that ignores weights or priority."""
    other = Softness(reference=(0.01, 1.5), impedance=(0.5, 0.6, 0.002, 0.5, 2.0))
    first = surface(0, FLAT, friction=(0.9, 0.01, 0.1), mix=3.0, margin=0.001)
    second = surface(1, other, friction=(0.4, 0.02, 0.0), dimension=6, margin=0.002)
    both = mix_surfaces(first, second)
    assert both.friction == (0.9, 0.9, 0.02, 0.1, 0.1)
    assert both.dimension == 6
    assert both.margin == pytest.approx(0.003)
    assert both.softness.reference == pytest.approx((0.75 * T + 0.25 * 0.01, 0.75 * Z + 0.375))
    mixed = mix_surfaces(first, surface(1, other, friction=(0.4, 0.02, 0.0), priority=1))
    assert mixed.friction == (0.4, 0.4, 0.02, 0.0, 0.0)
    assert mixed.softness == other


def test_gradient_bounds_the_error_of_any_answer() -> None:
    """Catch a cost that is not convex in M, or a solution that is not its minimizer."""
    rng = np.random.default_rng(3)
    for elliptic in (True, False):
        model = ball(FLAT, 0.3, elliptic=elliptic)
        for _ in range(20):
            law, best = on_plane(model, 1e-3, rng.normal(size=6))
            problem = law.problem
            size = np.sqrt(best @ problem.mass @ best)
            inverse = np.linalg.inv(problem.mass)
            for spread in (1e-6, 1e-2, 10.0):
                a = best + spread * rng.normal(size=6)
                error, gradient = a - best, problem.gradient(a)
                bound = np.sqrt(gradient @ inverse @ gradient)
                assert np.sqrt(error @ problem.mass @ error) <= bound * (1 + 1e-9)
            gradient = problem.gradient(best)
            assert np.sqrt(gradient @ inverse @ gradient) < 1e-12 * size


def test_answer_that_is_not_the_minimum_leaves_a_residual(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Catch a solution that stops early, and whose error then counts as the engine's."""
    problem = on_plane(ball(FLAT, 0.3), 1e-3, [0.1, 0.2, 0.3, 1.0, -0.5, 0.2])[0].problem
    assert not problem.residual(problem.solve(problem.free)).any()
    early = problem.free
    assert problem.residual(early) == pytest.approx(problem.gradient(early))
    assert problem.residual(early).any()


def test_known_error_of_a_solver_is_removed() -> None:
    """Catch an error that is not subtracted, or a large one that is."""
    law, a = on_plane(ball(FLAT), 1e-3, [0.1, 0, 0, 0, 0, -0.2])
    problem, momentum = law.problem, np.zeros(6)
    off = a + 1e-7 * np.arange(6)
    residual = problem.gradient(off)
    same = problem.with_residual(off, residual, momentum)
    assert np.max(np.abs(same.solve(a) - off)) < 1e-12
    assert problem.with_residual(off, 1e3 * residual, momentum) is problem


def test_dry_friction_holds_up_to_its_force() -> None:
    """Catch friction that has no limit, and friction that does not hold."""
    rows = Rows(step=0.002, safe=True, velocities=np.zeros(1))
    rows.add(Kind.FRICTION, np.ones(1), FLAT, 0.0, 0.5, bound=3.0, part=Part("dry friction"))
    mass = np.array([[2.0]])
    held = rows.problem(mass, np.array([1.0]))
    slides = rows.problem(mass, np.array([4.0]))
    assert held.solve(np.zeros(1))[0] == pytest.approx((1 - D) * 1.0, rel=1e-12)
    assert slides.solve(np.zeros(1))[0] == pytest.approx(4.0 - 3.0 / 2.0, rel=1e-12)


def test_slope_of_a_cone_is_the_derivative_of_its_force() -> None:
    """Catch a wrong curvature, with which Newton's method would stop before the minimum."""
    rng = np.random.default_rng(5)
    law, _ = on_plane(ball(FLAT), 1e-3, rng.normal(size=6))
    problem, h = law.problem, 1e-6
    for _ in range(20):
        a = 30 * rng.normal(size=6)
        slope = problem.jacobian.T @ problem.forces(a)[1] @ problem.jacobian
        moved = [
            (problem.gradient(a + h * e) - problem.gradient(a - h * e)) / (2 * h) for e in np.eye(6)
        ]
        assert np.allclose(np.array(moved).T - problem.mass, slope, rtol=1e-5, atol=1e-4)
