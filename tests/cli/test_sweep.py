"""Settings of a project as defaults, and `crosscheck sweep` from arguments to page."""

import argparse
import os
import re
import shlex
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from physics_crosscheck.harness.extras.sweep.main import summary
from physics_crosscheck.harness.extras.sweep.store import read_plan, read_rows
from physics_crosscheck.harness.interfaces.cli.commands import COMMANDS
from physics_crosscheck.harness.interfaces.cli.gate import separate_patterns, targets_and_options
from physics_crosscheck.harness.interfaces.cli.help import CommandParser
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.interfaces.cli.settings import SettingsError, apply
from physics_crosscheck.harness.render.html.sweep import render_sweep
from physics_crosscheck.harness.results.status import percent
from tests.cli.test_choosing import crosscheck, place
from tests.sweep.made import swept_folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return swept_folder(tmp_path_factory.mktemp("systems") / "mass", "mujoco.xml", "space.py")


@pytest.fixture(scope="module")
def words(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Run a sweep, and return its arguments."""
    out = tmp_path_factory.mktemp("out") / "sweep"
    given = ["sweep", str(folder), "--vary", "k=20:200:log", "--draws", "4"]
    given += ["--integrator", "euler", "--integrator", "rk4", "--out", str(out)]
    assert main(given) == 0
    return given


def test_integrators_are_combined_with_draws_in_one_table(words: list[str]) -> None:
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


def test_row_has_the_command_that_reruns_it(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    row = next(read_rows(Path(words[-1])))
    program, *again = shlex.split(row.command)
    assert program == "crosscheck"
    assert main(again) == 0
    output = capsys.readouterr().out
    assert f"ok  #{row.index} {row.name}, {row.integrator}" in output
    assert f"k = {row.constants['k']:.6g}" in output
    assert row.global_error is not None
    assert f"error at dt {percent(row.global_error)}" in output


def test_summary_is_rebuilt_from_the_rows(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    out = Path(words[-1])
    page = (out / "index.html").read_text()
    (out / "index.html").unlink()
    assert main(["sweep", "--summary", str(out)]) == 0
    assert "ok  8 cases agree\n" in capsys.readouterr().out
    assert (out / "index.html").read_text() == page


def test_page_shows_each_row_and_loads_nothing(words: list[str]) -> None:
    out = Path(words[-1])
    plan = read_plan(out)
    assert plan is not None
    rows = list(read_rows(out))
    page = render_sweep(summary(plan, rows))
    for row in rows:
        assert f"<title>#{row.index} {row.name}:" in page
    assert "8 AGREES" in page
    assert "Error at dt over k" in page
    assert not re.search(r"<script|https?://(?!www\.w3\.org)|<link|@import", page)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (["--seed", "1"], "another plan (seed: 0, now 1); choose another --out"),
        (["--vary", "k=9:8"], "9 is not below 8"),
        (["--integrator", "BDF"], "--integrator BDF: no model has it; they have"),
        (["--scenario", "fast"], "--scenario fast: unknown scenario; scenarios are free"),
    ],
)
def test_invalid_arguments_exit_2_with_a_remedy(
    words: list[str], changed: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = words if changed[0] in ("--seed", "--integrator", "--scenario") else words[:2]
    assert main([*before, *changed]) == 2
    assert message in capsys.readouterr().err


def test_folder_without_a_sweep_is_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["sweep", "--summary", str(tmp_path)]) == 2
    assert "there is no plan.json of a sweep in it" in capsys.readouterr().err


Rows = list[dict[str, Any]]


def in_row(number: int, **fields: object) -> Callable[[Rows], None]:
    return lambda rows: rows[number - 1].update(fields)


def repeat(rows: Rows) -> None:
    rows += rows[2:4]


def without(name: str) -> Callable[[Rows], None]:
    """Return damage to every row: a missing column."""

    def damage(rows: Rows) -> None:
        for row in rows:
            row.pop(name)

    return damage


DAMAGE: dict[str, tuple[Callable[[Rows], None], str]] = {
    "contradicts": (
        in_row(3, discrepancy=5.2), "row 3: AGREES contradicts E = 5.2e+00 and U = "),
    "unsure": (in_row(1, uncertainty=0.1), "row 1: AGREES contradicts E = "),
    "unknown": (in_row(2, discrepancy=None), "row 2: AGREES contradicts E = nan and U = "),
    "twice": (repeat, "row 9: case 2 has a row already"),
    "no such case": (
        in_row(8, index=14), "row 8: `index` is 14, where the plan has the cases 0 to 7"),
    "below zero": (in_row(4, index=-6), "row 4: `index` is -6"),
    "no outcome": (in_row(5, outcome="AGREE"), "row 5: Invalid enum value 'AGREE'"),
    "null": (in_row(2, system=None), "row 2: Expected `str`, got `null`"),
    "infinite": (in_row(6, digits=float("inf")), "row 6: `digits` is inf"),
    "no number": (in_row(7, seconds=float("nan")), "row 7: `seconds` is nan"),
    "no column": (without("index"), "row 1: Object missing required field `index`"),
    "no constant": (without("constant_k"), "row 1: it has not the constants of the plan (k)"),
    "another column": (in_row(1, more="1"), "row 1: Object contains unknown field `more`"),
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "resumed"), [*((name, False) for name in DAMAGE), ("contradicts", True)]
)
def test_damaged_rows_are_reported_by_file_and_row(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, resumed: bool
) -> None:
    import pyarrow
    import pyarrow.parquet

    damage, message = DAMAGE[name]
    out = shutil.copytree(words[-1], tmp_path / "sweep")
    (part,) = (out / "rows").glob("*.parquet")
    rows = sorted(pyarrow.parquet.read_table(part).to_pylist(), key=lambda row: row["index"])
    damage(rows)
    pyarrow.parquet.write_table(pyarrow.Table.from_pylist(rows), part)
    arguments = [*words[:-1], str(out)] if resumed else ["sweep", "--summary", str(out)]
    assert main(arguments) == 3
    (line,) = capsys.readouterr().err.splitlines()[-1:]
    assert line.startswith(f"crosscheck: {part}: {message}")
    assert line.endswith("; remove the file to run its cases again")


@pytest.mark.parametrize("content", [b"", b"PAR1", b"PAR1" * 100])
def test_part_that_is_not_parquet_is_reported(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str], content: bytes
) -> None:
    out = shutil.copytree(words[-1], tmp_path / "sweep")
    (part,) = (out / "rows").glob("*.parquet")
    part.write_bytes(content)
    assert main(["sweep", "--summary", str(out)]) == 3
    assert capsys.readouterr().err.startswith(f"crosscheck: {part}: can't be read (")


@pytest.mark.workers
def test_changed_file_read_by_a_declaration_changes_the_plan(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    system, mass = swept_folder(tmp_path / "mass", "mujoco.xml"), tmp_path / "mass" / ".mass"
    mass.write_text("1")
    text = (system / "system.py").read_text()
    (system / "system.py").write_text(f"open({str(mass)!r}, 'r+').read()\n{text}")
    given = ["sweep", str(system), "--vary", "k=20:200", "--draws", "1"]
    given += ["--out", str(tmp_path / "s")]
    assert main(given) == 0
    assert main(given) == 0
    capsys.readouterr()
    mass.write_text("2")
    assert main(given) == 2
    assert f"files of {system} have changed" in capsys.readouterr().err


__all__ = ["place"]


def settings(folder: Path, text: str) -> None:
    (folder / "pyproject.toml").write_text(f"[project]\nname = 'x'\n{text}")


def parsed(name: str, *given: str) -> argparse.Namespace:
    command = CommandParser()
    command.declare(COMMANDS[name])
    apply(command, COMMANDS[name].settings)
    return command.parse_args(given)


def test_arguments_override_settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    settings(
        tmp_path,
        "[tool.crosscheck]\nengines = ['one', 'two']\nresolution = 1e-7\nlimit = 90\n"
        "memory = 2\njobs = 3\nstrict = true\nout = 'found'\nbaseline = 'kept'\n",
    )
    options = parsed("run")
    assert (options.engines, options.resolution, options.limit) == (["one", "two"], 1e-7, 90.0)
    assert (options.memory, options.jobs, options.strict) == (2.0, 3, True)
    assert (options.out, options.baseline) == (Path("found"), Path("kept"))
    overridden = parsed("run", "--engine", "three", "--engine", "four", "--jobs", "1")
    assert (overridden.engines, overridden.jobs) == (["three", "four"], 1)
    # A gate writes elsewhere.
    other = parsed("gate")
    assert (other.out, other.baseline) == (Path("reports/gate"), Path("kept"))


def test_settings_of_a_parent_folder_apply_with_its_paths(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    below = tmp_path / "tools" / "deep"
    below.mkdir(parents=True)
    (tmp_path / "arms").mkdir()
    monkeypatch.chdir(below)
    (tmp_path / ".git").mkdir()
    settings(tmp_path, "[tool.crosscheck]\nfolders = ['arms', 'simple_pendulum']\nout = 'found'\n")
    (tmp_path / "tools" / "pyproject.toml").write_text("[tool.other]\nresolution = 1\n")
    options = parsed("run")
    assert options.folders == ["../../arms", "simple_pendulum"]
    assert options.out == Path("../../found")
    assert parsed("run", "mine").folders == ["mine"]
    assert parsed("list").folders == options.folders


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "resolutoin = 1e-9",
            "unknown setting 'resolutoin'. Did you mean resolution? Settings: folders, engines,",
        ),
        ("resolution = 2.0", "resolution must be a number between 1e-13 and 1e-2, not 2.0"),
        ("resolution = 'fine'", 'resolution must be a number, not "fine"'),
        ("jobs = true", "jobs must be a number, not true"),
        ("jobs = 1.5", "jobs must be a whole number above 0, not 1.5"),
        ("engines = 'one'", 'engines must be a list of names, not "one"'),
        ("strict = 1", "strict must be true or false, not 1"),
        ("out = ''", 'out must be a path, not ""'),
        (
            "out = '../found'",
            "pyproject.toml:4: [tool.crosscheck] out must be inside the folder of pyproject.toml",
        ),
        (
            "jobs = 2\ncache = '/tmp/kept'",
            "pyproject.toml:5: [tool.crosscheck] cache must be inside",
        ),
        ("baseline = 'link/kept'", 'not "link/kept". Use the option instead.'),
        (
            "scheduler = 'tcp://there:8786'",
            "pyproject.toml:4: [tool.crosscheck] scheduler is not allowed",
        ),
        ("scheduler = 'tcp://there:8786'", "Use --scheduler ADDRESS, or set CROSSCHECK_SCHEDULER"),
    ],
)
def test_invalid_setting_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "link").symlink_to(tmp_path.parent)
    settings(tmp_path, f"[tool.crosscheck]\n{text}\n")
    with pytest.raises(SettingsError) as error:
        parsed("run")
    assert str(error.value).startswith("pyproject.toml:")
    assert message in str(error.value)


def test_settings_above_the_repository_are_ignored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    inner = tmp_path / "repository" / "robots"
    inner.mkdir(parents=True)
    settings(tmp_path, "[tool.crosscheck]\nscheduler = 'tcp://there:8786'\n")
    monkeypatch.chdir(inner)
    assert parsed("run").jobs == 0  # no repository: only the working folder
    (inner.parent / ".git").write_text("gitdir: elsewhere\n")  # as in a work tree
    assert parsed("run").jobs == 0
    settings(inner.parent, "[tool.crosscheck]\njobs = 3\n")
    assert parsed("run").jobs == 3


def test_settings_of_another_user_are_ignored_with_a_note(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    settings(tmp_path, "[tool.crosscheck]\nscheduler = 'tcp://there:8786'\njobs = 3\n")
    monkeypatch.setattr(os, "geteuid", lambda: (tmp_path / "pyproject.toml").stat().st_uid + 1)
    options = parsed("run")
    assert options.jobs == 0
    (note,) = options.settings_notes
    assert note.startswith("ignoring settings in pyproject.toml, since it belongs to another")


def test_scheduler_comes_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CROSSCHECK_SCHEDULER", "tcp://there:8786")
    assert parsed("run").scheduler == "tcp://there:8786"
    assert parsed("run", "--scheduler", "tcp://here:1").scheduler == "tcp://here:1"


def test_command_line_uses_settings_and_reports_an_invalid_one(place: Path) -> None:
    settings(place, "[tool.crosscheck]\nfolders = ['models']\n")
    done = crosscheck(place, "list")
    assert len(done.stdout.splitlines()) == 4
    assert done.stderr.splitlines()[0] == "crosscheck: settings from pyproject.toml"
    assert "Defaults from pyproject.toml: folders." in crosscheck(place, "list", "--help").stdout
    settings(place, "[tool.crosscheck]\nfolders = ['models']\n")
    assert len(crosscheck(place, "list").stdout.splitlines()) == 4
    settings(place, "[tool.crosscheck]\nfolder = ['models']\n")
    done = crosscheck(place, "run")
    assert done.returncode == 2
    assert done.stderr.startswith("crosscheck: pyproject.toml:4: [tool.crosscheck] unknown setting")
    (place / "pyproject.toml").write_text("[tool\n")
    done = crosscheck(place, "run")
    assert (done.returncode, "Traceback" in done.stderr) == (2, False)
    assert "pyproject.toml: cannot be read: " in done.stderr


def test_gate_without_a_baseline_takes_the_targets_of_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("models/arm", "others/leg"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "system.py").touch()
    monkeypatch.chdir(tmp_path)

    def folders(name: str, *given: str) -> list[str]:
        return [path.as_posix() for path in targets_and_options(parsed(name, *given))[0]]

    reason = ("--reason", "right")
    assert folders("gate") == folders("accept", *reason) == ["models/arm", "others/leg"]
    settings(tmp_path, "[tool.crosscheck]\nfolders = ['others']\n")
    assert folders("gate") == folders("accept", *reason) == ["others/leg"]
    assert folders("accept", *reason, "--folder", "models") == ["models/arm"]


def test_accept_of_a_named_target_ignores_the_folder_setting(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("models", "others"):
        (tmp_path / name).mkdir()
    monkeypatch.chdir(tmp_path)
    settings(tmp_path, "[tool.crosscheck]\nfolders = ['others']\n")
    for given, folders, patterns in (
        (["models"], ["models"], []),
        (["models", "--folder", "others"], ["others", "models"], []),
        (["*/case"], ["others"], ["*/case"]),
    ):
        options = parsed("accept", "--reason", "right", *given)
        assert separate_patterns(options) == patterns
        assert options.folders == folders


def test_codes_that_mean_a_missing_test_cannot_be_ignored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    settings(tmp_path, "[tool.crosscheck]\nignore = ['xc1', 'XC207']\n")
    assert parsed("audit", "a").ignore == ("XC1", "XC207")
    for code, words in (("XC613", "cannot be ignored"), ("XC9", "no code begins")):
        settings(tmp_path, f"[tool.crosscheck]\nignore = ['{code}']\n")
        with pytest.raises(SettingsError, match=rf"pyproject.toml:4: .*{words}"):
            parsed("run")
