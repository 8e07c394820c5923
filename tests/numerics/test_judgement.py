"""The rule that judges limits compared with the equations or with another model."""

import numpy as np
import pytest

from physics_crosscheck.harness.numerics.judgement import UnresolvedReason, judge, unresolved_reason
from physics_crosscheck.harness.numerics.ladder import ExtrapolatedLimit
from physics_crosscheck.records import Outcome
from physics_crosscheck.reference.mechanism.numeric import Array

EPSILON = float(np.finfo(float).eps)


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


@pytest.mark.parametrize(
    ("first", "converges", "confirmed", "why"),
    [
        (0.0, False, False, UnresolvedReason.STANDS_STILL),
        (1.0, False, False, UnresolvedReason.DIVERGES),
        (1.0, True, False, UnresolvedReason.WRONG_ORDER),
        (1.0, True, True, None),
    ],
)
def test_most_severe_unresolved_reason_is_reported(
    first: float, converges: bool, confirmed: bool, why: UnresolvedReason | None
) -> None:
    limit = ExtrapolatedLimit(
        value=np.zeros((1, 2)),
        uncertainty=np.zeros((1, 2)),
        rungs=(2, 3),
        increments=np.array([first]),
        order=1.0,
        order_confirmed=confirmed,
        converges=converges,
        rounding=np.zeros((1, 2)),
        epsilon=EPSILON,
    )
    assert unresolved_reason(limit) is why


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
