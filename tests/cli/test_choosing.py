"""Selection of cases on the command line, the formats of their results, and `report`."""

import json
import subprocess
from pathlib import Path

import pytest

from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.records.write import encoded
from physics_crosscheck.records import Results, read_results
from tests import commands
from tests.faults.known_folder import known_folder
from tests.models import edited
from tests.records.made import case, results


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


def saved(folder: Path, run: Results) -> Path:
    folder.mkdir()
    (folder / "results.json").write_text(encoded(run))
    return folder


@pytest.fixture
def old(tmp_path: Path) -> Path:
    return saved(tmp_path / "old", results(case(), case(scenario="far")))


def test_folder_stands_for_the_results_in_it(old: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", str(old)]) == 0
    assert capsys.readouterr().out == f"Report: {old / 'index.html'}\n"
    assert "2 of 2 cases agree" in (old / "index.html").read_text()


@pytest.mark.parametrize(
    ("names", "sentence"),
    [
        (("none",), "none: can't be read: No such file or directory"),
        (("empty",), "empty/results.json: can't be read"),
        (("torn.json",), "torn.json: not JSON"),
        (("other.json",), "other.json: not a results file of schema 5; run `crosscheck run` again"),
    ],
)
def test_invalid_results_are_rejected_and_nothing_is_written(
    old: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    names: tuple[str, ...],
    sentence: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "torn.json").write_text('{"schema": 5, "cases": [')
    (tmp_path / "other.json").write_text('{"schema": 7}')
    assert main(["report", *names]) == 2
    assert sentence in capsys.readouterr().err
    assert [path.name for path in tmp_path.rglob("*.html")] == []


@pytest.mark.parametrize("command", ["run", "report", "sweep"])
def test_foreign_page_is_not_replaced(
    old: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    def started(*_: object, **__: object) -> None:
        raise AssertionError("something was run")

    page = old / "index.html"
    page.write_text("<html><title>my site</title></html>")
    monkeypatch.setattr("physics_crosscheck.harness.interfaces.cli.run.run", started)
    monkeypatch.setattr("physics_crosscheck.harness.extras.sweep.main.executor", started)
    words = {"run": ["run", "simple_pendulum"], "sweep": ["sweep", "simple_pendulum"]}
    assert main([*words.get(command, ["report", str(old)]), "--out", str(old)]) == 2
    output = capsys.readouterr().err
    assert output.startswith(f"crosscheck: {page}: crosscheck did not write this page")
    assert "--out" in output
    assert page.read_text() == "<html><title>my site</title></html>"


def test_page_of_this_program_is_replaced(old: Path) -> None:
    page = old / "index.html"
    assert main(["report", str(old)]) == 0
    assert '<meta name="generator" content="physics-crosscheck">' in page.read_text()
    assert main(["report", str(old)]) == 0
    page.write_text("<head>\n<title>crosscheck: written before pages named their generator</title>")
    assert main(["report", str(old)]) == 0
