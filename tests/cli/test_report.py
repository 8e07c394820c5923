"""`crosscheck report`: one run, two runs, a badge; folders or files."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from physics_crosscheck.harness.interfaces.cli.keeping import keep_history
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.records.history import append_history, past_of, read_history
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.records.write import encoded
from tests.records.made import case, results, verdict


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


OFF = verdict(discrepancy=0.01, largest_discrepancy=0.01)


def test_comparison_of_two_runs_exits_1_if_a_case_is_worse(
    old: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    worse = case(Outcome.DIFFERS, verdict=OFF, reason="x is off")
    new = saved(tmp_path / "new", results(worse, case(scenario="far")))
    assert main(["report", str(old), str(new / "results.json")]) == 1
    output = capsys.readouterr().out
    assert "AGREES -> DIFFERS" in output
    assert "11.3 -> 2.0" in output
    assert "2 cases: 1 with another verdict; 1 worse" in output
    assert output.endswith(f"{new / 'changes.html'}\n")
    assert "x is off" in (new / "changes.html").read_text()
    assert main(["report", str(old), str(old), "--out", str(tmp_path / "same")]) == 0
    assert "2 cases: nothing changed" in capsys.readouterr().out
    assert (tmp_path / "same" / "changes.html").exists()


@pytest.mark.parametrize(
    ("names", "sentence"),
    [
        (("old", "none"), "none: can't be read: No such file or directory"),
        (("old", "empty"), "empty/results.json: can't be read"),
        (("old", "torn.json"), "torn.json: not JSON"),
        (
            ("old", "other.json"),
            "other.json: not a results file of schema 5; run `crosscheck run` again",
        ),
        (("old", "old", "old"), "report takes one run, or two to compare, and not 3"),
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


def test_badge_is_written(old: Path, capsys: pytest.CaptureFixture[str]) -> None:
    badge = old / "badge.svg"
    assert main(["report", str(old), "--badge", str(badge)]) == 0
    assert capsys.readouterr().out == f"Report: {old / 'index.html'}  Badge: {badge}\n"
    assert "2 of 2 agree to 11.3 digits" in badge.read_text()


def test_report_draws_the_history_in_its_folder(old: Path) -> None:
    run = results(case(), case(scenario="far"))
    for day in (1, 2):
        append_history(old, past_of(replace(run, created=f"2026-01-0{day}T00:00:00+00:00"), ""))
    assert main(["report", str(old)]) == 0
    assert 'id="pack-history"' in (old / "index.html").read_text()


def test_history_is_kept_only_where_it_was_begun(tmp_path: Path) -> None:
    run = results(case())
    assert keep_history(tmp_path, run, begin=False) == ()
    assert list(tmp_path.iterdir()) == []
    assert len(keep_history(tmp_path, run, begin=True)) == 1
    assert len(keep_history(tmp_path, run, begin=False)) == 2
    stopped = results(case(), stopped="SIGINT")
    assert len(keep_history(tmp_path, stopped, begin=False)) == 2, "not a finished run"
    assert read_history(tmp_path)[0].commit == read_history(tmp_path)[1].commit


@pytest.mark.parametrize("command", ["run", "report", "sweep"])
def test_foreign_page_is_not_replaced(
    old: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    def started(*_: object, **__: object) -> None:
        raise AssertionError("something was run")

    page = old / "index.html"
    page.write_text("<html><title>my site</title></html>")
    monkeypatch.setattr("physics_crosscheck.harness.interfaces.cli.run.run", started)
    monkeypatch.setattr("physics_crosscheck.harness.extras.sweep.main.make_executor", started)
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
