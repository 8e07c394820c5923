"""Coupled joints, compared with the whole tree under constraint forces."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from physics_crosscheck.reference.dynamics.chart_equations import Charted
from physics_crosscheck.reference.dynamics.tree_dynamics import Dynamics
from physics_crosscheck.reference.mechanism.chart import MinimalCoordinates
from physics_crosscheck.reference.mechanism.couplings import Coupled
from physics_crosscheck.reference.mechanism.rotations import LONG_DOUBLES
from physics_crosscheck.reference.mechanism.tree import Tree, TreeCoupling, TreeError
from tests.reference.multibody.trees import tree


def gripper() -> Tree:
    """Return a floating base with a chain of two coupled joints and a fixed joint."""
    robot = tree(("free", "hinge", "slide", "hinge", "slide"), 5)
    return dataclasses.replace(
        robot,
        couplings=(
            TreeCoupling(follower=4, leader=3, multiplier=-0.7, offset=0.1),
            TreeCoupling(follower=3, leader=1, multiplier=2.0, offset=-0.3),
            TreeCoupling(follower=2, leader=None, offset=0.25),
        ),
    )


def test_follower_positions_follow_the_leader() -> None:
    coupled = Coupled(gripper())
    assert coupled.kept == [0, 1, 2, 3, 4, 5, 6]
    x = np.arange(7.0)
    y = coupled.positions(x)
    assert y[:7] == pytest.approx(x)
    assert y[7] == pytest.approx(0.25)
    assert y[8] == pytest.approx(2 * 6 - 0.3)
    assert y[9] == pytest.approx(-0.7 * (2 * 6 - 0.3) + 0.1)


def test_accelerations_match_the_constrained_tree() -> None:
    """Solve the equations with multipliers (KKT) directly."""
    held = gripper()
    whole = dataclasses.replace(held, couplings=())
    coupled, chart, dynamics = Coupled(held), MinimalCoordinates(held), Dynamics(whole)
    x, rate, forces = np.random.default_rng(2).normal(size=(3, 7, 4))
    y, rates = coupled.positions(x), coupled.rates(rate)
    given = np.zeros_like(y)
    given[coupled.kept] = forces
    q, v = chart.positions(y), chart.velocities(y, rates)
    rows = np.zeros((3, 10))
    rows[0, [9, 8]], rows[1, [8, 6]], rows[2, 7] = (1.0, 0.7), (1.0, -2.0), 1.0
    mass, force = dynamics.mass(q), dynamics.force(q, v, chart.forces(y, given))
    for k in range(4):
        whole_matrix = np.block([[mass[:, :, k], rows.T], [rows, np.zeros((3, 3))]])
        a = np.linalg.solve(whole_matrix, [*force[:, k], 0, 0, 0])[:10]
        expected = chart.second_derivatives(y[:, k : k + 1], v[:, k : k + 1], a[:, None])[:7, 0]
        actual = Charted(held).acceleration(x[:, k], rate[:, k], forces[:, k])
        assert actual == pytest.approx(expected, rel=1e-10, abs=1e-10)
    batch = Charted(held).acceleration(x, rate, forces)
    assert Charted(held).forces_for(x, rate, batch) == pytest.approx(forces, abs=1e-10)
    long = Charted(held, LONG_DOUBLES).acceleration(*map(LONG_DOUBLES.array, (x, rate, forces)))
    assert batch == pytest.approx(long.astype(float), abs=1e-10)
    unpushed = Charted(held).acceleration(x, rate, 0 * forces)
    assert Charted(held).effect(x, forces) == pytest.approx(batch - unpushed, abs=1e-10)


def test_energy_matches_the_whole_tree() -> None:
    held = gripper()
    x, rate = np.random.default_rng(3).normal(size=(2, 7, 4))
    mass = Charted(held).mass(x)
    kinetic = (rate * (mass * rate).sum(axis=1)).sum(axis=0) / 2
    coupled, chart = Coupled(held), MinimalCoordinates(held)
    y = coupled.positions(x)
    v = chart.velocities(y, coupled.rates(rate))
    assert kinetic == pytest.approx(Dynamics(held).kinetic(chart.positions(y), v))


def test_joint_with_several_leaders() -> None:
    robot = tree(("hinge", "slide", "hinge", "slide"), 5)
    ends = (
        TreeCoupling(follower=1, leader=0, multiplier=2.0, others=((3, -0.5),), offset=0.1),
        TreeCoupling(follower=2, leader=1, multiplier=3.0, others=((0, 1.0),)),
    )
    coupled = Coupled(dataclasses.replace(robot, couplings=ends))
    y = coupled.positions(np.array([0.7, -0.4]))
    followed = 2 * 0.7 + 0.5 * 0.4 + 0.1
    assert y == pytest.approx([0.7, followed, 3 * followed + 0.7, -0.4])


def test_cycle_of_couplings_is_rejected() -> None:
    robot = tree(("hinge", "hinge"), 0)
    ends = (TreeCoupling(follower=0, leader=1), TreeCoupling(follower=1, leader=0))
    with pytest.raises(TreeError, match="j0, j1 follow each other in a cycle"):
        Coupled(dataclasses.replace(robot, couplings=ends))


def test_coupled_ball_joint_is_rejected() -> None:
    robot = tree(("ball", "hinge"), 0)
    with pytest.raises(TreeError, match="j0 is coupled, but neither a hinge"):
        dataclasses.replace(robot, couplings=(TreeCoupling(follower=1, leader=0),))
