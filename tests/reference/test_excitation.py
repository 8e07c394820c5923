"""States that tell a tree's numbers apart: the slopes by which they are chosen, and the choice."""

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
    """A link's mass, mass times center, and inertia about its origin, (10,)."""
    c = link.center
    whole = link.inertia + link.mass * (c @ c * np.eye(3) - np.outer(c, c))
    products = whole[[0, 0, 1], [1, 2, 2]]
    return np.concatenate([[link.mass], link.mass * c, np.diag(whole), products])


def test_the_regressor_times_the_bodies_is_what_they_ask() -> None:
    one = tree(("hinge", "free", "ball", "slide", "hinge"), 4)
    q, v = state(one, 1, (5,))
    a = state(one, 2, (5,))[1]
    own = Recursion(one)
    numbers = np.concatenate([about_origin(link) for link in one.links])
    found = np.einsum("npk,p->nk", own.regressor(q, v, a), numbers)
    assert np.allclose(found, own.bias(q, v, a), atol=1e-11)


def heavier(one: Tree, at: int, share: float) -> Tree:
    """A link of another mass, about the same center and with the same inertia about it."""
    link = one.links[at]
    return with_link(one, at, replace(link, mass=link.mass + share))


def with_link(one: Tree, at: int, link: TreeLink) -> Tree:
    return replace(one, links=(*one.links[:at], link, *one.links[at + 1 :]))


@pytest.mark.parametrize("kinds", KINDS)
def test_slopes_are_what_a_changed_tree_does_to_accelerations(kinds: tuple[Kind, ...]) -> None:
    one = tree(kinds, 5)
    if len(kinds) == 4:
        one = replace(one, couplings=(TreeCoupling(follower=3, leader=0, multiplier=-0.7),))
    random, n, at, by = np.random.default_rng(3), one.dof, len(kinds) - 2, 1e-6
    x, rate, forces = random.normal(size=(3, n, 6))
    own = Charted(one)
    second = own.acceleration(x, rate, forces)
    slopes = own.slopes(x, rate, second)
    ends = [heavier(one, at, way * by) for way in (1, -1)]
    up, down = (Charted(end).acceleration(x, rate, forces) for end in ends)
    change = (about_origin(ends[0].links[at]) - about_origin(ends[1].links[at])) / (2 * by)
    expected = -np.einsum("npk,p->nk", slopes[:, 10 * at : 10 * at + 10], change)
    assert np.allclose((up - down) / (2 * by), expected, atol=1e-6 * np.abs(expected).max())

    link, there = one.links[0], one.velocities[0]
    other = with_link(one, 0, replace(link, damping=link.damping + by))
    moved = (Charted(other).acceleration(x, rate, forces) - second) / by
    first = 10 * len(one.links)
    damped = -slopes[:, first + there.start : first + there.stop].sum(axis=1)
    assert np.allclose(moved, damped, atol=1e-4 * np.abs(damped).max() + 1e-9)


def test_the_one_state_that_shows_a_number_is_taken_at_once() -> None:
    rows = np.zeros((50, 2, 3))
    rows[:, 0, 0] = rows[:, 1, 1] = np.linspace(1, 2, 50)
    rows[17, 0, 2] = 1e-3
    assert 17 in select_d_optimal(rows, 2)
    assert sorted(select_d_optimal(rows, 50)) == list(range(50))


def test_the_choice_does_not_depend_on_what_the_numbers_are_told_in() -> None:
    random = np.random.default_rng(2)
    rows = random.normal(size=(60, 3, 8)) * random.uniform(0.1, 3, size=(60, 1, 1))
    mixed = rows @ random.normal(size=(8, 8)) * 10.0 ** random.integers(-9, 9, size=8)
    twice = np.concatenate([rows, rows[..., :2], 0 * rows[..., :1]], axis=2)
    assert select_d_optimal(rows, 12) == select_d_optimal(mixed, 12) == select_d_optimal(twice, 12)


def test_chosen_states_say_more_than_as_many_at_random() -> None:
    random = np.random.default_rng(4)
    rows = random.normal(size=(200, 2, 30)) * random.uniform(0, 1, size=(200, 1, 30)) ** 3

    def condition(states: list[int]) -> float:
        return float(np.linalg.cond(rows[states].reshape(-1, 30)))

    assert condition(select_d_optimal(rows, 24)) < condition(list(range(24))) / 2
