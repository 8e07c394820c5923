"""Files that an engine compiles, as trees of bodies whose equations match the engine."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from physics_crosscheck.engine import EngineError, ModelSpec
from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.jobs.failure import failure_of
from physics_crosscheck.harness.modelfiles.mjcf.read import compiler, read_compiled_robot
from physics_crosscheck.harness.modelfiles.readers import RobotError, read_robot, robot_system
from physics_crosscheck.records import Outcome
from tests.models import edited, written
from tests.robots.planted import PreparedFile, prepare_file

HARD = """<mujoco model="hard">
  <compiler angle="degree" eulerseq="zyx"/>
  <option gravity="1 2 -9" timestep="0.001" integrator="{integrator}" density="{density}"/>
  <default><joint armature="0.02" damping="0.3"/>
    <default class="soft"><joint stiffness="5" springref="20"/></default></default>
  <worldbody>
    <body name="first" pos="0.1 0.2 0.3" euler="10 20 30">
      <joint name="turn" axis="1 1 0" pos="0.1 0 -0.1" ref="40" class="soft"/>
      <joint name="shift" type="slide" axis="0 1 1" pos="0.3 0 0" ref="0.2"/>
      <joint axis="0 0 1" pos="0 0.2 0"/>
      <inertial pos="0.1 0.05 0.2" mass="1.5" fullinertia="0.05 0.06 0.07 0.01 -0.005 0.004"/>
      <body pos="0 0.1 0.4" axisangle="1 2 3 50">
        <geom type="capsule" fromto="0 0 0 0.2 0.1 0.3" size="0.04" mass="0.6"/>
        <body name="last" pos="0.2 0.1 0.3" gravcomp="{gravcomp}">
          <joint name="wave" axis="0 1 0" class="soft" limited="true" range="-30 30"
            frictionloss="0.5"/>
          <geom type="box" size="0.1 0.2 0.05" euler="15 25 35" density="500"/>
        </body>
      </body>
    </body>
  </worldbody>
  {more}
</mujoco>
"""


def write_model(folder: Path, more: str = "", **changes: Any) -> Path:
    options = {"integrator": "Euler", "density": 0, "gravcomp": 0, **changes}
    file = written(folder, "hard.xml", HARD.format(more=more, **options))
    return file


def outcome(file: Path) -> tuple[Outcome, str]:
    engine = compiler(".xml")
    assert engine is not None
    case = run_case(model_task(prepare_tree(file, states=8), engine.name))
    return case.outcome, case.reason


def test_compiled_mjcf_agrees(tmp_path: Path) -> None:
    """Cover anchors, references, several joints per body, welds, full tensors and shapes."""
    file = write_model(tmp_path, integrator="RK4")
    assert outcome(file) == (Outcome.AGREES, "")
    prepared = prepare_tree(file, states=8)
    assert prepared.names == ("turn", "shift", "joint_2", "wave")
    assert prepared.record.title.startswith("4 joints, 3 links in 4 bodies, ")
    assert set(prepared.left_out) == {
        "limits of position", "dry friction", "contact geometry (2)",
        "how MuJoCo compiles the file",
    }  # fmt: skip


LOOSE = """<mujoco model="loose">
  <option gravity="1 2 -9" integrator="{integrator}"/>
  <default><joint armature="0.02" damping="0.3"/></default>
  <worldbody>
    <body name="root" pos="0.1 0.2 1.3" euler="10 20 30">
      <joint name="base" type="free"/>
      <inertial pos="0.1 0.05 0.2" mass="1.5" fullinertia="0.05 0.06 0.07 0.01 -0.005 0.004"/>
      <body pos="0 0.1 0.4" axisangle="1 2 3 50">
        <joint name="turn" axis="1 1 0" pos="0.1 0 -0.1" ref="40"/>
        <joint name="shoulder" type="ball" pos="0.02 0.1 0"/>
        <geom type="capsule" fromto="0 0 0 0.2 0.1 0.3" size="0.04" mass="0.6"/>
        <body pos="0.2 0.1 0.3" euler="5 0 70">
          <joint type="ball" damping="0.1"/>
          <geom type="box" size="0.1 0.2 0.05" euler="15 25 35" density="500"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["Euler", "implicit"])
