"""A folder of an SDFormat file: its bodies, and what a world would state."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from physics_crosscheck.harness.checks.case import judge
from physics_crosscheck.harness.checks.prepare import PreparedTree, prepare
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.commands.scaffold.from_model import from_model
from physics_crosscheck.harness.engines.registry import default_engines, engines
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.reference.load import load_declaration
from physics_crosscheck.reference.mechanism.multibody import MultibodySystem
from tests.robots.test_sdf import ARM, BASE, WELD, joint

WORLD = "<gravity>0 0 -3.7</gravity><physics><max_step_size>0.004</max_step_size></physics>"


def written(folder: Path, world: str = "") -> Path:
    model = f"<model name='m'>{WELD}{BASE}{ARM}{joint()}</model>"
    # Where an inertial is turned, engines are known to differ.
    model = model.replace("0.1 0.2 -0.5 0.3 0.2 0.1", "0.1 0.2 -0.5 0 0 0")
    inner = f"<world name='w'>{world}{model}</world>" if world else model
    file = folder / "robot.sdf"
    file.write_text(f"<sdf version='1.6'>{inner}</sdf>")
    from_model(file, folder / "made")
    return folder / "made"


def settings(made: Path) -> dict[str, object]:
    found: dict[str, object] = tomllib.loads((made / "robot.sdf.toml").read_text())["settings"]
    return found


def test_bodies_are_declared_and_what_no_world_states_is_set(tmp_path: Path) -> None:
    made = written(tmp_path)
    system = load_declaration(made)
    assert isinstance(system, MultibodySystem)
    assert [joint.name for body in system.bodies for joint in body.joints] == ["q"]
    found = settings(made)
    assert (found["step"], found["gravity"]) == (0.002, [0.0, 0.0, -9.81])
    assert read_sidecar(made / "robot.sdf.toml").engines == tuple(
        engine.name for engine in default_engines(".sdf")
    )


def test_what_a_world_states_stands_once(tmp_path: Path) -> None:
    made = written(tmp_path, WORLD)
    found = settings(made)
    assert (found["step"], found["gravity"]) == (0.004, [0, 0, -3.7])
    assert "No world" not in (made / "robot.sdf.toml").read_text()


@pytest.mark.parametrize("engine", [one.name for one in default_engines(".sdf")])
def test_the_folder_agrees_and_a_wrong_number_does_not(tmp_path: Path, engine: str) -> None:
    if engines()[engine].version() is None:
        pytest.skip(f"{engine} is not installed")
    made = written(tmp_path)
    prepared = prepare(made)
    assert isinstance(prepared, PreparedTree)
    sidecar = read_sidecar(made / "robot.sdf.toml")
    assert judge(model_task(prepared, engine, sidecar, resolution=1e-8)).outcome is Outcome.AGREES
    file = made / "robot.sdf"
    file.write_text(file.read_text().replace("<mass>2</mass>", "<mass>2.001</mass>"))
    assert judge(model_task(prepared, engine, sidecar, resolution=1e-8)).outcome is Outcome.DIFFERS
