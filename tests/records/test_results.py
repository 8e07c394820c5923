"""results.json: plain JSON, whole or not at all, and checked when read."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from harness.records.base import number, numbers, rows
from harness.records.case import Case, Convergence
from harness.records.outcome import Outcome
from harness.records.read import ResultsError, read_results
from harness.records.results import Results
from harness.records.write import encoded, write_whole


def some(*cases: Case) -> Results:
    return Results(
        created="now",
        versions={"e": "1.0"},
        resolution=1e-9,
        seconds=0.1,
        systems=(),
        models=(),
        cases=cases,
    )


CASE = Case(system="s", folder="f", model="m", engine="e", scenario="a", outcome=Outcome.AGREES)


def test_nan_and_infinity_never_reach_json() -> None:
    found = Convergence(
        rungs=(1,),
        h=numbers([1.0]),
        defect=numbers([float("-inf")]),
        increments=numbers([float("nan"), None]),
    )
    read = json.loads(encoded(found), parse_constant=lambda name: pytest.fail(name))
    assert read["defect"] == [None]
    assert read["increments"] == [None, None]
    assert number(float("inf")) is None


def test_numpy_numbers_become_plain_ones() -> None:
    assert type(number(np.float64(1.5))) is float
    assert rows(np.eye(2)) == ((1.0, 0.0), (0.0, 1.0))
    assert type(rows(np.eye(2))[0][0]) is float


def test_what_was_written_is_read_back(tmp_path: Path) -> None:
    found = some(CASE)
    write_whole(tmp_path / "deep" / "r.json", encoded(found))
    assert read_results(tmp_path / "deep" / "r.json") == found


def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "r.json"
    write_whole(path, "old")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        write_whole(path, "new")
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["r.json"]


@pytest.mark.parametrize(("text", "sentence"), [
    (None, "can't be read"), ("{", "no JSON"), ("[]", "not results of schema 1"),
    ('{"schema": 99}', "not results of schema 1"),
])  # fmt: skip
def test_a_file_that_is_no_results_is_refused_with_a_remedy(
    tmp_path: Path, text: str | None, sentence: str
) -> None:
    path = tmp_path / "r.json"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ResultsError, match=sentence) as refused:
        read_results(path)
    assert "crosscheck run" in str(refused.value)
    assert str(path) in str(refused.value)