def test_free_and_ball_joints_agree(tmp_path: Path, integrator: str) -> None:
    """Cover a free root with armature and dampers, and balls with anchors, one unnamed."""
    file = written(tmp_path, "loose.xml", LOOSE.format(integrator=integrator))
    assert outcome(file) == (Outcome.AGREES, "")
    names = prepare_tree(file, states=8).names
    assert names[:6] == ("base:rx", "base:ry", "base:rz", "base:x", "base:y", "base:z")
    assert names[6:] == (
        "turn", "shoulder:rx", "shoulder:ry", "shoulder:rz", "joint_3:rx", "joint_3:ry",
        "joint_3:rz",
    )  # fmt: skip


@pytest.fixture(scope="module")
def loose(tmp_path_factory: pytest.TempPathFactory) -> PreparedFile:
    return prepare_file(tmp_path_factory.mktemp("loose"), LOOSE.format(integrator="RK4"))


@pytest.mark.parametrize(("old", "new"), [
    ('mass="1.5"', 'mass="1.5000015"'), ("0.004\"", "0.004000004\""),
    ('pos="0.02 0.1 0"', 'pos="0.02 0.1000001 0"'),
    ('ball" damping="0.1"', 'ball" damping="0.1000001"'),
])  # fmt: skip
def test_error_of_a_millionth_in_free_and_ball_joints_differs(
    loose: PreparedFile, old: str, new: str
) -> None:
    assert loose.outcome_with(old, new) is Outcome.DIFFERS


ACTUATED = """
  <tendon>
    <fixed name="rope" stiffness="30 20 10" damping="0.4 0.3 0.2" springlength="0.3" armature="0.2">
      <joint joint="turn" coef="0.7"/><joint joint="wave" coef="-1.2"/></fixed>
    <fixed name="idle"><joint joint="shift" coef="2"/></fixed>
  </tendon>
  <actuator>
    <motor joint="turn" gear="3" ctrlrange="-1 1"/>
    <position joint="wave" kp="20" kv="0.5" gear="0.5" forcerange="-0.1 0.1"/>
    <velocity tendon="idle" kv="4" gear="1.5"/>
    <general joint="shift" gaintype="affine" gainprm="5 2 1" biastype="affine" biasprm="1 -2 -3"
      damping="0.7" armature="0.25" gear="2"/>
    <muscle joint="wave" force="50" lengthrange="0.1 1"/>
  </actuator>
"""


def test_tendons_and_actuators_with_constant_inputs_agree(tmp_path: Path) -> None:
    """Cover polynomials, armatures, gears, servos of joints and tendons, and a left-out muscle."""
    file = write_model(tmp_path, ACTUATED, gravcomp=0.6)
    # A force of v |v| has a kink at v = 0; a cubic force is smooth enough.
    cubic = 'class="soft"><joint damping="0.1 0 0.2"'
    edited(file, 'class="soft"><joint', cubic)
    assert outcome(file) == (Outcome.AGREES, "")
    prepared = prepare_tree(file, states=8)
    assert "actuators of other laws or transmissions" in prepared.left_out
    assert "saturation of actuators (2)" in prepared.left_out
    controls = prepared.settings["controls"]
    assert isinstance(controls, list)
    assert len(controls) == 5
    assert -1 < controls[0] < 1


@pytest.fixture(scope="module")
def actuated(tmp_path_factory: pytest.TempPathFactory) -> PreparedFile:
    folder = tmp_path_factory.mktemp("pulling")
    return prepare_file(folder, write_model(folder, ACTUATED, gravcomp=0.6).read_text())


