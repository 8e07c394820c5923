"""Extrapolation: exact weights, reliable uncertainty, and the test of the order."""

import re
from collections.abc import Mapping
from fractions import Fraction
from math import prod
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.harness.numerics import ladder as ladder_module
from physics_crosscheck.harness.numerics.ladder import (
    RUNGS,
    exact_weights,
    limits,
    observed_order,
    weights,
)
from physics_crosscheck.reference.mechanism.numeric import Array

EPSILON = float(np.finfo(float).eps)

DECISIONS = Path(__file__).parents[2] / "docs" / "decisions"

UNIT = np.ones(1)


def lagrange(rungs: tuple[int, ...]) -> list[Fraction]:
    """Return Aitken-Neville weights for the exponents 1, 2, 3, ... in closed form."""
    return [prod((Fraction(n, n - m) for m in rungs if m != n), start=Fraction(1)) for n in rungs]


@pytest.mark.parametrize("count", range(2, len(RUNGS) + 1))
def test_weights_for_consecutive_exponents_are_aitken_nevilles(count: int) -> None:
    rungs = RUNGS[:count]
    assert list(exact_weights(rungs, 1, 1)) == lagrange(rungs)


@pytest.mark.parametrize(("lead", "increment"), [(1, 1), (2, 1), (2, 2), (4, 1)])
def test_weights_cancel_every_claimed_power_exactly(lead: int, increment: int) -> None:
    rungs = RUNGS[:7]
    exact = exact_weights(rungs, lead, increment)
    assert sum(exact) == 1
    for power in range(lead, lead + 6 * increment, increment):
        assert sum(w * Fraction(1, n**power) for w, n in zip(exact, rungs, strict=True)) == 0


def test_weights_do_not_amplify_rounding_much() -> None:
    sizes = [float(np.sum(np.abs(weights(RUNGS[:m], (1, 1))))) for m in range(2, len(RUNGS) + 1)]
    assert max(sizes) < 60  # doubling to n = 256 would reach the thousands with steps to match


def test_comment_quotes_the_sums_of_the_weights() -> None:
    ((eight, nine),) = re.findall(
        r"at ([\d.]+) for eight rungs, ([\d.]+) for nine", Path(ladder_module.__file__).read_text()
    )
    for count, described in ((8, eight), (9, nine)):
        assert described == f"{float(sum(map(abs, exact_weights(RUNGS[:count], 1, 1)))):.1f}"


def test_decision_for_the_rungs_quotes_the_sums_of_their_weights() -> None:
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
    """Return raw values true + sum c_p n^-p of `count` segments, with rounding."""
    rng = np.random.default_rng(seed)
    coefficients = {p: c * rng.normal(1.0, 0.3, (count, 1)) for p, c in series.items()}
    return [
        true
        + sum(c * float(n) ** -p for p, c in coefficients.items())
        + noise * np.sqrt(n) * rng.standard_normal((count, 1))
        for n in rungs
    ]


def test_power_series_is_extrapolated_to_its_limit_within_the_uncertainty() -> None:
    series = {p: 0.3**p / p for p in range(1, 14)}
    values = ladder(0.7, series, noise=0.3 * EPSILON)
    result = limits(values, RUNGS, (1, 1), UNIT, UNIT)
    error = np.abs(result.value - 0.7)
    assert result.order_confirmed
    assert result.converges
    assert np.all(error <= result.uncertainty)
    assert np.max(result.uncertainty) < 1e-11
    assert result.order == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize("power", [0.5, 1.5, 2.5])
def test_term_between_the_exponents_is_not_hidden(power: float) -> None:
    # h^1.5, as a switch inside a step leaves it: no weight cancels it.
    values = ladder(0.7, {1: 0.1, power: 1e-3}, noise=0.3 * EPSILON)
    result = limits(values, RUNGS, (1, 1), UNIT, UNIT)
    error = np.abs(result.value - 0.7)
    assert np.max(error) > 1e-9
    assert np.all(error <= result.uncertainty)


@pytest.mark.parametrize(("actual", "claimed", "confirmed"), [
    (1, 1, True), (2, 2, True), (4, 4, True), (2, 1, False), (1, 2, False), (4, 1, False),
    (1, 4, False),
])  # fmt: skip
def test_wrong_claim_of_the_order_is_seen(actual: int, claimed: int, confirmed: bool) -> None:
    series = {actual: 1e-2, actual + 1: 1e-2}
    values = ladder(0.7, series, rungs=RUNGS[:7], noise=0.3 * EPSILON)
    result = limits(values, RUNGS[:7], (claimed, 1), UNIT, UNIT)
    assert result.order_confirmed is confirmed


def test_rungs_that_differ_by_rounding_alone_have_no_order() -> None:
    values = ladder(0.7, {1: 1e-16}, noise=EPSILON)
    order, confirmed = observed_order(np.stack(values), RUNGS, 1, 1.0)
    assert np.isnan(order)
    assert confirmed


def test_ladder_that_wanders_does_not_converge() -> None:
    rng = np.random.default_rng(0)
    values = [0.7 + rng.standard_normal((40, 1)) for _ in RUNGS]
    result = limits(values, RUNGS, (1, 1), UNIT, UNIT)
    assert not (result.converges and result.order_confirmed)


def test_chance_agreement_takes_its_neighbours_uncertainty() -> None:
    series = {p: 0.4**p for p in range(1, 10)}
    values = ladder(0.7, series, rungs=RUNGS[:6])
    for value in values:
        value[20] = values[-1][20]  # all rungs equal there, by chance
    result = limits(values, RUNGS[:6], (1, 1), UNIT, UNIT)
    assert result.uncertainty[20] >= np.min(result.uncertainty[18:23]) > 1e-10


@pytest.mark.parametrize("component", [0, 1])
def test_observed_rounding_counts_above_double_rounding(component: int) -> None:
    # The series is so short that rounding limits every extrapolation.
    values = [np.hstack([v, v]) for v in ladder(0.7, {1: 1e-9}, noise=0.3 * EPSILON)]
    ones = np.ones(2)
    plain = limits(values, RUNGS, (1, 1), ones, ones)
    little = [0.9 * EPSILON * np.sqrt(n) * ones for n in RUNGS]
    assert np.array_equal(
        limits(values, RUNGS, (1, 1), ones, ones, little).uncertainty, plain.uncertainty
    )
    much = [np.where(np.arange(2) == component, 1e-12 * n, 0.0) for n in RUNGS]
    result = limits(values, RUNGS, (1, 1), ones, ones, much)
    used = np.abs(weights(result.rungs, (1, 1)))
    added = 3e-12 * float(np.sum(used * result.rungs))
    assert np.all(result.uncertainty[:, component] >= added)
    assert np.all(result.uncertainty[:, component] < 1.1 * added)
    assert np.all(result.uncertainty[:, 1 - component] < 1e-12)
