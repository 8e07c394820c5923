"""What a run keeps as it goes: whole lines, for the same inputs, of one run at a time."""

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


def work(kind: str = "case", scenario: str = "", inputs: str = "i") -> CacheKey:
    return CacheKey(kind=kind, folder="f", model="m", engine="e", scenario=scenario, inputs=inputs)


DONE: dict[CacheKey, object] = {
    work(scenario="free"): case(),
    work("coverage"): Coverage(note="none"),
    work("linearizations"): (),
    work("diagnosis"): Diagnosis(explained=True),
}


def filled(place: Path) -> None:
    with journal(place, resume=False) as fresh:
        for one, value in DONE.items():
            fresh.store(one, value)


def kept(place: Path, *, resume: bool = True) -> dict[CacheKey, object]:
    keys = (*DONE, work(scenario="free", inputs="other"), work())
    with journal(place, resume=resume) as again:
        values = {key: again.find(key, RESULTS[key.kind]) for key in keys}
    return {key: value for key, value in values.items() if value is not None}


def test_what_was_kept_is_there_when_it_is_resumed_and_only_then(tmp_path: Path) -> None:
    filled(tmp_path)
    assert kept(tmp_path) == DONE
    assert kept(tmp_path, resume=False) == {}
    assert kept(tmp_path) == {}


@pytest.mark.parametrize("lost", [1, 2, 30])
def test_a_line_that_was_cut_is_lost_alone_and_the_next_is_whole(tmp_path: Path, lost: int) -> None:
    filled(tmp_path)
    path = tmp_path / NAME
    os.truncate(path, path.stat().st_size - lost)
    last = list(DONE)[-1]
    assert kept(tmp_path) == {one: value for one, value in DONE.items() if one != last}
    with journal(tmp_path, resume=True) as again:
        again.store(last, DONE[last])
    assert kept(tmp_path) == DONE


@pytest.mark.parametrize("line", [b"{}", b"\xff\xfe", b"[" * 5000, b'{"work": 1}', b"null", b""])
def test_a_line_that_is_no_work_is_none(tmp_path: Path, line: bytes) -> None:
    filled(tmp_path)
    with (tmp_path / NAME).open("ab") as file:
        file.write(line + b"\n")
    assert kept(tmp_path) == DONE


def test_a_second_run_is_refused_by_the_first_ones_process(tmp_path: Path) -> None:
    with journal(tmp_path, resume=False):
        refused = pytest.raises(ResultsError, match=rf"\(process {os.getpid()}\).*--out")
        with refused, journal(tmp_path, resume=False):
            raise AssertionError("two at once")
    with journal(tmp_path, resume=False):
        pass


def test_a_file_that_was_removed_meanwhile_is_not_taken_for_the_lock(tmp_path: Path) -> None:
    with journal(tmp_path, resume=False) as first:
        first.remove()
        with journal(tmp_path, resume=False) as second:
            second.store(work(), case())
    assert kept(tmp_path) == {work(): case()}


def test_a_full_disk_ends_the_journal_and_not_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    with journal(tmp_path, resume=False) as fresh:
        monkeypatch.setattr(os, "fsync", full)
        for _ in range(2):
            fresh.store(work(), case())
        assert fresh.problem == f"{tmp_path / NAME}: No space left on device"


def test_what_is_no_file_or_no_folder_is_an_error_with_its_name(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / NAME)
    with pytest.raises(OSError, match="not a regular file"), journal(tmp_path, resume=True):
        pass
    (tmp_path / "file").touch()
    with pytest.raises(FileExistsError), journal(tmp_path / "file", resume=True):
        pass
