"""What rows of two versions of an engine say together."""

from __future__ import annotations

from typing import Any

from msgspec.structs import replace

from physics_crosscheck.harness.extras.sweep.versions import MAX_LISTED, compare_rows
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.sweep import SweepRow


def row(index: int = 0, **other: Any) -> SweepRow:
    one = SweepRow(
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
    return replace(one, **other)


def test_rows_within_their_uncertainties_and_a_hundredth_of_their_errors_are_the_same() -> None:
    found = compare_rows([row()], [row(discrepancy=1.5e-12, global_error=1.005e-3)])
    assert (found.cases, dict(found.changed), found.largest) == (1, {}, [])


def test_verdicts_limits_and_errors_are_counted_apart() -> None:
    before = [row(i) for i in range(4)]
    after = [
        row(0, outcome=Outcome.DIFFERS, discrepancy=1e-6),
        row(1, discrepancy=3e-12),
        row(2, global_error=2e-3),
        row(3),
    ]
    found = compare_rows(before, after)
    assert (found.cases, found.changed) == (
        4, {"verdict": 1, "discrepancy": 2, "error at dt": 1},
    )  # fmt: skip
    assert [pair.after.index for pair in found.largest] == [0, 1, 2], "the most telling first"


def test_what_one_version_has_not_is_not_compared_and_few_of_many_are_told() -> None:
    before = [row(i) for i in range(20)]
    after = [row(i, global_error=1e-3 * (2 + i)) for i in range(5, 30)]
    found = compare_rows(before, after)
    assert (found.cases, found.changed) == (15, {"error at dt": 15})
    assert [pair.after.index for pair in found.largest] == list(range(19, 19 - MAX_LISTED, -1))


def test_a_case_that_failed_has_no_numbers_and_another_verdict() -> None:
    none: dict[str, Any] = {"discrepancy": None, "uncertainty": None, "global_error": None}
    found = compare_rows([row()], [row(outcome=Outcome.FAILED, **none)])
    assert found.changed == {"verdict": 1}
