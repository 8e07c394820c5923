"""Shapes and sites of robot files are where the files put them, with their sizes."""

from pathlib import Path

import pytest

from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.diagnosis.coverage import count_robot
from physics_crosscheck.records import Case, Outcome
from tests.models import written
from tests.poses.edited import case_of_edited

TETRAHEDRON = "0 0 0  0.3 0 0  0 0.2 0  0 0 0.1"
MJCF = f"""<mujoco><compiler angle="radian"/>
<default><default class="pad"><geom type="box"
 size="0.03 0.02 0.01"/></default></default>
<asset><mesh name="wedge" vertex="{TETRAHEDRON}"/></asset>
<worldbody>
<geom name="floor" type="plane" size="2 2 0.1" pos="0 0 -1"/>
<body name="arm" pos="0 0 0.5"><joint name="a" type="hinge" axis="0 1 0"/>
 <inertial pos="0 0 -0.4" mass="1" diaginertia="1 1 1"/>
 <body name="hand" pos="0 0 -0.8"><joint name="b" type="hinge" axis="1 0 0"/>
  <inertial pos="0 0 -0.1" mass="0.3" diaginertia="0.01 0.01 0.01"/>
  <frame pos="0.1 0 0" euler="0 0.2 0">
   <geom class="pad" pos="0 0.04 0"/></frame>
  <geom type="mesh" mesh="wedge" pos="0 0 0.2" euler="0.1 0 0"/>
  <site name="grasp" pos="0 0 -0.15" size="0.006"/></body>
 <geom name="bone" type="capsule" fromto="0 0 0 0 0 -0.7" size="0.04"/></body>
</worldbody></mujoco>"""


def case_after(folder: Path, old: str, new: str) -> Case:
    """Compare the edited file in MuJoCo with the equations of the original."""
    return case_of_edited(folder / "arm.xml", MJCF, old, new, "mujoco")


def test_shapes_and_sites_agree(tmp_path: Path) -> None:
    case = case_after(tmp_path, 'wedge" vertex', 'wedge" vertex')
    assert case.outcome is Outcome.AGREES
    assert case.poses is not None
    assert (case.poses.shapes, len(case.poses.frames), case.poses.wrong) == (5, 2, ())
    assert (case.poses.uncertainty or 1) < 1e-12


@pytest.mark.parametrize(("old", "new", "words", "line"), [
    ('pos="0 0.04 0"', 'pos="0 0.04000001 0"', "geom:#2: off by up to 1e-08 m", 12),
    ('pos="0 0 0.2"', 'pos="0 0 0.20000001"', "geom:#3: off by up to 1e-08 m", 13),
    ('pos="0 0 -0.15"', 'pos="0 0 -0.15000001"', "site:grasp", 14),
    ('euler="0 0.2 0"', 'euler="0 0.200001 0"', "its axes are turned by 5.73e-05 degrees", 12),
    ("0 0 0 0 0 -0.7", "0 0 0 0 0.0000001 -0.7", "geom:bone", 15),
    ('size="2 2 0.1" pos="0 0 -1"', 'size="2 2 0.1" pos="0 0 -1.00000001"', "geom:floor", 6),
    ('"0.03 0.02 0.01"', '"0.03 0.02 0.01000001"',
     "geom:#2: its size is 0.03 0.02 0.01 in the file and 0.03 0.02 0.01000001 in the engine", 3),
    ('size="0.006"', 'size="0.0060001"', "site:grasp: its size is 0.006 in the file", 14),
])  # fmt: skip
def test_moved_or_scaled_shape_differs_at_its_line(
    old: str, new: str, words: str, line: int, tmp_path: Path
) -> None:
    """Lost: an unnamed geom, one in a frame, a class's size, the other end of a capsule, a floor
    that moves nothing; a mesh that MuJoCo has moved to its center of mass.
    """
    case = case_after(tmp_path, old, new)
    assert (case.outcome, case.kind) == (Outcome.DIFFERS, "pose")
    assert words in case.reason
    assert [one.line for one in case.locations] == [line]


