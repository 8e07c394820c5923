"""Coordinates whose rates are the velocities, compared with the tree's coordinates."""

from __future__ import annotations

import numpy as np
import pytest

from physics_crosscheck.reference.dynamics.chart_equations import Charted
from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.dynamics.tree_dynamics import Dynamics
from physics_crosscheck.reference.mechanism.chart import MinimalCoordinates, coordinate_names
from physics_crosscheck.reference.mechanism.rotations import (
    LONG_DOUBLES,
    Scalars,
    angular_velocity,
    coordinate_rate,
    minimal_coordinates,
    unit_quaternion,
)
from physics_crosscheck.reference.mechanism.tree import Kind
from tests.reference.multibody.trees import KINDS, tree

TREE = tree(("free", "hinge", "ball", "slide", "free"), 3)
N = TREE.nv
H = 1e-6


@pytest.fixture(scope="module")
def state() -> tuple[Scalars, Scalars, Scalars]:
    """Draw positions, rates and forces, a batch of five."""
    y, rates, forces = np.random.default_rng(0).normal(size=(3, N, 5))
    return y, rates, forces


def test_rates_match_the_motion_of_frames(state: tuple[Scalars, Scalars, Scalars]) -> None:
    """Compare the motion of frames under the tree's velocities and under the coordinates."""
    y, rates, _ = state
    chart, recursion = MinimalCoordinates(TREE), Recursion(TREE)
    v, q = chart.velocities(y, rates), chart.positions(y)
    assert chart.rates(y, v) == pytest.approx(rates, abs=1e-13)
    for body, here in zip(TREE.links, TREE.positions, strict=True):
        if body.kind in ("ball", "free"):
            part = slice(here.stop - 4, here.stop)
            q[part] /= np.sqrt((q[part] ** 2).sum(axis=0))
    moved = H * recursion.rates(q, v)
    by_tree = zip(recursion.placements(q + moved), recursion.placements(q - moved), strict=True)
    by_chart = zip(
        recursion.placements(chart.positions(y + H * rates)),
        recursion.placements(chart.positions(y - H * rates)),
        strict=True,
    )
    for (after, before), (later, earlier) in zip(by_tree, by_chart, strict=True):
        for a, b, c, d in zip(after, before, later, earlier, strict=True):
            assert (a - b) / (2 * H) == pytest.approx((c - d) / (2 * H), abs=1e-8)


def test_accelerations_are_derivatives_of_velocities(
    state: tuple[Scalars, Scalars, Scalars],
) -> None:
    y, rates, forces = state
    chart, charted = MinimalCoordinates(TREE), Charted(TREE)
    second = charted.acceleration(y, rates, forces)
    after, before = (
        chart.velocities(y + h * rates + h * h * second / 2, rates + h * second) for h in (H, -H)
    )
    q, v = chart.positions(y), chart.velocities(y, rates)
    expected = Dynamics(TREE).acceleration(q, v, chart.forces(y, forces))
    assert (after - before) / (2 * H) == pytest.approx(expected, abs=1e-7)
    assert charted.forces_for(y, rates, second) == pytest.approx(forces, abs=1e-11)
    unpushed = charted.acceleration(y, rates, 0 * forces)
    assert charted.effect(y, forces) == pytest.approx(second - unpushed, abs=1e-11)
    more = Charted(TREE, LONG_DOUBLES).acceleration(*map(LONG_DOUBLES.array, state))
    assert second == pytest.approx(more.astype(float), abs=1e-11)


def test_energy_of_the_rates_equals_energy_of_the_bodies(
    state: tuple[Scalars, Scalars, Scalars],
) -> None:
    y, rates, forces = state
    chart, mass = MinimalCoordinates(TREE), Charted(TREE).mass(y)
    kinetic = Dynamics(TREE).kinetic(chart.positions(y), chart.velocities(y, rates))
    assert (rates * (mass * rates).sum(axis=1)).sum(axis=0) / 2 == pytest.approx(kinetic)
    assert mass == pytest.approx(np.swapaxes(mass, 0, 1), abs=1e-13)
    energy, supplied, _ = Charted(TREE).powers(y, rates, forces)
    potential = Dynamics(TREE).potential(chart.positions(y))
    assert energy == pytest.approx(kinetic + potential)
    # A moment about the link's axes is not conjugate to the rates; a force is.
    translational = np.zeros_like(forces)
    translational[3:6] = forces[3:6]
    supplied = Charted(TREE).powers(y, rates, translational)[1]
    assert supplied == pytest.approx((translational * rates).sum(axis=0))


def test_rotations_and_their_coordinates_are_inverse() -> None:
    rng = np.random.default_rng(1)
    p, angular = rng.normal(size=(2, 3, 40))
    q = unit_quaternion(p)
    assert np.linalg.norm(q, axis=0) == pytest.approx(1)
    assert angular_velocity(p, coordinate_rate(p, angular)) == pytest.approx(angular, abs=1e-14)
    assert minimal_coordinates(-q, q) == pytest.approx(p, abs=1e-13)
    # Beyond half a turn the nearer of both signs has a negative real part.
    far = p * (6 / np.linalg.norm(p, axis=0, keepdims=True))
    assert (unit_quaternion(far)[0] < 0).all()
    assert minimal_coordinates(-unit_quaternion(far), unit_quaternion(far)) == pytest.approx(
        far, abs=1e-12
    )


@pytest.mark.parametrize("kind", KINDS)
def test_every_velocity_has_a_name_and_a_unit(kind: Kind) -> None:
    robot = tree((kind,), 0)
    names = coordinate_names(kind, "j")
    assert len(set(names)) == robot.nv
    assert {unit for _, unit in names} <= {"rad", "m"}