@pytest.mark.parametrize(("old", "new"), [
    ('stiffness="30 20 10"', 'stiffness="30 20 10.0001"'),
    ('damping="0.4 0.3 0.2"', 'damping="0.4 0.30001 0.2"'),
    ('springlength="0.3"', 'springlength="0.3000003"'),
    ('armature="0.2"', 'armature="0.2000002"'), ('coef="-1.2"', 'coef="-1.2000012"'),
    ('gear="3"', 'gear="3.000003"'), ('kp="20"', 'kp="20.00002"'), ('kv="4"', 'kv="4.000004"'),
    ('gainprm="5 2 1"', 'gainprm="5 2 1.00001"'), ('biasprm="1 -2', 'biasprm="1.00001 -2'),
    ('damping="0.7"', 'damping="0.7000007"'), ('armature="0.25"', 'armature="0.2500003"'),
    ('gravcomp="0.6"', 'gravcomp="0.6000006"'),
])  # fmt: skip
def test_error_of_a_millionth_in_tendons_and_actuators_differs(
    actuated: PreparedFile, old: str, new: str
) -> None:
    assert actuated.outcome_with(old, new) is Outcome.DIFFERS


@pytest.mark.parametrize("flag", ["gravity", "spring", "actuation"])
def test_disabled_forces_are_off(tmp_path: Path, flag: str) -> None:
    file = write_model(tmp_path, ACTUATED, gravcomp=0.6)
    text = file.read_text()
    off = f'<option><flag {flag}="disable"/></option><default>'
    prepared = prepare_file(tmp_path, text.replace("<default>", off, 1))
    assert prepared.accelerations() is Outcome.AGREES


COUPLED = """<mujoco><option><flag {}/></option>
<default><geom size="0.1 0.2 0.3" type="box"/><joint damping="0.1"/></default><worldbody>
<body><joint name="j" axis="0 1 0" range="-90 90"/><geom pos="0.1 0.2 0.3"/>
<body pos="0.1 0 -0.4"><joint name="k" axis="1 0 0" frictionloss="0.1"/><geom pos="0.1 0 0"/>
<body pos="0 0 -0.3"><joint name="l" axis="0 1 1"/><geom pos="0.1 0 0"/></body></body></body>
</worldbody><equality><joint {} joint1="k" joint2="j" polycoef="0.1 0.5 0 0 0"/></equality>
</mujoco>"""


@pytest.mark.parametrize(("flags", "active", "count"), [
    ('constraint="disable"', "", 3),
    ("", 'active="false"', 3),
    ('refsafe="disable" island="disable" warmstart="disable" limit="disable" frictionloss="disable"'
     ' contact="disable" invdiscrete="enable" energy="enable" override="enable"', "", 2),
])  # fmt: skip
def test_equality_is_held_unless_it_is_disabled(
    tmp_path: Path, flags: str, active: str, count: int
) -> None:
    model = prepare_file(tmp_path, COUPLED.format(flags, active))
    assert len(model.prepared.names) == count
    if count == 3:
        assert model.accelerations() is Outcome.AGREES
    else:
        assert model.outcome() == (Outcome.AGREES, "")


UNSUPPORTED = {
    "actuators of other laws or transmissions":
        '<actuator><muscle joint="turn" force="20" lengthrange="0.1 1"/></actuator>',
    "equality constraints": '<equality><connect body1="last" anchor="0 0 0"/></equality>',
}  # fmt: skip


@pytest.mark.parametrize("feature", UNSUPPORTED)
def test_unsupported_elements_are_disabled_and_reported(tmp_path: Path, feature: str) -> None:
    prepared = prepare_file(tmp_path, write_model(tmp_path, UNSUPPORTED[feature]).read_text())
    assert prepared.accelerations() is Outcome.AGREES
    assert feature in prepared.left_out


