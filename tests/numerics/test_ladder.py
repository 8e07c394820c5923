"""Extrapolation and its judgement: exact weights, reliable uncertainty, and outcomes."""

import re
from collections.abc import Mapping
from fractions import Fraction
from math import prod
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.harness.numerics.judgement import UnresolvedReason, excess, judge
from physics_crosscheck.harness.numerics.ladder import (
    RUNGS,
    exact_weights,
    limits,
    observed_order,
    weights,
)
from physics_crosscheck.records import Outcome
from physics_crosscheck.reference.mechanism.numeric import Array

EPSILON = float(np.finfo(float).eps)

DECISIONS = Path(__file__).parents[2] / "docs" / "decisions.md"

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


def test_decision_for_the_rungs_quotes_the_sums_of_their_weights() -> None:
    text = " ".join(DECISIONS.read_text().split())
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


def make_defects(uncertainty: float = 1e-11) -> tuple[Array, Array]:
    """Return defects below their uncertainty, of five segments and two components."""
    rng = np.random.default_rng(3)
    return 1e-12 * rng.uniform(0.1, 0.9, (5, 2)), np.full((5, 2), uncertainty)


def test_defects_below_uncertainty_and_resolution_agree() -> None:
    result = judge(*make_defects(), 1e-9, None)
    assert result.outcome is Outcome.AGREES
    assert result.unresolved_reason is None


def test_largest_discrepancy_is_reported_with_that_of_the_worst_ratio() -> None:
    defect, uncertainty = make_defects()
    defect[1, 1], uncertainty[:, 1] = 1.5e-11, 1.5e-10  # E/U is 0.1; elsewhere larger
    defect[2, 0] = 9e-12
    result = judge(defect, uncertainty, 1e-9, None)
    assert (result.segment, result.component) == (2, 0)
    assert (result.discrepancy, result.uncertainty) == (9e-12, 1e-11)
    assert (result.largest_discrepancy, result.largest_uncertainty) == (1.5e-11, 1.5e-10)


def test_unresolved_segment_does_not_hide_a_resolved_one() -> None:
    defect, uncertainty = make_defects()
    defect[3, 1], uncertainty[0] = 1e-8, np.inf
    result = judge(defect, uncertainty, 1e-9, None)
    assert result.outcome is Outcome.DIFFERS
    assert (result.segment, result.component) == (3, 1)
    assert (result.discrepancy, result.uncertainty) == (1e-8, 1e-11)
    assert (result.largest_discrepancy, result.largest_uncertainty) == (1e-8, np.inf)


@pytest.mark.parametrize(
    ("worst", "why"), [(1e-7, UnresolvedReason.COARSE), (np.inf, UnresolvedReason.DIVERGES_HERE)]
)
def test_uncertainty_above_the_resolution_is_unresolved(
    worst: float, why: UnresolvedReason
) -> None:
    defect, uncertainty = make_defects()
    uncertainty[4, 1] = worst
    result = judge(defect, uncertainty, 1e-9, None)
    assert result.outcome is Outcome.UNRESOLVED
    assert result.unresolved_reason is why
    assert (result.segment, result.component) == (4, 1)
    assert result.uncertainty == result.largest_uncertainty == worst


def test_unresolved_reason_makes_the_uncertainty_infinite() -> None:
    defect, uncertainty = make_defects()
    defect[0, 0], defect[1, 1] = np.nan, 1e-3
    result = judge(defect, uncertainty, 1e-9, UnresolvedReason.WRONG_ORDER)
    assert result.outcome is Outcome.UNRESOLVED
    assert (result.segment, result.component) == (1, 1)
    assert result.discrepancy == result.largest_discrepancy == 1e-3
    assert result.uncertainty == result.largest_uncertainty == np.inf


@pytest.mark.parametrize(("resolution", "outcome"), [(1e-9, "AGREES"), (1e-12, "DIFFERS")])
def test_measurable_defect_below_the_resolution_agrees_and_is_reported(
    resolution: float, outcome: str
) -> None:
    defect, uncertainty = make_defects(1e-13)
    defect[:] *= 1e-3
    defect[2, 1] = 4e-12
    result = judge(defect, uncertainty, resolution, None)
    assert result.outcome == outcome
    assert result.below_resolution is (outcome == "AGREES")
    assert (result.segment, result.component) == (2, 1)
    assert (result.discrepancy, result.uncertainty) == (4e-12, 1e-13)


@pytest.mark.parametrize(
    ("moved", "expected"),
    [
        ((3.1, -1.55, 0.2), 2.1),
        ((0.5, -0.25, 0.06), -0.5),
        ((2.0, -0.3, 0.1), None),  # too slow at the second state
        ((-0.5, 0.25, 0.1), None),  # the other way
        ((1.0, -0.5, 4.1), None),  # expected hardly to move where it differs most
    ],
)
def test_excess_has_a_sign_if_it_is_the_same_everywhere(
    moved: tuple[float, ...], expected: float | None
) -> None:
    ratio = excess(np.array(moved), np.array([1.0, -0.5, 0.05]))
    assert ratio == pytest.approx(np.nan if expected is None else expected, nan_ok=True)
