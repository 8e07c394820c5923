"""Ratios by version: kept, and told where they grew."""

from __future__ import annotations

from pathlib import Path

from benchmarks.lasting import FILE, keep, kept, slower, this_version


def test_what_became_slower_than_at_the_version_before_is_told(tmp_path: Path) -> None:
    file = tmp_path / "ratios.json"
    assert keep({"a": 1.0, "b": 0.5, "c": 2.0}, "0.1", file) == []
    assert keep({"a": 1.2, "b": 0.8, "d": 7.0}, "0.2", file) == ["slower: b: 0.8, it was 0.5"]
    # Once more for the same version: beside the one before it still, and no ratio is lost.
    assert keep({"a": 1.3}, "0.2", file) == [
        "slower: a: 1.3, it was 1",
        "slower: b: 0.8, it was 0.5",
    ]
    assert kept(file) == {
        "0.1": {"a": 1.0, "b": 0.5, "c": 2.0},
        "0.2": {"a": 1.3, "b": 0.8, "d": 7.0},
    }
    assert slower({"a": 1.0}, {}) == []


def test_the_committed_ratios_are_of_this_version_too() -> None:
    assert this_version() in kept(FILE)
