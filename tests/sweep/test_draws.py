from __future__ import annotations

import numpy as np
import pytest

from physics_crosscheck.harness.extras.sweep.draws import Design, Draws, draws
from physics_crosscheck.harness.extras.sweep.factors import factors

TWO = factors(["k=10:1000:log", "m=1:3"])
DESIGNS = (Design.LATIN, Design.SOBOL, Design.RANDOM)


def draws_of(design: Design, seed: int = 7, count: int = 32) -> Draws:
    return draws(TWO, design, count, seed)


@pytest.mark.parametrize("design", DESIGNS)
def test_draw_depends_only_on_seed_and_index(design: Design) -> None:
    forward = [draws_of(design).point_at(i) for i in range(32)]
    once = draws_of(design)
    assert [once.point_at(i) for i in reversed(range(32))] == forward[::-1]
    assert draws_of(design).point_at(19) == forward[19]
    assert draws_of(design, seed=8).point_at(19) != forward[19]
    assert all(10 <= point["k"] <= 1000 and 1 <= point["m"] <= 3 for point in forward)


@pytest.mark.parametrize("design", [Design.LATIN, Design.SOBOL])
def test_each_part_of_each_range_is_drawn_once(design: Design) -> None:
    points = [draws_of(design).point_at(i) for i in range(32)]
    logarithms = np.log([point["k"] / 10 for point in points]) / np.log(100)
    masses = np.array([(point["m"] - 1) / 2 for point in points])
    for shares in (logarithms, masses):
        assert sorted(np.floor(32 * shares).astype(int)) == list(range(32))


def test_listed_values_without_draws_are_combined() -> None:
    every = draws(factors(["a=1,2", "b=3,4,5"]), Design.LATIN, None, 0)
    points = [tuple(every.point_at(i).values()) for i in range(every.count)]
    assert points == [(a, b) for a in (1, 2) for b in (3, 4, 5)]


def test_no_factors_give_one_draw() -> None:
    none = draws((), Design.SOBOL, 50, 0)
    assert (none.count, none.point_at(0)) == (1, {})
