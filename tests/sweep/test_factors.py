"""Factors of a sweep and the values that it draws."""

import numpy as np
import pytest

from physics_crosscheck.harness.extras.sweep.draws import Design, Draws, draws
from physics_crosscheck.harness.extras.sweep.factors import (
    SweepError,
    factor,
    factors,
    matching_factors,
)


def test_ranges_and_lists_are_parsed() -> None:
    assert factor("k=10:30").value(0.25) == 15.0
    assert factor("k=10:1000:log").value(0.5) == pytest.approx(100.0)
    listed = factor("k=1,2,4")
    assert [listed.value(share) for share in (0.0, 0.34, 0.99, 1.0)] == [1.0, 2.0, 4.0, 4.0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("k", "write NAME=LOW:HIGH"),
        ("k=", "write NAME=LOW:HIGH"),
        ("k=3:2", "3 is not below 2"),
        ("k=0:2:log", "values above zero"),
        ("k=1:2:lin", "only `:log`"),
        ("k=1:2:3:4", "only `:log`"),
        ("k=a:2", "'a' is not a number"),
        ("k=1,nan", "'nan' is not a finite number"),
        ("k=1,1", "twice"),
        ("k=x1:2", "either all"),
        ("k=xx1:x2", "'x1' is not a number"),
    ],
)
def test_invalid_range_is_rejected_with_a_hint(text: str, message: str) -> None:
    with pytest.raises(SweepError, match=f"--vary {text}.*{message}"):
        factor(text)


CONSTANTS = {"link[a]@mass": 2.0, "link[b]@mass": 0.5, "link[b]@ixy": 0.0, "x": -4.0}


def test_multiples_and_patterns_use_declared_values() -> None:
    light, heavy = matching_factors(factors(["link[*]@mass=x0.5:x1.5"]), CONSTANTS)
    assert (light.name, light.low, light.high) == ("link[a]@mass", 1.0, 3.0)
    assert (heavy.name, heavy.low, heavy.high) == ("link[b]@mass", 0.25, 0.75)
    (below,) = matching_factors(factors(["x=x1:x2"]), CONSTANTS)
    assert (below.low, below.high) == (-8.0, -4.0)
    (listed,) = matching_factors(factors(["x=x1,x3"]), CONSTANTS)
    assert listed.values == (-4.0, -12.0)
    # Zero has no multiples; brackets and dots of a name are literal.
    assert [
        match.name
        for match in matching_factors(factors(["*ix*=x1:x2", "link.a.@mass=1:2"]), CONSTANTS)
    ] == []


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        (["link[b]@ixy=x1:x2"], r"link\[b\]@ixy: it is 0"),
        (["link[*]@mass=1:2", "link[a]@mass=1:2"], r"link\[a\]@mass: two options mean it"),
        (["x=x1:x2:log"], "x: it is below zero"),
    ],
)
def test_factor_that_does_not_fit_a_constant_is_rejected(texts: list[str], message: str) -> None:
    with pytest.raises(SweepError, match=f"--vary {message}"):
        matching_factors(factors(texts), CONSTANTS)


def test_constant_varied_twice_is_rejected() -> None:
    with pytest.raises(SweepError, match="k: it is varied twice"):
        factors(["k=1:2", "k=3,4"])


def test_range_without_draws_is_rejected() -> None:
    with pytest.raises(SweepError, match=r"--vary k: .*--draws N"):
        draws(factors(["m=1,2", "k=1:2"]), Design.LATIN, None, 0)


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
