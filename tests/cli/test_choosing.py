"""Selection of cases on the command line, and the formats of their results."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

from physics_crosscheck.records import read_results
from tests import commands
from tests.faults.known_folder import known_folder
from tests.models import edited


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """Create `models/oscillator` with a right model and one whose spring is wrong."""
    known_folder(tmp_path / "models" / "oscillator", {"good": "", "wrong": ""})
    edited(tmp_path / "models" / "oscillator" / "wrong.known", "47.0", "48.0")
    return tmp_path


def crosscheck(place: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return commands.crosscheck(*arguments, cwd=place, known_engine=True)


def ran(place: Path) -> list[str]:
    return [str(case.id) for case in read_results(place / "reports" / "results.json").cases]


def test_cases_are_listed_without_being_run(place: Path) -> None:
    done = crosscheck(place, "list", "models", "-k", "free")
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        "oscillator/good.known/free [known]",
        "oscillator/wrong.known/free [known]",
    ]
    assert not (place / "reports").exists()
    rows = json.loads(crosscheck(place, "list", "models", "--format", "json").stdout)
    assert [row["scenario"] for row in rows] == ["free", "driven"] * 2
    assert {row["folder"] for row in rows} == {"models/oscillator"}


def test_case_is_run_by_its_model_scenario_and_engine(place: Path) -> None:
    done = crosscheck(place, "run", "models/oscillator/good.known/driven [known]")
    assert done.returncode == 0, done.stdout + done.stderr
    assert ran(place) == ["oscillator/good.known/driven [known]"]


def test_last_failed_runs_only_the_failed_case(place: Path) -> None:
    first = crosscheck(place, "run", "models", "-k", "free")
    assert first.returncode == 1, first.stdout + first.stderr
    assert "Report: reports/index.html\n" in first.stdout
    wrong = place / "models" / "oscillator" / "wrong.known"
    edited(wrong, "48.0", "47.0")
    second = crosscheck(place, "run", "--last-failed")
    assert second.returncode == 0, second.stdout + second.stderr
    assert ran(place) == ["oscillator/wrong.known/free [known]"]
    third = crosscheck(place, "run", "--last-failed")
    assert (third.returncode, third.stdout) == (0, "")
    assert "the last run has no failed case" in third.stderr


def test_json_and_sarif_formats_print_only_results(place: Path) -> None:
    done = crosscheck(place, "run", "models/oscillator/good.known/free", "--format", "json")
    assert done.returncode == 0, done.stderr
    (case,) = json.loads(done.stdout)["cases"]
    assert case["outcome"] == "AGREES"
    log = json.loads(
        crosscheck(place, "run", "models", "-k", "wrong and free", "--format", "sarif").stdout
    )
    files = {
        one["locations"][0]["physicalLocation"]["artifactLocation"]["uri"]
        for one in log["runs"][0]["results"]
        if one["ruleId"].startswith(("XC2", "XC3"))
    }
    assert files == {"models/oscillator/wrong.known"}


@pytest.mark.parametrize(("arguments", "message"), [
    (("run", "models", "-k", "nothing"), "no case has such a name, or its engine is not installed"),
    (("run", "models", "-k", "free and"), "-k 'free and' can't be read"),
    (("list", "models", "-k", "(free"), "-k '(free' can't be read"),
    (("run", "--last-failed"), "results.json: can't be read"),
    (("list", "nowhere"), "nowhere: no such folder"),
])  # fmt: skip
def test_invalid_selection_is_wrong_usage(
    place: Path, arguments: tuple[str, ...], message: str
) -> None:
    done = crosscheck(place, *arguments)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert not (place / "reports" / "results.json").exists()


def test_gate_of_a_model_names_its_folder(place: Path) -> None:
    done = crosscheck(place, "gate", "models/oscillator/good.known")
    assert done.returncode == 2
    assert done.stderr == (
        "crosscheck: models/oscillator/good.known: a file; expected a system folder; name its"
        " folder, models/oscillator\n"
    )


def test_folder_that_cannot_be_listed_is_reported(place: Path) -> None:
    (place / "models" / "oscillator" / "system.py").write_text("oops\n")
    done = crosscheck(place, "list", "models")
    assert done.returncode == 2
    assert "system.py:1: NameError" in done.stderr


def test_version_is_printed() -> None:
    done = crosscheck(Path.cwd(), "--version")
    assert done.returncode == 0
    assert done.stdout.startswith("crosscheck ")
