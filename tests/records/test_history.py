"""History files: one line per case and run, appended whole, read despite torn lines."""

from __future__ import annotations

from pathlib import Path

import pytest

from physics_crosscheck.harness.records.history import (
    append_history,
    past_of,
    read_history,
)
from physics_crosscheck.harness.records.outcome import Outcome
from tests.records.made import case, results, verdict


def test_appended_lines_are_read_in_order(tmp_path: Path) -> None:
    run = results(case(), case(Outcome.FAILED, scenario="far"), versions={"mujoco": "3.2"})
    for commit in ("abc", "def"):
        append_history(tmp_path, past_of(run, commit))
    lines = read_history(tmp_path)
    assert [(line.scenario, line.commit) for line in lines] == [
        ("free", "abc"), ("far", "abc"), ("free", "def"), ("far", "def"),
    ]  # fmt: skip
    assert lines[:2] == past_of(run, "abc")
    assert (lines[0].version, lines[0].digits, lines[0].global_error) == ("3.2", 11.3, 0.005)
    assert (lines[1].outcome, lines[1].digits, lines[1].global_error) == ("FAILED", None, None)


@pytest.mark.parametrize("torn", [b'{"time":"2026', b"\xff\xfe", b"[1]", b"null\n{}", b""])
def test_torn_line_is_ignored(tmp_path: Path, torn: bytes) -> None:
    past = past_of(results(case()), "")
    append_history(tmp_path, past)
    with open(tmp_path / "history" / "cases.jsonl", "ab") as file:
        file.write(torn)
    assert read_history(tmp_path) == past
    append_history(tmp_path, past)
    assert read_history(tmp_path) == (*past, *past)


def test_missing_history_is_empty(tmp_path: Path) -> None:
    assert read_history(tmp_path) == ()


def test_line_is_small(tmp_path: Path) -> None:
    append_history(tmp_path, past_of(results(case(), versions={"mujoco": "3.2.7"}), "a" * 40))
    assert (tmp_path / "history" / "cases.jsonl").stat().st_size < 300


def test_digits_are_those_of_the_worst_component() -> None:
    assert case().digits == 11.3
    assert case(Outcome.FAILED).digits is None
    assert case(verdict=verdict(largest_uncertainty=None)).digits is None
    assert case(verdict=verdict(largest_discrepancy=0, largest_uncertainty=0)).digits == 16