def test_bodies_without_names_have_poses_and_shapes(tmp_path: Path) -> None:
    """Lost: a wrong size in a file whose only body has no name."""
    sound = """<mujoco><worldbody><body pos="0 0 1"><joint axis="0 1 0"/>
    <inertial pos="0 0 0.1" mass="1" diaginertia="1 1 1"/><geom size="0.1"/>
    </body></worldbody></mujoco>"""
    for old, new, place in (
        ('"0 0 1"', '"0 0 1.0001"', "body_1 (body:body_1): off by"),  # its shape goes with it
        ('"0.1"', '"0.1001"', "geom:#0: its size"),
    ):
        case = case_of_edited(tmp_path / "arm.xml", sound, old, new, "mujoco")
        assert case.outcome is Outcome.DIFFERS
        assert case.reason.startswith(place)


def test_shapes_almost_in_the_frame_of_their_body_agree(tmp_path: Path) -> None:
    """Reported as elsewhere: MuJoCo takes a frame turned by 4e-7 for that of the body."""
    nearly = 'pos="0 0 0.2" euler="0 0 8e-7"'
    case = case_after(tmp_path, 'pos="0 0 0.2" euler="0.1 0 0"', nearly)
    assert "geom:#3" in case.reason
    path = tmp_path / "arm.xml"
    case = run_case(model_task(prepare_tree(path, states=4), "mujoco"))
    assert case.outcome is Outcome.AGREES