@pytest.mark.slow
@pytest.mark.parametrize("joints", [("turn", "wave"), ("wave", "turn")])
def test_damped_joint_follows_another(tmp_path: Path, joints: tuple[str, str]) -> None:
    """Cover both orders; Euler's implicit damping would violate the equality."""
    follower, leader = joints
    file = write_model(
        tmp_path, f'<equality><joint joint1="{follower}" joint2="{leader}"/></equality>'
    )
    model = prepare_file(tmp_path, file.read_text())
    assert model.outcome() == (Outcome.AGREES, "")
    assert model.prepared.settings["couplings"] == [follower]


@pytest.mark.parametrize("controls", [[1.0], "all", [1.0, "x", 2.0, 3.0, 4.0]])
def test_controls_need_one_number_per_input(tmp_path: Path, controls: object) -> None:
    file = write_model(tmp_path, ACTUATED)
    engine = compiler(".xml")
    assert engine is not None
    with pytest.raises(EngineError, match=r"controls is .*; expected 5 numbers"):
        engine.load(ModelSpec(path=file, settings={"smooth": True, "controls": controls}))


def test_couplings_setting_changes_the_motion(tmp_path: Path) -> None:
    """Confirm that the setting, not the file, disables the equality."""
    more = UNSUPPORTED["equality constraints"]
    file = write_model(tmp_path, more, gravcomp=0.5, density=1000)
    engine = compiler(".xml")
    assert engine is not None
    loads = [{"smooth": True}, {"smooth": True, "couplings": False}]
    changes = []
    for settings in loads:
        model = engines()[engine.name].load(ModelSpec(path=file, settings=settings, springs=()))
        _, v = model.rollout(np.full((1, 4), 0.3), np.zeros((1, 4)), 1e-4, 1, None, 1)
        changes.append(v[0, 0])
    assert np.max(np.abs(changes[0] - changes[1])) > 1e-3


@pytest.mark.parametrize(("world", "problems"), [
    ('<flexcomp type="grid" count="2 2 2" dim="3" name="f" radius="0.01" mass="1">'
     '<pin id="0 1 2 3 4 5 6 7"/></flexcomp>',
     "flexible bodies: not covered.*it has no joint that moves"),
    ('<body><joint type="screw"/></body>', "screw"),
    ('<geom size="1"/>', "it has no joint that moves"),
])  # fmt: skip
def test_problems_are_reported_together(tmp_path: Path, world: str, problems: str) -> None:
    file = written(tmp_path, "r.xml", f"<mujoco><worldbody>{world}</worldbody></mujoco>")
    assert read_compiled_robot(file).tree is None
    with pytest.raises(RobotError, match=rf"(?s)r\.xml.*{problems}"):
        prepare_tree(file, states=8)


def test_gravity_compensation_by_disabled_actuators_is_refused(tmp_path: Path) -> None:
    file = write_model(tmp_path, '<actuator><motor joint="wave"/></actuator>', gravcomp=0.6)
    text = file.read_text().replace('name="wave"', 'name="wave" actuatorgravcomp="true"')
    file.write_text(text)
    assert not read_compiled_robot(file).obstacles
    off = '<option><flag actuation="disable"/></option><default>'
    file.write_text(text.replace("<default>", off, 1))
    (problem,) = read_compiled_robot(file).obstacles
    assert "gravity compensation by actuators that are off: not covered" in str(problem)


MESHED = """<mujoco><asset><mesh name="m" vertex="0 0 0 0.3 0 0 0 0.5 0 0 0 0.7"/></asset>
<worldbody><body gravcomp="0.4"><joint axis="0 1 0"/><geom type="mesh" mesh="m"/></body></worldbody>
</mujoco>"""


def test_agreement_on_compiled_inertias_has_a_reservation(tmp_path: Path) -> None:
    file = written(tmp_path, "meshed.xml", MESHED)
    case = run_case(model_task(prepare_tree(file, states=8), "pinocchio"))
    assert case.outcome is Outcome.AGREES
    assert case.reason == "the inertia of 1 body is as MuJoCo compiles the file"


