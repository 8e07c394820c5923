"""Poses of bodies in engines match the equations, of systems and of robot files."""

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
from physics_crosscheck.harness.modelfiles.sidecar import SidecarError, read_sidecar
from physics_crosscheck.harness.results.headline import difference
from physics_crosscheck.records import Outcome
from tests.models import robot_task, written
from tests.poses.arm import (
    FRAMES,
    LINKS,
    SETTINGS,
    SWING,
    SWING_MJCF,
    URDF,
    message,
    poses,
    without_frames,
)

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


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_links_of_a_correct_urdf_match_the_equations(engine: str, tmp_path: Path) -> None:
    check = poses(tmp_path, engine=engine, file="arm.urdf", text=URDF, sidecar=SETTINGS + LINKS)
    assert check.findings == ()
    assert [one.name for one in check.record.frames] == ["post", "arm", "tool", "tip"]
    assert all(one.agrees and (one.position or 0) < 1e-14 for one in check.record.frames)
    assert check.record.states == 84


def test_bodies_and_sites_of_a_correct_mjcf_match_the_equations(tmp_path: Path) -> None:
    check = poses(tmp_path)
    assert check.findings == ()
    assert check.record.frames[3].rotation is None  # a point is not turned
    assert (check.record.uncertainty or 1) < 1e-12


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ([('axis="0 -1 0"', 'axis="0 1 0"')],
         "arm (body:arm), tool (site:tool), tip (site:tool): off by up to 1.6 m and 173 degrees"
         " from the equations' pose"),
        ([('axis="0 -1 0"', 'axis="0 1 0"')], "as if b had the other sign: an axis is flipped"),
        # The base is moved.
        ([('pos="0 0 0"><joint', 'pos="0 2.5 0"><joint')], "moved by (0, 2.5, 0) m in the world"),
        # The whole arm is turned by 90 degrees.
        ([('name="post" pos="0 0 0"', 'name="post" pos="0 0 0" euler="1.5707963267948966 0 0"')],
         "turned in the world by 90 degrees about x"),
        # The tool is moved or turned in its body.
        ([('pos="0 0 -0.8"', 'pos="0.1 0 -0.8"')],
         "tool (site:tool), tip (site:tool): off by up to 0.1 m from the equations' pose"),
        ([('pos="0 0 -0.8"', 'pos="0.1 0 -0.8"')], "offset by (0.1, 0, 0) m in its body's axes"),
        ([('euler="0.3 0 0"', 'euler="0.3 0 0.5"')],
         "its axes are turned by 28.65 degrees about z"),
        # A length is off by 1e-8.
        ([('pos="0 0 -0.8"', 'pos="0 0 -0.80000001"')], "up to 1e-08 m"),
    ],
)  # fmt: skip
def test_pose_faults_are_reported(
    changes: list[tuple[str, str]], words: str, tmp_path: Path
) -> None:
    assert words in message(poses(tmp_path, *changes))


def test_flipped_axis_compensated_in_the_sidecar_differs(tmp_path: Path) -> None:
    """Joint space agrees: b of the file is -b of the equations, and the axis points the right way;
    the other way round, the mechanism is its mirror image."""
    compensated = '[coordinates]\nb = "-b"\n[readback]\nb = "-b"\n' + FRAMES
    both = poses(tmp_path, ('axis="0 -1 0"', 'axis="0 1 0"'), sidecar=compensated)
    assert both.findings == ()
    assert "as if b had the other sign" in message(poses(tmp_path, sidecar=compensated))