def test_numbers_of_shapes_count_as_tested_by_poses(tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(MJCF)
    coverage = count_robot(model_task(prepare_tree(path, states=4), "mujoco"))
    # A class's size 3, floor 6, frame 6, its geom 3, mesh 6, site 4, capsule 7; 4 of bodies'
    # positions; and 2 of axes, by their sign.
    assert coverage.frames == 41
    # Vertices of a mesh without inertia change, and no pose does.
    (shapes,) = (one for one in coverage.untested if one.reason.startswith("collision"))
    assert (shapes.count, shapes.examples) == (12, ("mesh@vertex",))


URDF = """<robot name="arm">
<link name="base"><visual><geometry><box size="1 1 1"/></geometry></visual>
 <inertial><origin xyz="0.1 0 0" rpy="0.3 0.2 0.1"/><mass value="2"/>
  <inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial>
 <collision><origin xyz="0 0.1 0" rpy="0 0.2 0"/><geometry><box size="0.3 0.2 0.1"/></geometry>
 </collision>
 <collision><origin xyz="0 0 0.25"/><geometry><sphere radius="0.06"/></geometry></collision></link>
<link name="hand"><contact><lateral_friction value="0.7"/></contact>
 <inertial><origin xyz="0.1 0 0"/><mass value="1"/>
  <inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial>
 <collision><origin rpy="0.5 0 0"/><geometry><cylinder radius="0.04" length="0.2"/></geometry>
 </collision>
 <collision><geometry><plane normal="0 0 1"/></geometry></collision>
 <collision><origin xyz="0.2 0 0"/><geometry><mesh filename="wedge.obj" scale="2 2 3"/></geometry>
 </collision>
 <collision><origin xyz="0.3 0 0"/><geometry><capsule radius="0.05" length="0.4"/></geometry>
 </collision></link>
<joint name="j" type="revolute"><origin xyz="0.2 0 0.1" rpy="0 0 0.4"/><parent link="base"/>
 <child link="hand"/><axis xyz="0 1 0"/>
 <limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""


WEDGE = "v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"

in_both = pytest.mark.parametrize("engine", ["pybullet", "mujoco"])


def urdf_case_after(folder: Path, old: str, new: str, engine: str) -> Case:
    """Compare the edited file in an engine with the equations of the original."""
    (folder / "wedge.obj").write_text(WEDGE)
    text = URDF
    if engine == "pybullet":  # it stops a link with a plane
        text = text.replace('<plane normal="0 0 1"/>', '<sphere radius="0.01"/>')
    return case_of_edited(folder / "arm.urdf", text, old, new, engine)


@in_both
def test_shapes_agree(tmp_path: Path, engine: str) -> None:
    """Stopped by a plane, which has no size, in MuJoCo."""
    case = urdf_case_after(tmp_path, 'radius="0.06"', 'radius="0.06"', engine)
    assert case.outcome is Outcome.AGREES
    assert case.poses is not None
    assert (case.poses.shapes, case.poses.wrong) == (5 if engine == "mujoco" else 6, ())
    assert (case.poses.uncertainty or 1) < 1e-12


def test_shape_with_a_word_has_no_place(tmp_path: Path) -> None:
    """Stopped by a word for a size: motions do not depend on it."""
    path = written(tmp_path, "arm.urdf", URDF.replace('radius="0.06"', 'radius="wide"'))
    case = run_case(model_task(prepare_tree(path, states=4), "mujoco"))
    assert case.outcome is Outcome.AGREES
    assert case.whole_step is not None
    (reason,) = case.whole_step.uncovered
    assert "arm.urdf" in reason
    assert "line 7" in reason or ":7" in reason


@in_both
@pytest.mark.parametrize(("old", "new", "words", "line"), [
    ('"0 0.1 0"', '"0 0.10000001 0"', "collision:base#1: off by up to 1e-08", 5),
    ('size="0.3 0.2 0.1"', 'size="0.3 0.2 0.10000001"', "base#1: its size is 0.15 0.1 0.05 in", 5),
    ('"0 0 0.25"', '"0 0 0.25000001"', "collision:base#2: off by up to", 7),
    ('"0.06"', '"0.06000001"', "collision:base#2: its size is 0.06 in the file and 0.06000001", 7),
    ('"0.5 0 0"', '"0.500001 0 0"', "its axes are turned by 5.73e-05 degrees about x", 11),
    ('"0.04" length="0.2"', '"0.04" length="0.20000001"', "its size is 0.04 0.1 in the file", 11),
    ('"0.2 0 0"/><geom', '"0.2000001 0 0"/><geom', "collision:hand#2", 14),
    ('"2 2 3"', '"2 2 3.0000001"', "hand#2: its scale is 2 2 3 in the file and 2 2 3.0000001", 14),
    ('"0.05" length', '"0.05000001" length', "collision:hand#3: its size is 0.05 0.2 in", 16),
])  # fmt: skip
def test_moved_or_scaled_shapes_differ_at_their_lines(
    old: str, new: str, words: str, line: int, tmp_path: Path, engine: str
) -> None:
    """Lost: shapes of a link with turned principal axes, of a cylinder, and behind a mesh."""
    case = urdf_case_after(tmp_path, old, new, engine)
    assert (case.outcome, case.kind) == (Outcome.DIFFERS, "pose")
    assert words in case.reason
    assert [one.line for one in case.locations] == [line]


@in_both
def test_their_numbers_count_as_tested(tmp_path: Path, engine: str) -> None:
    path = written(tmp_path, "arm.urdf", URDF)
    coverage = count_robot(model_task(prepare_tree(path, states=4), engine))
    # Box 9, ball 4, cylinder 5, mesh 6, capsule 5; and 5 of the joint's place.
    assert coverage.frames == 34
    assert [one.reason for one in coverage.untested if "collision" in one.reason] == [
        "collision shapes"  # the normal of the plane
    ]


def test_whole_steps_compare_several_shapes_and_their_friction(tmp_path: Path) -> None:
    """Reported as not compared: what two links have, and `<contact>`; as compared: contacts of a
    robot that never touches anything.
    """
    path = tmp_path / "arm.urdf"
    readable = URDF.replace('<mesh filename="lost.obj" scale="2 2 3"/>', '<sphere radius="0.1"/>')
    path.write_text(readable.replace('<plane normal="0 0 1"/>', '<sphere radius="0.1"/>'))
    target = prepare_tree(path, states=4, floating=True)
    case = run_case(model_task(target, "pybullet"))
    assert case.whole_step is not None
    assert {*target.left_out} - {*case.whole_step.covered} == {"limits of velocity"}
    fixed = prepare_tree(path, states=4)  # it meets no floor
    case = run_case(model_task(fixed, "pybullet"))
    assert case.whole_step is not None
    assert {*case.whole_step.covered} == {"limits of position", "limits of effort"}
