"""results.json: plain JSON, whole or not at all, and checked when read."""

import json
import os

import numpy as np
import pytest

from harness.records.results import ResultsError, read_results, results, write_results, write_whole


def some(**changes):
    case = {"system": "s", "folder": "f", "model": "m", "engine": "e", "scenario": "a", "place": 0}
    return results([], [], [case | changes], {"e": "1.0"}, 1e-9, 0.1)


def test_nan_and_infinity_never_reach_json(tmp_path):
    found = some(order=float("nan"), uncertainty=float("inf"), series={"t": [1.0, float("-inf")]})
    write_results(tmp_path / "r.json", found)
    text = (tmp_path / "r.json").read_text()
    case = json.loads(text, parse_constant=lambda name: pytest.fail(name))["cases"][0]
    assert case["order"] is None
    assert case["uncertainty"] is None
    assert case["series"]["t"] == [1.0, None]


def test_numpy_numbers_become_plain_ones():
    case = some(order=np.float64(1.5), steps=np.int64(3), rigid=np.bool_(True))["cases"][0]
    assert [type(case[key]) for key in ("order", "steps", "rigid")] == [float, int, bool]


def test_what_was_written_is_read_back(tmp_path):
    found = some(order=1.0)
    write_results(tmp_path / "deep" / "r.json", found)
    assert read_results(tmp_path / "deep" / "r.json") == found


def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    path = tmp_path / "r.json"
    write_whole(path, "old")

    def full(_):
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
def test_a_file_that_is_no_results_is_refused_with_a_remedy(tmp_path, text, sentence):
    path = tmp_path / "r.json"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ResultsError, match=sentence) as refused:
        read_results(path)
    assert "crosscheck run" in str(refused.value)
    assert str(path) in str(refused.value)
