"""A folder of an SDFormat file: its bodies, and the settings of its world."""

import tomllib
from pathlib import Path

import pytest

from physics_crosscheck import MultibodySystem
from physics_crosscheck.harness.checks.case import judge
from physics_crosscheck.harness.checks.prepare import PreparedTree, prepare
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.commands.scaffold.from_model import from_model
from physics_crosscheck.harness.engines.registry import default_engines, engines
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.records import Outcome
from physics_crosscheck.reference.load import load_declaration
from tests.models import edited
from tests.robots.test_sdf import ARM, BASE, WELD, joint

WORLD = "<gravity>0 0 -3.7</gravity><physics><max_step_size>0.004</max_step_size></physics>"


def write_folder(folder: Path, world: str = "") -> Path:
    model = f"<model name='m'>{WELD}{BASE}{ARM}{joint()}</model>"
    # Engines differ about rotated inertials.
    model = model.replace("0.1 0.2 -0.5 0.3 0.2 0.1", "0.1 0.2 -0.5 0 0 0")
    inner = f"<world name='w'>{world}{model}</world>" if world else model
    file = folder / "robot.sdf"
    file.write_text(f"<sdf version='1.6'>{inner}</sdf>")
    from_model(file, folder / "made")
    return folder / "made"


def settings(folder: Path) -> dict[str, object]:
    values: dict[str, object] = tomllib.loads((folder / "robot.sdf.toml").read_text())["settings"]
    return values


def test_default_settings_are_written_without_a_world(tmp_path: Path) -> None:
    folder = write_folder(tmp_path)
    system = load_declaration(folder)
    assert isinstance(system, MultibodySystem)
    assert [joint.name for body in system.bodies for joint in body.joints] == ["q"]
    values = settings(folder)
    assert (values["step"], values["gravity"]) == (0.002, [0.0, 0.0, -9.81])
    assert read_sidecar(folder / "robot.sdf.toml").engines == tuple(
        engine.name for engine in default_engines(".sdf")
    )


def test_settings_of_a_world_are_written_once(tmp_path: Path) -> None:
    folder = write_folder(tmp_path, WORLD)
    values = settings(folder)
    assert (values["step"], values["gravity"]) == (0.004, [0, 0, -3.7])
    assert "No world" not in (folder / "robot.sdf.toml").read_text()


@pytest.mark.parametrize("engine", [one.name for one in default_engines(".sdf")])
def test_folder_agrees_and_a_wrong_number_differs(tmp_path: Path, engine: str) -> None:
    if engines()[engine].version() is None:
        pytest.skip(f"{engine} is not installed")
    folder = write_folder(tmp_path)
    prepared = prepare(folder)
    assert isinstance(prepared, PreparedTree)
    sidecar = read_sidecar(folder / "robot.sdf.toml")
    assert judge(model_task(prepared, engine, sidecar, resolution=1e-8)).outcome is Outcome.AGREES
    edited(folder / "robot.sdf", "<mass>2</mass>", "<mass>2.001</mass>")
    assert judge(model_task(prepared, engine, sidecar, resolution=1e-8)).outcome is Outcome.DIFFERS
