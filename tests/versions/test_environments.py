"""Environments: created once by commands that are printed, reused, and never left incomplete."""

from __future__ import annotations

import importlib.metadata
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from physics_crosscheck.harness.extras.versions.environments import (
    READY,
    EnvironmentError_,
    Requirement,
    environment,
    folder_name,
    interpreter,
)

WANTED = Requirement(engine="e", distribution="the-engine", version="1.2")

UV = """#!{python}
import json, os, pathlib, sys
words = sys.argv[1:]
if words[:1] == ["--directory"]:
    os.chdir(words[1])
    words = words[2:]
with open({log!r}, "a") as log:
    print(json.dumps(words), file=log)
if words[0] == "venv":
    python = pathlib.Path(words[-1], "bin", "python")
    python.parent.mkdir(parents=True)
    python.touch()
elif words[1] == "compile":
    pins = pathlib.Path(words[-1])
    wanted = pathlib.Path(words[-3]).read_text()
    if "2.0" in wanted:
        sys.exit("error: No solution found when resolving dependencies:\\n  because of that")
    preferred = [line for line in pins.read_text().splitlines() if line.startswith("numpy==")]
    pins.write_text("\\n".join([*preferred, "a-dependency==3", wanted]))
    print("Resolved 3 packages")
"""
"""An executable in place of uv, which logs its arguments."""


@pytest.fixture(autouse=True)
def programs(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Make an empty folder the only one on `PATH`."""
    folder = tmp_path_factory.mktemp("programs")
    monkeypatch.setenv("PATH", str(folder))
    return folder


@pytest.fixture
def uv_log(programs: Path) -> Path:
    """Install a fake uv, and return its log."""
    log = programs / "log"
    (programs / "uv").write_text(UV.format(python=sys.executable, log=str(log)))
    (programs / "uv").chmod(0o755)
    return log


class Installer:
    """Fake `venv` and `pip` that create an interpreter, and fail or stop on request."""

    def __init__(self, fails: str = "", output: str = "", stops: bool = False) -> None:
        self.fails, self.output, self.stops = fails, output, stops
        self.commands: list[list[str]] = []

    def __call__(self, command: Sequence[str]) -> tuple[int, str]:
        self.commands.append(list(command))
        if command[2] == "venv":
            python = interpreter(Path(command[-1]))
            python.parent.mkdir(parents=True)
            python.touch()
        if command[2] == self.fails:
            if self.stops:
                raise KeyboardInterrupt
            return 1, self.output
        return 0, ""


def create(parent: Path, installer: Installer) -> tuple[Path, list[str]]:
    """Create an environment; return its folder and the printed lines."""
    lines: list[str] = []
    return environment(WANTED, parent, lines.append, installer), lines


def test_commands_are_printed_before_they_run(tmp_path: Path) -> None:
    installer = Installer()
    place, lines = create(tmp_path, installer)
    python = str(interpreter(place))
    assert installer.commands == [
        [sys.executable, "-m", "venv", "--without-pip", str(place)],
        [python, "-m", "pip", "install", "--disable-pip-version-check", "the-engine==1.2"],
    ]
    assert [line.strip() for line in lines[1::2]] == [" ".join(c) for c in installer.commands]
    assert lines[2].startswith("  echo 'import site; site.addsitedir(")
    (path_file,) = place.rglob("*.pth")
    assert path_file.read_text().strip() in lines[2]


def test_environment_gets_pip_if_this_interpreter_has_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    installer = Installer()
    place, _ = create(tmp_path, installer)
    assert installer.commands[0] == [sys.executable, "-m", "venv", str(place)]


def test_environment_is_reused(tmp_path: Path) -> None:
    first, _ = create(tmp_path, Installer())
    again = Installer()
    place, lines = create(tmp_path, again)
    assert (place, again.commands) == (first, [])
    assert lines == [f"e 1.2: in {place}"]


@pytest.mark.parametrize("fails", ["venv", "pip"])
def test_failed_creation_leaves_no_folder(tmp_path: Path, fails: str) -> None:
    text = "Collecting it\nERROR: No matching distribution found for the-engine==1.2\n\nhint: none"
    with pytest.raises(EnvironmentError_) as raised:
        create(tmp_path, Installer(fails=fails, output=text))
    message = str(raised.value)
    assert message.startswith(
        "e 1.2 can't be installed: ERROR: No matching distribution found for the-engine==1.2; "
    )
    assert "pip index versions the-engine" in message
    assert "1.2=path/to/venv" in message
    assert [path for path in tmp_path.iterdir() if path.is_dir()] == []


def test_interrupted_creation_leaves_no_folder(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        create(tmp_path, Installer(fails="pip", stops=True))
    assert [path for path in tmp_path.iterdir() if path.is_dir()] == []


def test_incomplete_environment_is_recreated(tmp_path: Path) -> None:
    place, _ = create(tmp_path, Installer())
    (place / READY).unlink()
    (place / "half").touch()
    again = Installer()
    create(tmp_path, again)
    assert len(again.commands) == 2
    assert not (place / "half").exists()
    assert (place / READY).is_file()


def test_environment_without_its_python_is_recreated(tmp_path: Path) -> None:
    place, _ = create(tmp_path, Installer())
    interpreter(place).unlink()
    again = Installer()
    create(tmp_path, again)
    assert len(again.commands) == 2


def test_folder_name_depends_on_the_installed_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    name = folder_name(WANTED)
    assert name.startswith(f"the-engine-1.2-py{sys.version_info[0]}.{sys.version_info[1]}-")
    assert folder_name(WANTED) == name
    monkeypatch.setattr("importlib.metadata.distributions", list)
    assert folder_name(WANTED) != name


def test_uv_installs_only_missing_packages(tmp_path: Path, uv_log: Path) -> None:
    lines: list[str] = []
    place = environment(WANTED, tmp_path, lines.append)
    venv, resolve, install = map(json.loads, uv_log.read_text().splitlines())
    assert venv == ["venv", "--python", sys.executable, str(place)]
    assert resolve[:2] == ["pip", "compile"]
    python = str(interpreter(place))
    missing = ["a-dependency==3", "the-engine==1.2"]  # and not numpy, which is here
    assert install == ["pip", "install", "--no-deps", "--python", python, *missing]
    assert f"numpy=={importlib.metadata.version('numpy')}" in (place / "pins.txt").read_text()
    (path_file,) = place.rglob("*.pth")
    assert "site.addsitedir(" in path_file.read_text()
    environment(WANTED, tmp_path, lines.append)
    assert len(uv_log.read_text().splitlines()) == 3
    assert sum(line.startswith(f"  {uv_log.parent / 'uv'} ") for line in lines) == 3


@pytest.mark.usefixtures("uv_log")
def test_uv_error_is_reported_and_leaves_no_folder(tmp_path: Path) -> None:
    with pytest.raises(EnvironmentError_, match=r"e 2\.0 can't be installed: error: No solution"):
        environment(
            Requirement(engine="e", distribution="the-engine", version="2.0"),
            tmp_path,
            lambda _: None,
        )
    assert [path for path in tmp_path.iterdir() if path.is_dir()] == []
