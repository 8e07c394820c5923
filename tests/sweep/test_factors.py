from __future__ import annotations

import pytest

from physics_crosscheck.harness.extras.sweep.draws import Design, draws
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
