"""`crosscheck report`: folders or files."""

from __future__ import annotations

from pathlib import Path

import pytest

from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.records.write import encoded
from physics_crosscheck.records import Results
from tests.records.made import case, results


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
        (
            ("other.json",),
            "other.json: not a results file of schema 5; run `crosscheck run` again",
        ),
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
