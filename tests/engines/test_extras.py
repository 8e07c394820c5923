"""Engines of extras: a sidecar that names them runs without them where they aren't installed."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from physics_crosscheck import check
from physics_crosscheck.harness.commands.gate.survey import GateOptions, survey
from physics_crosscheck.harness.engines.pinocchio import PinocchioEngine
from physics_crosscheck.harness.engines.registry import (
    absent_extras,
    engines,
    engines_reading,
    engines_to_run,
)
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.modelfiles.folders import FolderError, check_engines
from physics_crosscheck.harness.modelfiles.model_files import absent_engine_lines
from physics_crosscheck.harness.modelfiles.sidecar import SidecarError, read_sidecar
from physics_crosscheck.harness.records.outcome import Outcome
from tests.standing import brief

MODELS = Path(__file__).parents[2] / "models"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A pendulum's URDF, of MuJoCo and Pinocchio."""
    folder = tmp_path / "pendulum"
    folder.mkdir()
    for name in ("system.py", "robot.urdf"):
        shutil.copy(MODELS / "simple_pendulum" / name, folder)
    _write(folder, '["mujoco", "pinocchio"]')
    return folder


def _write(folder: Path, names: str, settings: str = "") -> None:
    common = "[settings]\nstep = 0.002\ngravity = [0, 0, -9.81]\n"
    (folder / "robot.urdf.toml").write_text(f"engines = {names}\n{common}{settings}")


@pytest.fixture
def absent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(PinocchioEngine, "version", lambda _: None)


@pytest.mark.usefixtures("absent")
def test_what_is_absent_is_left_out_of_a_sidecar_and_told(folder: Path) -> None:
    sidecar = read_sidecar(folder / "robot.urdf.toml")
    assert (sidecar.engines, sidecar.absent) == (("mujoco",), ("pinocchio",))
    assert absent_engine_lines([folder]) == [
        "pinocchio: not installed; pip install 'physics-crosscheck[pinocchio]'"
        " (1 model file could run in it too)"
    ]
    assert "pinocchio" not in [engine.name for engine in engines_to_run(".urdf")]


def test_what_is_there_is_run(folder: Path) -> None:
    assert engines()["pinocchio"].version() is not None
    sidecar = read_sidecar(folder / "robot.urdf.toml")
    assert (sidecar.engines, sidecar.absent) == (("mujoco", "pinocchio"), ())
    assert "pinocchio" not in "".join(absent_engine_lines([folder]))


@pytest.mark.usefixtures("absent")
def test_settings_of_what_is_absent_are_none_of_a_stranger(folder: Path) -> None:
    _write(folder, '["mujoco", "pinocchio"]', "[settings.pinocchio]\nstep = 0.01\n")
    read_sidecar(folder / "robot.urdf.toml")
    _write(folder, '["mujoco"]', "[settings.pinocchio]\nstep = 0.01\n")
    with pytest.raises(SidecarError, match="pinocchio"):
        read_sidecar(folder / "robot.urdf.toml")


@pytest.mark.slow
@pytest.mark.usefixtures("absent")
def test_where_nothing_else_runs_a_model_it_is_absent(folder: Path) -> None:
    _write(folder, '["pinocchio"]')
    found = check(folder)
    assert {case.outcome for case in found.cases} == {Outcome.ABSENT}
    assert "pip install 'physics-crosscheck[pinocchio]'" in found.cases[0].reason


@pytest.mark.usefixtures("absent")
def test_an_absent_engine_that_is_asked_for_is_refused_with_what_installs_it() -> None:
    with pytest.raises(FolderError, match=r"pip install 'physics-crosscheck\[pinocchio\]'"):
        check_engines(["pinocchio"])


@pytest.mark.usefixtures("absent")
def test_the_list_of_engines_tells_what_installs_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["engines"]) == 0
    told = capsys.readouterr().out
    assert "pinocchio  not installed " in told
    assert "pip install 'physics-crosscheck[pinocchio]'\n" in told


@pytest.mark.usefixtures("absent")
def test_a_gate_leaves_what_was_accepted_of_it(tmp_path: Path) -> None:
    names = ("pinocchio", "mujoco", "pybullet")
    state = survey([], GateOptions(baseline=tmp_path))
    assert [name for name in names if not state.includes(name)] == ["pinocchio"]
    state = survey([], GateOptions(baseline=tmp_path, engines=("mujoco",)))
    assert [name for name in names if not state.includes(name)] == ["pinocchio", "pybullet"]


def test_standing_engines_are_no_extras() -> None:
    extras = {name for name, one in engines().items() if one.extra}
    assert extras >= {"pinocchio", "drake", "dart", "newton", "mjx"}
    assert not {"mujoco", "pybullet", "pymunk"} & set(absent_extras())


@pytest.mark.slow
@pytest.mark.usefixtures("absent")
def test_the_line_is_told_once_where_a_run_ends(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder.parent)
    brief(folder)
    assert main(["run", str(folder), "--resolution", "1e-6", "-v"]) == 0
    told = capsys.readouterr()
    assert told.err.count("crosscheck: not installed: pinocchio") == 1
    assert "[pinocchio]" not in told.out


def test_a_file_alone_runs_on_request_in_what_compiles_it_for_minutes() -> None:
    named = engines()
    assert named["mjx"].on_request
    for suffix in (".urdf", ".xml"):
        assert "mjx" not in [engine.name for engine in engines_to_run(suffix)]
        assert "mjx" in [engine.name for engine in engines_reading(suffix)]