@pytest.mark.parametrize(("changes", "reason"), [
    ({"<worldbody>": '<option apirate="9"/><worldbody>', "<geom": "<geom kind='x'"},
     "unrecognized attribute: 'apirate'"),
    ({"</mujoco>": '<sensor><touch site="s"/></sensor></mujoco>'}, "unrecognized name 's' of sens"),
    ({"</mujoco>": '<keyframe><key qpos="0 1"/></keyframe></mujoco>'}, "invalid qpos size"),
    ({"<geom": "<geom material='x'"}, "material 'x' not found"),
    ({"<asset>": "<asset><material name='a' texture='x'/>"}, "texture 'x' not found"),
])  # fmt: skip
def test_part_that_only_mujoco_refuses_leaves_the_verdicts_of_other_engines(
    tmp_path: Path, changes: dict[str, str], reason: str
) -> None:
    text = MESHED
    for old, new in changes.items():
        text = text.replace(old, new)
    prepared = prepare_tree(written(tmp_path, "old.xml", text))
    cases = {name: run_case(model_task(prepared, name)) for name in ("mujoco", "pinocchio")}
    assert [one.outcome for one in cases.values()] == [Outcome.REFUSED, Outcome.AGREES]
    assert reason in cases["mujoco"].reason


def test_problem_in_an_included_file_is_located_in_that_file(tmp_path: Path) -> None:
    """Cover a file name with a colon."""
    (tmp_path / "part: 7.xml").write_text(
        "<mujocoinclude>\n<body><joint/>\n"
        '<geom size="0.1" mass="nan" kind="x"/></body>\n</mujocoinclude>'
    )
    main = tmp_path / "main.xml"
    main.write_text('<mujoco><worldbody><include file="part: 7.xml"/></worldbody></mujoco>')
    robot = read_compiled_robot(main)
    (problem,) = robot.obstacles
    assert (problem.file.name, problem.line) == ("part: 7.xml", 3)
    assert problem.sentence == "<geom mass> has 'nan'; expected a finite number"
    with pytest.raises(RobotError) as error:
        robot_system(robot)
    (where,) = failure_of(error.value).locations
    assert (where.file, where.line) == (str(problem.file), 3)


@pytest.mark.parametrize(("inertial", "sentence"), [
    ("", r"parts \(missing\); it gives body 'hand' its inertia: add it, or state an <in"),
    ('<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>',
     r"parts \(missing\): add it, or correct <mesh"),
])  # fmt: skip
def test_missing_mesh_is_named_with_its_line(tmp_path: Path, inertial: str, sentence: str) -> None:
    file = tmp_path / "arm.xml"
    mesh = '<mujoco>\n<compiler meshdir="parts"/><asset>\n<mesh name="m" file="none.stl"/>\n'
    body = f'<body name="hand">{inertial}<joint/><geom type="mesh" mesh="m"/></body>'
    file.write_text(f"{mesh}</asset><worldbody>{body}</worldbody></mujoco>")
    missing = r"arm\.xml:3: .*none\.stl does not exist, searched in .*"
    with pytest.raises(EngineError, match=missing + sentence):
        engines()["mujoco"].load(ModelSpec(file))


@pytest.mark.parametrize("part", [
    "<mujocoinclude><geom size='1'/></mujocoinclude>",
    "<mujoco><worldbody><light pos='0 0 3'/></worldbody></mujoco>",
])  # fmt: skip
def test_part_names_the_file_that_includes_it(part: str, tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    file = written(tmp_path / "parts", "part.xml", part)
    (problem,) = read_robot(file).obstacles
    assert "which includes it" not in problem.remedy
    whole = written(tmp_path, "whole.xml", '<mujoco><include file="parts/part.xml"/></mujoco>')
    (problem,) = read_robot(file).obstacles
    assert problem.remedy == f"open {whole}, which includes it"
