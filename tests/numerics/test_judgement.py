"""One rule for what limits say: beside the equations, and beside another model."""

import numpy as np
import pytest

from physics_crosscheck.harness.numerics.judgement import UnresolvedReason, judge, unresolved_reason
from physics_crosscheck.harness.numerics.ladder import EPSILON, ExtrapolatedLimit
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.reference.mechanism.numeric import Array


def told(uncertainty: float = 1e-11) -> tuple[Array, Array]:
    """Defects below their uncertainty, of five segments and two components."""
    rng = np.random.default_rng(3)
    return 1e-12 * rng.uniform(0.1, 0.9, (5, 2)), np.full((5, 2), uncertainty)


def test_what_is_below_its_uncertainty_and_that_below_the_resolution_agrees() -> None:
    found = judge(*told(), 1e-9, None)
    assert found.outcome is Outcome.AGREES
    assert found.unresolved_reason is None


def test_the_largest_of_all_components_is_told_beside_that_of_the_worst_ratio() -> None:
    defect, uncertainty = told()
    defect[1, 1], uncertainty[:, 1] = 1.5e-11, 1.5e-10  # a tenth of U; the other component: more
    defect[2, 0] = 9e-12
    found = judge(defect, uncertainty, 1e-9, None)
    assert (found.segment, found.component) == (2, 0)
    assert (found.discrepancy, found.uncertainty) == (9e-12, 1e-11)
    assert (found.largest_discrepancy, found.largest_uncertainty) == (1.5e-11, 1.5e-10)


def test_a_segment_that_could_not_be_resolved_hides_none_that_was() -> None:
    defect, uncertainty = told()
    defect[3, 1], uncertainty[0] = 1e-8, np.inf
    found = judge(defect, uncertainty, 1e-9, None)
    assert found.outcome is Outcome.DIFFERS
    assert (found.segment, found.component) == (3, 1)
    assert (found.discrepancy, found.uncertainty) == (1e-8, 1e-11)
    assert (found.largest_discrepancy, found.largest_uncertainty) == (1e-8, np.inf)


@pytest.mark.parametrize(
    ("worst", "why"), [(1e-7, UnresolvedReason.COARSE), (np.inf, UnresolvedReason.DIVERGES_HERE)]
)
def test_an_uncertainty_above_the_resolution_is_unresolved(
    worst: float, why: UnresolvedReason
) -> None:
    defect, uncertainty = told()
    uncertainty[4, 1] = worst
    found = judge(defect, uncertainty, 1e-9, None)
    assert found.outcome is Outcome.UNRESOLVED
    assert found.unresolved_reason is why
    assert (found.segment, found.component) == (4, 1)
    assert found.uncertainty == found.largest_uncertainty == worst


def test_an_obstacle_leaves_no_digit_whatever_the_defects() -> None:
    defect, uncertainty = told()
    defect[0, 0], defect[1, 1] = np.nan, 1e-3
    found = judge(defect, uncertainty, 1e-9, UnresolvedReason.WRONG_ORDER)
    assert found.outcome is Outcome.UNRESOLVED
    assert (found.segment, found.component) == (1, 1)
    assert found.discrepancy == found.largest_discrepancy == 1e-3
    assert found.uncertainty == found.largest_uncertainty == np.inf


@pytest.mark.parametrize(
    ("first", "converges", "confirmed", "why"),
    [
        (0.0, False, False, UnresolvedReason.STANDS_STILL),
        (1.0, False, False, UnresolvedReason.DIVERGES),
        (1.0, True, False, UnresolvedReason.WRONG_ORDER),
        (1.0, True, True, None),
    ],
)
def test_obstacles_are_told_in_the_order_in_which_they_take_away_meaning(
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
def test_what_is_measurable_below_the_resolution_agrees_and_is_told(
    resolution: float, outcome: str
) -> None:
    defect, uncertainty = told(1e-13)
    defect[:] *= 1e-3
    defect[2, 1] = 4e-12
    found = judge(defect, uncertainty, resolution, None)
    assert found.outcome == outcome
    assert found.below_resolution is (outcome == "AGREES")
    assert (found.segment, found.component) == (2, 1)
    assert (found.discrepancy, found.uncertainty) == (4e-12, 1e-13)
