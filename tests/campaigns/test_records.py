"""Stores of records: a comparison finds exactly the differences between two."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from campaigns.records import PLACE, commands, diff_lines, main, read_store


def store(folder: Path, record: dict[str, Any], rows: list[dict[str, Any]] | None = None) -> Path:
    (folder / "run").mkdir(parents=True, exist_ok=True)
    (folder / "exit_codes.json").write_text("{}")
    (folder / "run/results.json").write_text(json.dumps(record))
    (folder / "run/rows.jsonl").write_text("\n".join(json.dumps(row) for row in rows or []))
    return folder


def lines_of(
    tmp_path: Path, old: Any, new: Any, renamed: dict[str, str] | None = None
) -> list[str]:
    a, b = store(tmp_path / "a", old), store(tmp_path / "b", new)
    names = renamed or {}
    return diff_lines(read_store(a, names), read_store(b, names), 160)


def test_changed_last_digit_is_reported(tmp_path: Path) -> None:
    (line,) = lines_of(tmp_path, {"cases": [{"e": 1.0}]}, {"cases": [{"e": 1.0 + 2**-52}]})
    assert line.startswith("1 x run/results.json:.cases[].e  ")
    assert "(2.2e-16 relative)" in line


def test_times_and_folders_are_ignored(tmp_path: Path) -> None:
    old = {"created": "then", "seconds": 1.0, "out": str(tmp_path / "a/run"), "at": "/old/m.xml"}
    new = {"created": "now", "seconds": 2.0, "out": str(tmp_path / "b/run"), "at": "/new/m.xml"}
    for name, place in (("a", "/old"), ("b", "/new")):
        (tmp_path / name).mkdir()
        (tmp_path / name / PLACE).write_text(place)
    assert lines_of(tmp_path, old, new) == []


def test_renamed_key_is_equal_and_missing_key_is_reported(tmp_path: Path) -> None:
    old, new = {"global_error": 0.1, "step": 1}, {"error_at_dt": 0.1}
    (line,) = lines_of(tmp_path, old, new, {"global_error": "error_at_dt"})
    assert "run/results.json:.step gone" in line


def test_changed_type_is_reported(tmp_path: Path) -> None:
    lines = lines_of(tmp_path, {"u": 1.0, "ok": True}, {"u": None, "ok": 1})
    assert len(lines) == 2


def test_additional_case_is_reported(tmp_path: Path) -> None:
    lines = lines_of(tmp_path, {"cases": []}, {"cases": [{}]})
    assert [line for line in lines if ".cases#" in line]


def test_rows_are_paired_by_index(tmp_path: Path) -> None:
    rows = [{"index": 0, "e": 1.0}, {"index": 1, "e": 2.0}]
    a, b = store(tmp_path / "a", {}, rows), store(tmp_path / "b", {}, rows[::-1])
    assert diff_lines(read_store(a, {}), read_store(b, {}), 160) == []


def test_folder_that_is_not_a_store_is_rejected_with_a_hint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.argv", ["records", "diff", str(tmp_path), str(tmp_path)])
    with pytest.raises(
        SystemExit, match=r"is not a store; run `python -m campaigns\.records store"
    ):
        main()


def test_commands_cover_six_systems_and_six_robots(tmp_path: Path) -> None:
    names = [name for name, _ in commands(tmp_path, ("run", "gate", "compare", "mutate", "sweep"))]
    assert len([name for name in names if name.startswith("run/")]) == 1 + 6
    assert len([name for name in names if name.startswith("mutate/")]) == 6
    assert {"gate", "sweep"} < set(names)
