"""Energies by forward kinematics, compared with formulas written by hand."""

from __future__ import annotations

import pytest
import sympy as sp

from physics_crosscheck import Coordinate, ground, rotation

A = Coordinate("a", "rad", "upper")
B = Coordinate("b", "rad", "lower")
X = Coordinate("x", "m", "slide")
m, l, g, J = sp.symbols("m l g J", positive=True)  # noqa: E741  # the usual names
DOWN = (0, -1, 0)


def equal(first: sp.Expr, second: sp.Expr) -> bool:
    return bool(sp.simplify(sp.expand(first - second)) == 0)


def test_hanging_rod_has_the_energies_of_the_textbook() -> None:
    centre = ground.at(0, 0, 1).hinge(A, about=DOWN).at(0, 0, -l / 2)
    assert equal(centre.kinetic(m, (J, m * l**2 / 12, J)), m * l**2 * A.v**2 / 6)
    assert equal(centre.weight(m, (0, 0, -g)), m * g * (1 - l / 2 * sp.cos(A.q)))


def test_double_pendulum_of_points_has_the_coupling_of_landau() -> None:
    elbow = ground.hinge(A, about=DOWN).at(0, 0, -l)
    point = elbow.hinge(B, about=DOWN).at(0, 0, -l)
    spin = A.v + B.v
    expected = m * l**2 / 2 * (A.v**2 + spin**2 + 2 * sp.cos(B.q) * A.v * spin)
    assert equal(point.kinetic(m, (0, 0, 0)), expected)


def test_slide_on_a_rotating_arm_has_its_velocity() -> None:
    point = ground.hinge(A, about=(0, 0, 1)).slide(X, along=(2, 0, 0), zero=l)
    assert equal(point.kinetic(m, (0, 0, 0)), m / 2 * (X.v**2 + (X.q - l) ** 2 * A.v**2))


def test_moments_are_about_the_axes_of_the_frame() -> None:
    wheel = ground.hinge(A, about=(0, 0, 1)).turned((0, 1, 0), sp.pi / 2)
    assert equal(wheel.kinetic(m, (J, 0, 0)), J * A.v**2 / 2)
    assert equal(wheel.kinetic(m, (0, 0, 0), (J, J, J)), 0)


def test_products_of_inertia_are_elements_of_the_matrix() -> None:
    body = ground.hinge(A, about=(1, 1, 0))
    spin = float(body.kinetic(0, (0, 0, 0), (1, 0, 0)).subs(A.v, 1))
    assert spin == pytest.approx(0.5, rel=1e-15)


def test_rotation_keeps_lengths_and_the_axis() -> None:
    turn = rotation((0.3, -0.4, 1.2), 0.7)
    assert max(abs(x) for x in (turn * turn.T - sp.eye(3)).evalf(30)) < 1e-22
    axis = sp.Matrix([3, -4, 12])
    assert max(abs(x) for x in (turn * axis - axis).evalf(30)) < 1e-21


def test_axis_without_length_is_refused() -> None:
    with pytest.raises(ValueError, match="has no length"):
        rotation((0, 0, 0), 1)