def test_rotated_plane_of_motion_is_reported(tmp_path: Path) -> None:
    """About -y in the equations, about x in the file: in joint space the same pendulum."""
    sidecar = '[frames]\nrod = "body:rod"\nend = { is = "body:rod", at = [0, 0, "-l"] }\n'
    assert poses(tmp_path, text=SWING_MJCF, sidecar=sidecar, system=SWING).findings == ()
    turned = poses(
        tmp_path, ('axis="0 -1 0"', 'axis="1 0 0"'), text=SWING_MJCF, sidecar=sidecar, system=SWING
    )
    assert message(turned).endswith("; its motion is turned by 90 degrees about z")
    moved = poses(
        tmp_path,
        ('axis="0 -1 0"', 'pos="0 0 0" axis="0 1 0"'),
        ('name="rod"', 'name="rod" pos="0 0 3"'),
        text=SWING_MJCF,
        sidecar=sidecar,
        system=SWING,
    )
    assert "an axis is flipped, and moved by (0, 0, 3) m in the world" in message(moved)


def test_world_frame_of_the_sidecar_is_applied(tmp_path: Path) -> None:
    """Rotate the mechanism and move it up a metre: it agrees once the sidecar declares it."""
    aside = ('name="post" pos="0 0 0"', 'name="post" pos="0 0 1" euler="1.5707963267948966 0 0"')
    world = FRAMES.replace(
        "[frames]\n", '[frames]\nworld = { axes = ["x", "-z", "y"], origin = [0, 0, 1] }\n'
    )
    plain = "turned in the world by 90 degrees about x, and moved by (0, 0, 1) m in the world"
    assert plain in message(poses(tmp_path, aside))
    converted = world.replace('is = "body:post"', 'is = "body:post", axes = ["x", "y", "z"]')
    for name, place in (("arm", "body:arm"), ("tool", "site:tool"), ("tip", "site:tool")):
        converted = converted.replace(
            f'{name} = "{place}"', f'{name} = {{ is = "{place}", axes = ["x", "y", "z"] }}'
        )
    assert poses(tmp_path, aside, sidecar=converted).findings == ()


def test_unknown_frame_is_reported_with_the_available_ones(tmp_path: Path) -> None:
    with pytest.raises(SidecarError) as error:
        poses(tmp_path, ('tool = "site:tool"', 'tool = "body:hand"'))
    assert str(error.value) == (
        f"{tmp_path / 'arm.xml.toml'}:5: [frames] tool: the model has no 'body:hand'; it has"
        " body:world, body:post, body:arm"
    )


@pytest.mark.parametrize(
("entry", "words"),
    [
        ('hand = "body:arm"', "hand is not a frame of arm; it declares post, arm, tool, tip"),
        ("arm = 3", 'arm must name the frame in the file, as in "body:rod"'),
        ('arm = { at = [0, 0, 0] }', "arm must name the frame in the file"),
        ('arm = { is = "body:arm", at = [0, 0] }', "at is [0, 0]; expected three lengths"),
        ('arm = { is = "body:arm", at = [0, 0, "1/0"] }', "at"),
        ('arm = { is = "body:arm", at = [0, 0, "q"] }', "q is neither a coordinate nor a constant"),
        ('arm = { is = "body:arm", by = 3 }', 'arm must name the frame in the file, as in'),
        ('world = { axes = ["x", "y", "-z"] }', "remove the mirror"),
        ('world = { axes = ["x", "y"] }', "expected three axes"),
        ('world = "x, z, -y"', "world must be a table with axes, origin or both"),
    ],
)  # fmt: skip
def test_invalid_frame_entry_is_rejected(entry: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(SidecarError) as error:
        poses(tmp_path, sidecar=f"[frames]\n{entry}\n")
    assert words in str(error.value)
    assert str(error.value).startswith(f"{tmp_path / 'arm.xml.toml'}:3: [frames]")


def test_missing_frames_are_noted(tmp_path: Path) -> None:
    none = poses(tmp_path, system=without_frames(), sidecar="")
    assert none.record.note == "the system declares no frames"
    unmapped = poses(tmp_path, sidecar="")
    assert unmapped.record.note == "the sidecar maps no frame of the system"
    assert unmapped.record.unchecked == ("post", "arm", "tool", "tip")
    assert poses(tmp_path, sidecar='[frames]\narm = "body:arm"\n').record.unchecked == (
        "post", "tool", "tip",
    )  # fmt: skip
