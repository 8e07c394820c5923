"""Comparison of two versions in real environments of `venv` and `pip`, each in its own process.

The engine is the toy engine of docs/engines/adapter.md, installed from wheels in a folder without
a package index. This package is installed too; `test_mujoco_versions.py` runs from the checkout.
"""

import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path

import pytest

from physics_crosscheck.harness.extras.versions.main import (
    VersionError,
    interpreter,
    requested_targets,
    requested_versions,
    site_folders,
)
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.modelfiles.folders import FolderError
from physics_crosscheck.harness.records.baseline import Gate
from physics_crosscheck.harness.records.read import decoded
from physics_crosscheck.records import Outcome
from tests.faults.known_folder import ROOT, SYSTEM

PAGE = (ROOT / "docs" / "engines" / "adapter.md").read_text(encoding="utf-8")
TOY = 'names = ["x"]\nm = [1.3]\nc = [0.9]\nk = [47.0]\nstep = 0.005\n'
POINTS = "[crosscheck.engines]\ntoy = toy_engine:ToyEngine\n"


def engine(version: str, old: str = "", new: str = "") -> str:
    """Return the toy engine's module with a version and a replaced text."""
    (text,) = re.findall(r"^```python\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
    text = text.replace('return "1.0"', f'return "{version}"')
    assert old in text
    return str(text.replace(old, new)) if old else str(text)


def files(version: str, module: str) -> dict[str, str]:
    """Return the files of a distribution of the toy engine."""
    info = f"toy-{version}.dist-info"
    return {
        "toy_engine.py": module,
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: toy\nVersion: {version}\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nGenerator: t\nRoot-Is-Purelib: true\n"
        "Tag: py3-none-any\n",
        f"{info}/entry_points.txt": POINTS,
        f"{info}/RECORD": "",
    }


@dataclass(frozen=True)
class Home:
    """An environment with this package and toy engine 1.0, and a wheel of toy engine 2.0.

    `own` is an environment that a user made for version 3.0.
    """

    place: Path

    def versions(self, *words: str | Path) -> subprocess.CompletedProcess[str]:
        return self.run("versions", *words)

    def run(self, *words: str | Path) -> subprocess.CompletedProcess[str]:
        clean = {k: v for k, v in os.environ.items() if not k.startswith(("PIP_", "PYTHON"))}
        return subprocess.run(
            [self.place / "home" / "bin" / "python", "-m", "physics_crosscheck", *words],
            cwd=self.place,
            capture_output=True,
            text=True,
            timeout=1800,
            check=False,
            env={
                **clean,
                "PIP_NO_INDEX": "1",
                "PIP_FIND_LINKS": str(self.place / "wheels"),
                "XDG_CACHE_HOME": str(self.place / "cache"),
                "CI": "1",
            },
        )


def create_environment(place: Path, version: str) -> Path:
    """Create an environment with a version of the toy engine; return its package folder."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(place)], check=True)
    (site,) = place.rglob("site-packages")
    for name, text in files(version, engine(version)).items():
        (site / name).parent.mkdir(exist_ok=True)
        (site / name).write_text(text)
    return site


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Home:
    place = tmp_path_factory.mktemp("versions")
    site, _ = create_environment(place / "home", "1.0"), create_environment(place / "own", "3.0")
    lines = [f"import site; site.addsitedir({folder!r})" for folder in site_folders()]
    (site / "dependencies.pth").write_text("\n".join(lines) + "\n")
    shutil.copytree(ROOT / "physics_crosscheck", site / "physics_crosscheck")
    (place / "wheels").mkdir()
    stiffer = engine("2.0", "- self._k * q", "- 1.001 * self._k * q")
    with zipfile.ZipFile(place / "wheels" / "toy-2.0-py3-none-any.whl", "w") as archive:
        for name, text in files("2.0", stiffer).items():
            archive.writestr(name, text)
    folder = place / "oscillator"
    folder.mkdir()
    (folder / "system.py").write_text(SYSTEM.replace("duration=1.0", "duration=0.5"))
    (folder / "good.toy").write_text(TOY)
    (folder / "good.toy.toml").write_text('engines = ["toy"]\n')
    return Home(place)


@pytest.fixture(scope="module")
def done(home: Home) -> subprocess.CompletedProcess[str]:
    return home.versions("oscillator", "--engine", "toy", "1.0", "2.0", "3.0=own")


def gate_of(home: Home, version: str) -> Gate:
    path = home.place / "reports" / "versions" / f"toy-{version}" / "gate.json"
    return decoded(path.read_bytes(), Gate)


@pytest.mark.release
def test_change_and_its_reversal_are_reported(
    home: Home, done: subprocess.CompletedProcess[str]
) -> None:
    assert done.returncode == 1, done.stdout + done.stderr
    for version, outcomes in (
        ("2.0", (Outcome.AGREES, Outcome.DIFFERS)),
        ("3.0", (Outcome.DIFFERS, Outcome.AGREES)),
    ):
        cases = gate_of(home, version).cases
        assert {case.scenario for case in cases} == {"free", "driven"}
        for case in cases:
            assert case.outcomes == outcomes
            assert case.moved is not None
            assert 1e-5 < case.moved < 1e-2
    assert "toy 1.0 -> 2.0\nFAIL  toy 1.0 -> toy 2.0 changed 2 of 2 cases" in done.stdout
    assert "toy 2.0 -> 3.0\nok  " in done.stdout
    assert "improved  XC504 oscillator/good.toy" in done.stdout
    assert "crosscheck accept" not in done.stdout


@pytest.mark.release
def test_missing_environment_is_created_and_user_environment_is_used(
    home: Home, done: subprocess.CompletedProcess[str]
) -> None:
    assert done.stdout.count("its environment is made, once") == 1
    wrong = home.versions("oscillator", "--engine", "toy", "2.5=own", "1.0")
    assert wrong.returncode == 3
    assert wrong.stderr.strip().endswith("it has toy 3.0")
    (site,) = (home.place / "own").rglob("site-packages")
    (site / "toy.py").write_text("raise ImportError('built for numpy 1')")
    broken = home.versions("oscillator", "--engine", "toy", "3.0=own", "1.0")
    assert broken.returncode == 3
    assert broken.stderr.strip().endswith("with the packages here: built for numpy 1")


@pytest.mark.release
def test_unavailable_version_is_reported_before_running(home: Home) -> None:
    missing = home.versions("oscillator", "--engine", "toy", "1.0", "9.9", "--out", "nothing")
    assert missing.returncode == 3
    (line,) = missing.stderr.strip().splitlines()
    assert line.startswith("crosscheck: toy 9.9 can't be installed: ERROR: ")
    assert "toy==9.9" in line
    assert "pip index versions toy" in line
    assert not (home.place / "nothing").exists()
    assert not list((home.place / "cache").rglob("toy-9.9-*/"))


@pytest.mark.parametrize("version", ["2.0", "9.9"])
def test_uv_provides_a_version(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, version: str
) -> None:
    uv = tmp_path / "uv"
    uv.write_text('#!/bin/sh\ncase "$*" in *9.9*) echo error: no 9.9; exit 1;; esac\nexit 0\n')
    uv.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    if version == "9.9":
        with pytest.raises(VersionError, match=r"pymunk 9.9 can't be installed: error: no 9.9"):
            interpreter("pymunk", version, None, tmp_path)
        return
    command = interpreter("pymunk", version, None, tmp_path)
    assert command[:4] == [str(uv), "run", "--no-project", "--isolated"]
    assert "pymunk==2.0" in command
    assert f"numpy=={importlib.metadata.version('numpy')}" in command
    assert command[-1] == "python"


def test_versions_and_user_environments_are_parsed_in_order(tmp_path: Path) -> None:
    name, versions = requested_versions(["pymunk", "7.0", f"7.1.0={tmp_path}"])
    assert name == "pymunk"
    assert versions == {"7.0": None, "7.1.0": tmp_path}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["pymunk", "7.0"], "name two versions of it or more"),
        (["pymunk"], "name two versions of it or more"),
        (["pymunk", "7.0", "7.0"], "7.0 is asked for twice"),
        (["nobody", "1", "2"], "no engine 'nobody' is known"),
        (
            ["pymunk", "7.0", "7.1", "my/folder"],
            "my/folder is not a version; folders and files come",
        ),
        (["pymunk", "7.0", "--pre"], "--pre is not a version"),
        (["pymunk", "7.0", "7.1=nowhere/at/all"], "there is no such environment"),
    ],
)
def test_invalid_arguments_are_rejected(words: list[str], message: str) -> None:
    with pytest.raises(FolderError, match=re.escape(message)):
        requested_versions(words)


def folder(place: Path, engine: str) -> Path:
    place.mkdir()
    (place / "system.py").write_text(SYSTEM)
    (place / "robot.urdf").write_text("<robot/>")
    (place / "robot.urdf.toml").write_text(f'engines = ["{engine}"]\n')
    return place


def test_targets_that_the_engine_does_not_run_are_reported(tmp_path: Path) -> None:
    mine, other = folder(tmp_path / "mine", "pymunk"), folder(tmp_path / "other", "pybullet")
    robot = tmp_path / "arm.urdf"
    robot.write_text("<robot/>")
    targets, left_out = requested_targets("pymunk", [str(mine), str(other), str(robot)])
    assert targets == [mine]
    assert left_out == [
        f"{other}: no model of it names pymunk; left out",
        f"{robot}: pymunk reads no .urdf files; left out",
    ]


def test_folder_with_unreadable_sidecar_is_kept(tmp_path: Path) -> None:
    mine = folder(tmp_path / "mine", "pymunk")
    (mine / "robot.urdf.toml").write_text("engines =\n")
    assert requested_targets("pybullet", [str(mine)]) == ([mine], [])


def test_no_remaining_target_is_a_usage_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = folder(tmp_path / "other", "pybullet")
    assert main(["versions", str(other), "--engine", "pymunk", "7.0", "7.1"]) == 2
    assert "no model of it names pymunk" in capsys.readouterr().err
    assert main(["versions", "nowhere", "--engine", "pymunk", "7.0", "7.1"]) == 2
    assert main(["versions", "nowhere.urdf", "--engine", "pymunk", "7.0", "7.1"]) == 2
