"""Comparison of the rows of two engine versions."""

from __future__ import annotations

from typing import Any

from msgspec.structs import replace

from physics_crosscheck.harness.extras.sweep.versions import MAX_LISTED, compare_rows
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.sweep import SweepRow


def row(index: int = 0, **other: Any) -> SweepRow:
    default = SweepRow(
        index=index,
        draw=0,
        system="s",
        model="m",
        engine="e",
        scenario="free",
        integrator="euler",
        constants={},
        outcome=Outcome.AGREES,
        discrepancy=1e-13,
        uncertainty=1e-12,
        global_error=1e-3,
    )
    return replace(default, **other)


def test_changes_within_uncertainty_or_one_percent_are_ignored() -> None:
    changes = compare_rows([row()], [row(discrepancy=1.5e-12, global_error=1.005e-3)])
    assert (changes.cases, dict(changes.changed), changes.largest) == (1, {}, [])


def test_verdicts_limits_and_errors_are_counted_separately() -> None:
    before = [row(i) for i in range(4)]
    after = [
        row(0, outcome=Outcome.DIFFERS, discrepancy=1e-6),
        row(1, discrepancy=3e-12),
        row(2, global_error=2e-3),
        row(3),
    ]
    changes = compare_rows(before, after)
    assert (changes.cases, changes.changed) == (
        4, {"verdict": 1, "discrepancy": 2, "error at dt": 1},
    )  # fmt: skip
    assert [pair.after.index for pair in changes.largest] == [0, 1, 2], "largest changes come first"


def test_only_common_rows_are_compared_and_the_list_is_limited() -> None:
    before = [row(i) for i in range(20)]
    after = [row(i, global_error=1e-3 * (2 + i)) for i in range(5, 30)]
    changes = compare_rows(before, after)
    assert (changes.cases, changes.changed) == (15, {"error at dt": 15})
    assert [pair.after.index for pair in changes.largest] == list(range(19, 19 - MAX_LISTED, -1))


def test_failed_case_is_a_changed_verdict() -> None:
    none: dict[str, Any] = {"discrepancy": None, "uncertainty": None, "global_error": None}
    changes = compare_rows([row()], [row(outcome=Outcome.FAILED, **none)])
    assert changes.changed == {"verdict": 1}
