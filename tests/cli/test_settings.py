"""Settings of a project are defaults of the command line; an invalid one is named."""

import argparse
import os
from pathlib import Path

import pytest

from physics_crosscheck.harness.interfaces.cli.accept import separate_patterns
from physics_crosscheck.harness.interfaces.cli.commands import COMMANDS
from physics_crosscheck.harness.interfaces.cli.gate import targets_and_options
from physics_crosscheck.harness.interfaces.cli.help import CommandParser
from physics_crosscheck.harness.interfaces.cli.settings import SettingsError, apply
from tests.cli.test_choosing import crosscheck, place

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
