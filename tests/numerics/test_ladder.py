"""Extrapolation: exact weights, honest uncertainty, and the test that the exponents hold."""

import re
from collections.abc import Mapping
from fractions import Fraction
from math import prod
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.harness.numerics import ladder as ladder_module
from physics_crosscheck.harness.numerics.ladder import (
    EPSILON,
    RUNGS,
    exact_weights,
    limits,
    observed_order,
    weights,
)
from physics_crosscheck.reference.mechanism.numeric import Array

DECISIONS = Path(__file__).parents[2] / "docs" / "decisions"

ONE = np.ones(1)


def lagrange(rungs: tuple[int, ...]) -> list[Fraction]:
    """Weights of Aitken-Neville for the exponents 1, 2, 3, ..., in closed form."""
    return [prod((Fraction(n, n - m) for m in rungs if m != n), start=Fraction(1)) for n in rungs]


@pytest.mark.parametrize("count", range(2, len(RUNGS) + 1))
def test_weights_for_consecutive_exponents_are_aitken_nevilles(count: int) -> None:
    rungs = RUNGS[:count]
    assert list(exact_weights(rungs, 1, 1)) == lagrange(rungs)


@pytest.mark.parametrize(("lead", "increment"), [(1, 1), (2, 1), (2, 2), (4, 1)])
def test_weights_cancel_every_claimed_power_exactly(lead: int, increment: int) -> None:
    rungs = RUNGS[:7]
    found = exact_weights(rungs, lead, increment)
    assert sum(found) == 1
    for power in range(lead, lead + 6 * increment, increment):
        assert sum(w * Fraction(1, n**power) for w, n in zip(found, rungs, strict=True)) == 0


def test_the_weights_do_not_amplify_rounding_much() -> None:
    sizes = [float(np.sum(np.abs(weights(RUNGS[:m], (1, 1))))) for m in range(2, len(RUNGS) + 1)]
    assert max(sizes) < 60  # doubling to n = 256 would reach the thousands with steps to match


def test_the_sums_of_the_weights_that_the_rungs_are_described_by_are_theirs() -> None:
    ((eight, nine),) = re.findall(
        r"at ([\d.]+) for eight rungs, ([\d.]+) for nine", Path(ladder_module.__file__).read_text()
    )
    for count, told in ((8, eight), (9, nine)):
        assert told == f"{float(sum(map(abs, exact_weights(RUNGS[:count], 1, 1)))):.1f}"


def test_the_decision_for_the_rungs_quotes_the_sums_of_their_weights() -> None:
    text = " ".join((DECISIONS / "0002-prime-rungs.md").read_text().split())
    ((consecutive, below),) = re.findall(r"of 1 to 8 add up to (\d+) .* stay below (\d+)\.", text)
    ours, plain = (
        float(sum(map(abs, exact_weights(rungs, 1, 1)))) for rungs in (RUNGS, tuple(range(1, 9)))
    )
    assert int(below) - 1 < ours < int(below)
    assert round(plain, -2) == int(consecutive)


def ladder(
    true: float,
    series: Mapping[int, float] | Mapping[float, float],
    rungs: tuple[int, ...] = RUNGS,
    noise: float = 0.0,
    count: int = 40,
    seed: int = 1,
) -> list[Array]:
    """Raw values true + sum c_p n^-p, of `count` segments, with rounding."""
    rng = np.random.default_rng(seed)
    coefficients = {p: c * rng.normal(1.0, 0.3, (count, 1)) for p, c in series.items()}
    return [
        true
        + sum(c * float(n) ** -p for p, c in coefficients.items())
        + noise * np.sqrt(n) * rng.standard_normal((count, 1))
        for n in rungs
    ]


def test_a_power_series_is_extrapolated_to_its_limit_within_the_uncertainty() -> None:
    series = {p: 0.3**p / p for p in range(1, 14)}
    values = ladder(0.7, series, noise=0.3 * EPSILON)
    found = limits(values, RUNGS, (1, 1), ONE, ONE)
    error = np.abs(found.value - 0.7)
    assert found.order_confirmed
    assert found.converges
    assert np.all(error <= found.uncertainty)
    assert np.max(found.uncertainty) < 1e-11
    assert found.order == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize("power", [0.5, 1.5, 2.5])
def test_a_term_between_the_exponents_is_not_hidden(power: float) -> None:
    # h^1.5, as a switch inside a step leaves it: no weight cancels it.
    values = ladder(0.7, {1: 0.1, power: 1e-3}, noise=0.3 * EPSILON)
    found = limits(values, RUNGS, (1, 1), ONE, ONE)
    error = np.abs(found.value - 0.7)
    assert np.max(error) > 1e-9
    assert np.all(error <= found.uncertainty)


@pytest.mark.parametrize(("actual", "claimed", "confirmed"), [
    (1, 1, True), (2, 2, True), (4, 4, True), (2, 1, False), (1, 2, False), (4, 1, False),
    (1, 4, False),
])  # fmt: skip
def test_a_wrong_claim_of_the_order_is_seen(actual: int, claimed: int, confirmed: bool) -> None:
    series = {actual: 1e-2, actual + 1: 1e-2}
    values = ladder(0.7, series, rungs=RUNGS[:7], noise=0.3 * EPSILON)
    found = limits(values, RUNGS[:7], (claimed, 1), ONE, ONE)
    assert found.order_confirmed is confirmed


def test_rungs_that_differ_by_rounding_alone_have_no_order() -> None:
    values = ladder(0.7, {1: 1e-16}, noise=EPSILON)
    order, confirmed = observed_order(np.stack(values), RUNGS, 1, 1.0)
    assert np.isnan(order)
    assert confirmed


def test_a_ladder_that_wanders_does_not_converge() -> None:
    rng = np.random.default_rng(0)
    values = [0.7 + rng.standard_normal((40, 1)) for _ in RUNGS]
    found = limits(values, RUNGS, (1, 1), ONE, ONE)
    assert not (found.converges and found.order_confirmed)


def test_one_segment_that_agrees_by_chance_takes_its_neighbours_uncertainty() -> None:
    series = {p: 0.4**p for p in range(1, 10)}
    values = ladder(0.7, series, rungs=RUNGS[:6])
    for value in values:
        value[20] = values[-1][20]  # all rungs equal there, by chance
    found = limits(values, RUNGS[:6], (1, 1), ONE, ONE)
    assert found.uncertainty[20] >= np.min(found.uncertainty[18:23]) > 1e-10


@pytest.mark.parametrize("component", [0, 1])
def test_the_rounding_seen_counts_where_it_is_more_than_doubles_alone_make(component: int) -> None:
    # Short enough a series that every limit is known to rounding.
    values = [np.hstack([v, v]) for v in ladder(0.7, {1: 1e-9}, noise=0.3 * EPSILON)]
    ones = np.ones(2)
    plain = limits(values, RUNGS, (1, 1), ones, ones)
    little = [0.9 * EPSILON * np.sqrt(n) * ones for n in RUNGS]
    assert np.array_equal(
        limits(values, RUNGS, (1, 1), ones, ones, little).uncertainty, plain.uncertainty
    )
    much = [np.where(np.arange(2) == component, 1e-12 * n, 0.0) for n in RUNGS]
    found = limits(values, RUNGS, (1, 1), ones, ones, much)
    used = np.abs(weights(found.rungs, (1, 1)))
    added = 3e-12 * float(np.sum(used * found.rungs))
    assert np.all(found.uncertainty[:, component] >= added)
    assert np.all(found.uncertainty[:, component] < 1.1 * added)
    assert np.all(found.uncertainty[:, 1 - component] < 1e-12)
