"""States that distinguish a tree's numbers: slopes of accelerations, and the selection."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from physics_crosscheck.reference.dynamics.chart_equations import Charted
from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.tree import Kind, Tree, TreeCoupling, TreeLink
from physics_crosscheck.reference.solving.samples import select_d_optimal
from tests.reference.multibody.trees import state, tree

KINDS: tuple[tuple[Kind, ...], ...] = (
    ("hinge", "slide", "hinge"), ("free", "hinge"), ("ball", "slide"), ("hinge",) * 4,
)  # fmt: skip


def about_origin(link: TreeLink) -> Array:
    """Return a link's mass, mass times center, and inertia about its origin, (10,)."""
    c = link.center
    whole = link.inertia + link.mass * (c @ c * np.eye(3) - np.outer(c, c))
    products = whole[[0, 0, 1], [1, 2, 2]]
    return np.concatenate([[link.mass], link.mass * c, np.diag(whole), products])


def test_regressor_times_parameters_equals_inverse_dynamics() -> None:
    robot = tree(("hinge", "free", "ball", "slide", "hinge"), 4)
    q, v = state(robot, 1, (5,))
    a = state(robot, 2, (5,))[1]
    dynamics = Recursion(robot)
    numbers = np.concatenate([about_origin(link) for link in robot.links])
    forces = np.einsum("npk,p->nk", dynamics.regressor(q, v, a), numbers)
    assert np.allclose(forces, dynamics.bias(q, v, a), atol=1e-11)


def heavier(robot: Tree, index: int, share: float) -> Tree:
    """Add mass to a link, with the same center and the same inertia about it."""
    link = robot.links[index]
    return with_link(robot, index, replace(link, mass=link.mass + share))


def with_link(robot: Tree, index: int, link: TreeLink) -> Tree:
    return replace(robot, links=(*robot.links[:index], link, *robot.links[index + 1 :]))


@pytest.mark.parametrize("kinds", KINDS)
def test_slopes_match_finite_differences(kinds: tuple[Kind, ...]) -> None:
    robot = tree(kinds, 5)
    if len(kinds) == 4:
        robot = replace(robot, couplings=(TreeCoupling(follower=3, leader=0, multiplier=-0.7),))
    random, n, index, by = np.random.default_rng(3), robot.dof, len(kinds) - 2, 1e-6
    x, rate, forces = random.normal(size=(3, n, 6))
    dynamics = Charted(robot)
    second = dynamics.acceleration(x, rate, forces)
    slopes = dynamics.slopes(x, rate, second)
    ends = [heavier(robot, index, way * by) for way in (1, -1)]
    up, down = (Charted(end).acceleration(x, rate, forces) for end in ends)
    change = (about_origin(ends[0].links[index]) - about_origin(ends[1].links[index])) / (2 * by)
    expected = -np.einsum("npk,p->nk", slopes[:, 10 * index : 10 * index + 10], change)
    assert np.allclose((up - down) / (2 * by), expected, atol=1e-6 * np.abs(expected).max())

    link, there = robot.links[0], robot.velocities[0]
    other = with_link(robot, 0, replace(link, damping=link.damping + by))
    moved = (Charted(other).acceleration(x, rate, forces) - second) / by
    first = 10 * len(robot.links)
    damped = -slopes[:, first + there.start : first + there.stop].sum(axis=1)
    assert np.allclose(moved, damped, atol=1e-4 * np.abs(damped).max() + 1e-9)


def test_only_state_that_shows_a_number_is_selected() -> None:
    rows = np.zeros((50, 2, 3))
    rows[:, 0, 0] = rows[:, 1, 1] = np.linspace(1, 2, 50)
    rows[17, 0, 2] = 1e-3
    assert 17 in select_d_optimal(rows, 2)
    assert sorted(select_d_optimal(rows, 50)) == list(range(50))


def test_selection_does_not_depend_on_parameterization() -> None:
    random = np.random.default_rng(2)
    rows = random.normal(size=(60, 3, 8)) * random.uniform(0.1, 3, size=(60, 1, 1))
    mixed = rows @ random.normal(size=(8, 8)) * 10.0 ** random.integers(-9, 9, size=8)
    twice = np.concatenate([rows, rows[..., :2], 0 * rows[..., :1]], axis=2)
    assert select_d_optimal(rows, 12) == select_d_optimal(mixed, 12) == select_d_optimal(twice, 12)


def test_selected_states_are_better_conditioned_than_random_ones() -> None:
    random = np.random.default_rng(4)
    rows = random.normal(size=(200, 2, 30)) * random.uniform(0, 1, size=(200, 1, 30)) ** 3

    def condition(states: list[int]) -> float:
        return float(np.linalg.cond(rows[states].reshape(-1, 30)))

    assert condition(select_d_optimal(rows, 24)) < condition(list(range(24))) / 2
