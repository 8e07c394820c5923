"""Ratios by version: stored, and reported if they grew."""

from pathlib import Path

from benchmarks.ratios import FILE, current_version, read_ratios, slower, store


def test_ratios_that_grew_since_the_version_before_are_reported(tmp_path: Path) -> None:
    file = tmp_path / "ratios.json"
    assert store({"a": 1.0, "b": 0.5, "c": 2.0}, "0.1", file) == []
    assert store({"a": 1.2, "b": 0.8, "d": 7.0}, "0.2", file) == ["slower: b: 0.8, it was 0.5"]
    # The same version again is compared with the one before it, and keeps its other ratios.
    assert store({"a": 1.3}, "0.2", file) == [
        "slower: a: 1.3, it was 1",
        "slower: b: 0.8, it was 0.5",
    ]
    assert read_ratios(file) == {
        "0.1": {"a": 1.0, "b": 0.5, "c": 2.0},
        "0.2": {"a": 1.3, "b": 0.8, "d": 7.0},
    }
    assert slower({"a": 1.0}, {}) == []


def test_committed_ratios_have_this_version() -> None:
    assert current_version() in read_ratios(FILE)
