"""The journal of a run: whole lines, keyed by inputs, locked by one run at a time."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from physics_crosscheck.harness.planning.model_checks import RESULTS
from physics_crosscheck.harness.records.coverage import Coverage
from physics_crosscheck.harness.records.finding import Diagnosis
from physics_crosscheck.harness.records.journal import NAME, CacheKey, journal
from physics_crosscheck.harness.records.read import ResultsError
from tests.records.made import case


def cache_key(kind: str = "case", scenario: str = "", inputs: str = "i") -> CacheKey:
    return CacheKey(kind=kind, folder="f", model="m", engine="e", scenario=scenario, inputs=inputs)


DONE: dict[CacheKey, object] = {
    cache_key(scenario="free"): case(),
    cache_key("coverage"): Coverage(note="none"),
    cache_key("linearizations"): (),
    cache_key("diagnosis"): Diagnosis(explained=True),
}


def fill_journal(place: Path) -> None:
    with journal(place, resume=False) as fresh:
        for key, value in DONE.items():
            fresh.store(key, value)


def read_journal(place: Path, *, resume: bool = True) -> dict[CacheKey, object]:
    keys = (*DONE, cache_key(scenario="free", inputs="other"), cache_key())
    with journal(place, resume=resume) as again:
        values = {key: again.find(key, RESULTS[key.kind]) for key in keys}
    return {key: value for key, value in values.items() if value is not None}


def test_entries_are_read_only_on_resume(tmp_path: Path) -> None:
    fill_journal(tmp_path)
    assert read_journal(tmp_path) == DONE
    assert read_journal(tmp_path, resume=False) == {}
    assert read_journal(tmp_path) == {}


@pytest.mark.parametrize("lost", [1, 2, 30])
def test_truncated_line_is_ignored_and_next_line_is_whole(tmp_path: Path, lost: int) -> None:
    fill_journal(tmp_path)
    path = tmp_path / NAME
    os.truncate(path, path.stat().st_size - lost)
    last = list(DONE)[-1]
    assert read_journal(tmp_path) == {key: value for key, value in DONE.items() if key != last}
    with journal(tmp_path, resume=True) as again:
        again.store(last, DONE[last])
    assert read_journal(tmp_path) == DONE


@pytest.mark.parametrize("line", [b"{}", b"\xff\xfe", b"[" * 5000, b'{"work": 1}', b"null", b""])
def test_malformed_line_is_ignored(tmp_path: Path, line: bytes) -> None:
    fill_journal(tmp_path)
    with (tmp_path / NAME).open("ab") as file:
        file.write(line + b"\n")
    assert read_journal(tmp_path) == DONE


def test_second_run_is_rejected_with_process_of_first(tmp_path: Path) -> None:
    with journal(tmp_path, resume=False):
        refused = pytest.raises(ResultsError, match=rf"\(process {os.getpid()}\).*--out")
        with refused, journal(tmp_path, resume=False):
            raise AssertionError("two at once")
    with journal(tmp_path, resume=False):
        pass


def test_removed_file_is_not_taken_for_the_lock(tmp_path: Path) -> None:
    with journal(tmp_path, resume=False) as first:
        first.remove()
        with journal(tmp_path, resume=False) as second:
            second.store(cache_key(), case())
    assert read_journal(tmp_path) == {cache_key(): case()}


def test_full_disk_ends_the_journal_but_not_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    with journal(tmp_path, resume=False) as fresh:
        monkeypatch.setattr(os, "fsync", full)
        for _ in range(2):
            fresh.store(cache_key(), case())
        assert fresh.problem == f"{tmp_path / NAME}: No space left on device"


def test_wrong_file_type_is_an_error(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / NAME)
    with pytest.raises(OSError, match="not a regular file"), journal(tmp_path, resume=True):
        pass
    (tmp_path / "file").touch()
    with pytest.raises(FileExistsError), journal(tmp_path / "file", resume=True):
        pass
