"""`crosscheck sweep` from its words to its page."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from harness.cli.main import main
from harness.report.sweep import render_sweep
from harness.sweep.store import read_plan, read_rows
from harness.sweep.summary import summary
from tests.sweep.made import swept_folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return swept_folder(tmp_path_factory.mktemp("systems") / "mass", "mujoco.xml", "space.py")


@pytest.fixture(scope="module")
def words(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """A sweep that was run: the words that it was asked with."""
    out = tmp_path_factory.mktemp("out") / "sweep"
    given = ["sweep", str(folder), "--vary", "k=20:200:log", "--draws", "4"]
    given += ["--integrator", "euler", "--integrator", "rk4", "--out", str(out)]
    assert main(given) == 0
    return given


def test_integrators_are_crossed_with_draws_and_rows_read_as_one_table(words: list[str]) -> None:
    import pyarrow.parquet

    table = pyarrow.parquet.read_table(Path(words[-1]) / "rows").to_pydict()
    assert sorted(table["index"]) == list(range(8))
    assert set(table["integrator"]) == {"euler", "RK4"}
    assert set(table["engine"]) == {"mujoco"}
    assert len(set(table["constant_k"])) == 4
    errors = dict.fromkeys(("euler", "RK4"), 0.0)
    for name, error in zip(table["integrator"], table["global_error"], strict=True):
        errors[name] = max(errors[name], error)
    assert errors["RK4"] < 1e-4 * errors["euler"]


def test_a_row_has_the_command_that_runs_it_alone(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    row = next(read_rows(Path(words[-1])))
    program, *again = shlex.split(row.command)
    assert program == "crosscheck"
    assert main(again) == 0
    told = capsys.readouterr().out
    assert f"AGREES #{row.index} {row.name}, {row.integrator}" in told
    assert f"k = {row.constants['k']:.6g}" in told
    assert f"error at the step {row.global_error:.1e}" in told


def test_the_summary_is_told_again_of_the_rows_alone(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    out = Path(words[-1])
    page = (out / "index.html").read_text()
    (out / "index.html").unlink()
    assert main(["sweep", "--summary", str(out)]) == 0
    assert "8 cases: 8 AGREES" in capsys.readouterr().out
    assert (out / "index.html").read_text() == page


def test_the_page_shows_each_row_and_asks_for_nothing(words: list[str]) -> None:
    out = Path(words[-1])
    plan = read_plan(out)
    assert plan is not None
    rows = list(read_rows(out))
    page = render_sweep(summary(plan, rows))
    for row in rows:
        assert f"<title>#{row.index} {row.name}:" in page
    assert "8 AGREES" in page
    assert "Error at the shipped step over k" in page
    assert not re.search(r"<script|https?://(?!www\.w3\.org)|<link|@import", page)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        (["--seed", "1"], "another plan (seed: 0, now 1); choose another --out"),
        (["--vary", "k=9:8"], "9 is not below 8"),
        (["--integrator", "BDF"], "--integrator BDF: no model has it; they have"),
        (["--scenario", "fast"], "--scenario fast: there is none; there are free"),
    ],
)
def test_what_makes_no_sense_ends_with_2_and_a_remedy(
    words: list[str], changed: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = words if changed[0] in ("--seed", "--integrator", "--scenario") else words[:2]
    assert main([*before, *changed]) == 2
    assert said in capsys.readouterr().err


def test_a_folder_without_a_sweep_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["sweep", "--summary", str(tmp_path)]) == 2
    assert "there is no plan.json of a sweep in it" in capsys.readouterr().err
