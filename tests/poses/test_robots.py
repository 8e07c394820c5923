"""Poses of a robot's bodies match its file in every engine that returns poses."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pybullet_data
import pytest

from physics_crosscheck.engine import Array
from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.poses import case_poses
from physics_crosscheck.harness.checks.prepare import PreparedTree, prepare, prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.diagnosis.coverage import count_robot
from physics_crosscheck.harness.engines.mujoco import MujocoModel
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.harness.render.terminal.problems import difference
from physics_crosscheck.records import Outcome
from tests.models import robot_task, written

DATA = Path(pybullet_data.getDataPath())
ARM = """<robot name="arm">
<link name="base"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="boom"><inertial><origin xyz="0.01 0.02 -0.2"/><mass value="1.3"/>
<inertia ixx="0.021" iyy="0.018" izz="0.006" ixy="0.001" ixz="0" iyz="0"/></inertial></link>
<joint name="lift" type="continuous"><parent link="base"/><child link="boom"/>
<origin xyz="0 0 1" rpy="0.1 0.2 0.3"/><axis xyz="0 1 0"/></joint>
<link name="tool"/>
<joint name="flange" type="fixed"><parent link="boom"/><child link="tool"/>
<origin xyz="0.1 0 -0.4" rpy="0 0.5 0"/></joint>
</robot>
"""


@cache
def robot(name: str, floating: bool) -> PreparedTree:
    """Return a robot, prepared once."""
    return prepare_tree(DATA / name, floating=floating, states=2)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "floating", "bodies"), [
    ("franka_panda/panda.urdf", False, 13),
    ("a1/a1.urdf", True, 22),
])  # fmt: skip
@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "drake", "pinocchio", "dart"])
def test_body_poses_of_a_robot_match_its_file(
    name: str, floating: bool, bodies: int, engine: str
) -> None:
    """Panda has two links without mass on fixed joints, a1 a root that turns."""
    if engines()[engine].version() is None:
        pytest.skip(f"{engine} is not installed")
    task = model_task(robot(name, floating), engine)
    if engine == "drake" and "panda" in name:
        assert run_case(task).outcome is Outcome.REFUSED  # an inertia without a mass
        return
    check = case_poses(task, *task.load())
    assert check is not None
    assert len(check.record.frames) == bodies
    assert not check.record.wrong
    assert max(one.position or 0.0 for one in check.record.frames) < 1e-14
    assert max(one.rotation or 0.0 for one in check.record.frames) < 1e-12


def shifted(link: str, by: Sequence[float], turn: float) -> object:
    """Return MuJoCo's poses with one link moved, m, and turned about its z axis, rad."""
    right = MujocoModel.poses
    c, s = np.cos(turn), np.sin(turn)

    def poses(self: MujocoModel, places: Sequence[str], z: Array) -> tuple[Array, Array]:
        origins, turns = right(self, places, z)
        if link in places:
            row = list(places).index(link)
            origins[:, row] += turns[:, row] @ np.array(by)
            turns[:, row] = turns[:, row] @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        return origins, turns

    return poses


@pytest.mark.parametrize(("by", "turn", "expected"), [
    ((0.0, 1e-8, 0.0), 0.0, "off by up to 1e-08 m"),
    ((0.0, 0.0, 0.0), 1e-6, "off by up to 5.73e-05 degrees"),
])  # fmt: skip
def test_misplaced_massless_tool_differs_at_its_line(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    by: tuple[float, float, float],
    turn: float,
    expected: str,
) -> None:
    """Catch a comparison that skips links without mass, which no motion shows."""
    task = robot_task(tmp_path, "arm.urdf", ARM)
    assert run_case(task).outcome is Outcome.AGREES
    monkeypatch.setattr(MujocoModel, "poses", shifted("link:tool", by, turn))
    case = run_case(task)
    assert (case.outcome, case.kind, case.code) == (Outcome.DIFFERS, "pose", "XC304")
    assert case.poses is not None
    assert [one.name for one in case.poses.wrong] == ["tool"]
    assert expected in case.reason
    assert "all single steps agree" in case.reason
    (line,) = case.locations
    assert ARM.splitlines()[(line.line or 0) - 1].startswith('<link name="tool"')
    assert difference(case) == f"tool {expected}"
    assert not case.contradiction(1e-9)


BODIES = """from physics_crosscheck import Joint, MultibodySystem, RigidBody

boom = RigidBody(
    name="boom", parent=None, position=(0.0, 0.0, 1.0), rpy=(0.1, 0.2, 0.3), mass=1.3,
    center=(0.01, 0.02, -0.2), inertia=(0.021, 0.018, 0.006, 0.001, 0.0, 0.0),
    joints=(Joint(name="lift", kind="hinge", axis=(0.0, 1.0, 0.0)),),
)
tool = RigidBody(name="tool", parent="boom", position=(0.1, 0.0, -0.4), rpy=(0.0, 0.5, 0.0))
system = MultibodySystem(
    name="arm", title="an arm", source="a test", gravity=(0.0, 0.0, -9.81), bodies=(boom, tool)
)
"""


def test_misplaced_tool_of_system_py_differs_and_is_counted(tmp_path: Path) -> None:
    """Catch a folder of bodies whose poses no check compares with the engine."""
    (tmp_path / "system.py").write_text(BODIES)
    file, sidecar = tmp_path / "arm.urdf", tmp_path / "arm.urdf.toml"
    file.write_text(ARM)
    settings = "[settings]\nstep = 0.002\ngravity = [0, 0, -9.81]\nsmooth = true\n"
    sidecar.write_text(f'engines = ["mujoco"]\n{settings}')
    prepared = prepare(tmp_path)
    assert isinstance(prepared, PreparedTree)
    task = model_task(prepared, "mujoco", read_sidecar(sidecar))
    assert run_case(task).outcome is Outcome.AGREES
    untested = [one for part in count_robot(task).untested for one in part.examples]
    assert not [one for one in untested if "flange" in one]
    file.write_text(ARM.replace("0.1 0 -0.4", "0.1 0 -0.4001"))
    case = run_case(task)
    assert (case.outcome, case.kind) == (Outcome.DIFFERS, "pose")
    assert [place.line for place in case.locations] == [8]


def test_rounding_difference_agrees(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = written(tmp_path, "arm.urdf", ARM)
    monkeypatch.setattr(MujocoModel, "poses", shifted("link:tool", (0, 1e-11, 0), 1e-11))
    assert run_case(model_task(prepare_tree(file, states=8), "mujoco")).outcome is Outcome.AGREES
