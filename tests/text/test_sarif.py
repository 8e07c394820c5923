"""SARIF: what a code host shows at the lines of a file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from harness.records.outcome import Outcome
from harness.text.sarif import sarif
from tests.records.made import case, results
from tests.text.test_troubles import planted


def found(text: str) -> list[dict[str, Any]]:
    log = json.loads(text)
    assert log["version"] == "2.1.0"
    (run,) = log["runs"]
    rules = {rule["id"] for rule in run["tool"]["driver"]["rules"]}
    assert {one["ruleId"] for one in run["results"]} <= rules
    assert all(one["level"] in ("error", "warning", "note") for one in run["results"])
    return list(run["results"])


def test_a_cause_and_a_finding_stand_at_their_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "models" / "disc").mkdir(parents=True)
    (tmp_path / "models" / "disc" / "mujoco.xml").write_text("")
    told = found(sarif(planted()))
    assert {one["ruleId"] for one in told} == {"differs", "audit"}
    for one in told:
        (place,) = one["locations"]
        physical = place["physicalLocation"]
        assert physical["artifactLocation"]["uri"] == "models/disc/mujoco.xml"
        assert physical["region"]["startLine"] == 21


def test_what_agrees_is_no_result() -> None:
    assert found(sarif(results(case()))) == []


def test_an_engine_that_is_absent_is_a_warning() -> None:
    (one,) = found(sarif(results(case(Outcome.ABSENT, reason="pymunk is not installed"))))
    assert (one["ruleId"], one["level"]) == ("absent", "warning")
