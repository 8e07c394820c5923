"""Two results of a case: the changes and their size."""

from __future__ import annotations

from typing import Any

from physics_crosscheck.harness.baseline.diff import diff_cases
from physics_crosscheck.harness.records.diff import Diff, numbers_of
from physics_crosscheck.records import Outcome
from tests.records.made import case, full_run, verdict


def change_of(**fields: Any) -> Diff:
    """Return the change of a case that agreed to 11.3 digits."""
    return diff_cases(case().id, numbers_of(case()), numbers_of(case(**fields)))


def test_changed_verdict_is_better_or_worse() -> None:
    worse = change_of(outcome=Outcome.DIFFERS, reason="x is 3e-02 off")
    assert (worse.changed, *worse.outcomes, worse.is_worse) == (
        ("verdict",), Outcome.AGREES, Outcome.DIFFERS, True,
    )  # fmt: skip
    better = diff_cases(case().id, numbers_of(case(Outcome.FAILED)), numbers_of(case()))
    assert (better.changed[0], better.is_worse) == ("verdict", False)


def test_digits_change_by_half_a_digit_and_not_by_rounding() -> None:
    less = change_of(verdict=verdict(largest_uncertainty=4e-10))
    assert (less.changed, less.digits, less.is_worse) == (("digits",), (11.3, 9.3), True)
    assert change_of(verdict=verdict(largest_uncertainty=8e-12)).changed == ()
    more = change_of(verdict=verdict(largest_uncertainty=4e-14, largest_discrepancy=1e-15))
    assert (more.changed, more.is_worse) == (("digits",), False)


def test_global_error_changes_by_one_percent() -> None:
    assert change_of(full_run=full_run(global_error=0.00504)).changed == ()
    assert change_of(full_run=full_run(global_error=0.0051)).changed == ("error at dt",)
    assert change_of(full_run=full_run(global_error=None)).changed == ("error at dt",)
    assert change_of(full_run=full_run(time_step=0.001)).changed == ("dt",)
