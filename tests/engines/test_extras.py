"""Engines of extras: their installation, refusals, and cases of built-in systems."""

import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from physics_crosscheck import check
from physics_crosscheck.harness.commands.gate.survey import survey
from physics_crosscheck.harness.engines.pinocchio import PinocchioEngine
from physics_crosscheck.harness.engines.registry import engines, engines_reading, engines_to_run
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.modelfiles.folders import FolderError, check_engines
from physics_crosscheck.harness.modelfiles.model_files import absent_engine_lines
from physics_crosscheck.harness.modelfiles.sidecar import SidecarError, read_sidecar
from physics_crosscheck.harness.run import Options
from physics_crosscheck.records import Outcome
from tests.engines.extras import need
from tests.faults.known_folder import environment
from tests.installed.documents import ROOT, check_shown, commands
from tests.standing import shorten_scenarios

MODELS = Path(__file__).parents[2] / "models"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a pendulum's URDF for MuJoCo and Pinocchio."""
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
def test_missing_engines_are_dropped_from_a_sidecar_and_reported(folder: Path) -> None:
    sidecar = read_sidecar(folder / "robot.urdf.toml")
    assert (sidecar.engines, sidecar.absent) == (("mujoco",), ("pinocchio",))
    assert absent_engine_lines([folder]) == [
        "pinocchio: not installed; pip install 'physics-crosscheck[pinocchio]'"
        " (1 model file could run in it too)"
    ]
    assert "pinocchio" not in [engine.name for engine in engines_to_run(".urdf")]


def test_installed_engines_run(folder: Path) -> None:
    assert engines()["pinocchio"].version() is not None
    sidecar = read_sidecar(folder / "robot.urdf.toml")
    assert (sidecar.engines, sidecar.absent) == (("mujoco", "pinocchio"), ())
    assert "pinocchio" not in "".join(absent_engine_lines([folder]))


@pytest.mark.usefixtures("absent")
def test_settings_of_a_missing_engine_require_its_name(folder: Path) -> None:
    _write(folder, '["mujoco", "pinocchio"]', "[settings.pinocchio]\nstep = 0.01\n")
    read_sidecar(folder / "robot.urdf.toml")
    _write(folder, '["mujoco"]', "[settings.pinocchio]\nstep = 0.01\n")
    with pytest.raises(SidecarError, match="pinocchio"):
        read_sidecar(folder / "robot.urdf.toml")


@pytest.mark.slow
@pytest.mark.usefixtures("absent")
def test_model_without_installed_engines_is_absent(folder: Path) -> None:
    _write(folder, '["pinocchio"]')
    results = check(folder)
    assert {case.outcome for case in results.cases} == {Outcome.ABSENT}
    assert "pip install 'physics-crosscheck[pinocchio]'" in results.cases[0].reason


@pytest.mark.usefixtures("absent")
def test_requested_missing_engine_is_an_error_with_its_install_command() -> None:
    with pytest.raises(FolderError, match=r"pip install 'physics-crosscheck\[pinocchio\]'"):
        check_engines(["pinocchio"])


@pytest.mark.usefixtures("absent")
def test_list_of_engines_shows_install_commands(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["engines"]) == 0
    output = capsys.readouterr().out
    assert "pinocchio  not installed " in output
    assert "pip install 'physics-crosscheck[pinocchio]'\n" in output


@pytest.mark.usefixtures("absent")
def test_gate_keeps_accepted_results_of_missing_engines(tmp_path: Path) -> None:
    names = ("pinocchio", "mujoco", "pybullet")
    state = survey([], Options(baseline=tmp_path))
    assert [name for name in names if not state.includes(name)] == ["pinocchio"]
    state = survey([], Options(baseline=tmp_path, engines=("mujoco",)))
    assert [name for name in names if not state.includes(name)] == ["pinocchio", "pybullet"]


def test_default_engines_are_not_extras() -> None:
    extras = {name for name, one in engines().items() if one.extra}
    assert extras >= {"pinocchio", "drake", "dart", "newton", "mjx"}
    assert not {"mujoco", "pybullet", "pymunk"} & extras


@pytest.mark.slow
@pytest.mark.usefixtures("absent")
def test_run_reports_missing_engines_once(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder.parent)
    shorten_scenarios(folder)
    assert main(["run", str(folder), "--resolution", "1e-6", "-v"]) == 0
    output = capsys.readouterr()
    assert output.err.count("crosscheck: not installed: pinocchio") == 1
    assert "[pinocchio]" not in output.out


def test_slow_compiling_engines_run_only_on_request() -> None:
    registered = engines()
    assert registered["mjx"].on_request
    for suffix in (".urdf", ".xml"):
        assert "mjx" not in [engine.name for engine in engines_to_run(suffix)]
        assert "mjx" in [engine.name for engine in engines_reading(suffix)]


CROSSCHECK = f'crosscheck() {{ {shlex.quote(sys.executable)} -m physics_crosscheck "$@"; }}\n'


def test_constraint_that_drake_ignores_is_reported_as_on_the_page(tmp_path: Path) -> None:
    need("drake")
    shutil.copy(ROOT / "docs" / "cases" / "fingers.urdf", tmp_path)
    _, excepted = commands((ROOT / "docs" / "cases.md").read_text())
    (last,) = (i for i, one in enumerate(excepted) if one.text == "crosscheck run hand")
    for command in excepted[last - 3 : last + 1]:
        done = subprocess.run(
            ["bash", "-c", CROSSCHECK + command.text],
            cwd=tmp_path,
            env=environment(),
            capture_output=True,
            text=True,
            timeout=600,
            check=False,
        )
        assert done.returncode == command.code, done.stdout + done.stderr
        check_shown(command, done.stdout)
    assert len(excepted[last].shown) == 4
