"""Files that an engine compiles, as trees of bodies: their equations are what the engine does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from harness.cases.robot import prepare_robot, run_robot
from harness.engines.protocol import ModelSpec
from harness.engines.registry import engines
from harness.records.outcome import Outcome
from harness.robots.compiled import compiler, read_compiled_robot
from harness.robots.system import RobotError

ASSETS = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"
SOUND = {
    "half_cheetah": 9, "hopper": 6, "inverted_double_pendulum": 3, "inverted_pendulum": 2,
    "point": 3, "pusher": 11, "pusher_v5": 11, "reacher": 4, "swimmer": 5, "walker2d": 9,
    "walker2d_v5": 9,
}  # fmt: skip
"""Joints of those that have neither ball nor free ones."""

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


def written(folder: Path, more: str = "", **words: Any) -> Path:
    given = {"integrator": "Euler", "density": 0, "gravcomp": 0, **words}
    file = folder / "hard.xml"
    file.write_text(HARD.format(more=more, **given))
    return file


def outcome(file: Path) -> tuple[Outcome, str]:
    engine = compiler(".xml")
    assert engine is not None
    case = run_robot(prepare_robot(file).task(engine.name, 1e-9))
    return case.outcome, case.reason


@pytest.mark.parametrize("name", SOUND)
def test_a_robot_that_others_wrote_agrees(name: str) -> None:
    file = ASSETS / f"{name}.xml"
    assert outcome(file) == (Outcome.AGREES, "")
    assert len(prepare_robot(file).names) == SOUND[name]


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast", "RK4"])
def test_whatever_a_format_resolves_agrees(tmp_path: Path, integrator: str) -> None:
    """Anchors, references, several joints a body, welded bodies, tensors with products, shapes."""
    file = written(tmp_path, integrator=integrator)
    assert outcome(file) == (Outcome.AGREES, "")
    prepared = prepare_robot(file)
    assert prepared.names == ("turn", "shift", "joint_2", "wave")
    assert prepared.record.title.startswith("4 joints, 3 links in 4 bodies, ")
    assert set(prepared.left_out) == {
        "limits of position", "dry friction", "contact geometry (2)",
        "how MuJoCo compiles the file",
    }  # fmt: skip


MORE = {
    "actuators": '<actuator><position joint="turn" kp="50"/></actuator>',
    "equality constraints": '<equality><joint joint1="turn" joint2="wave"/></equality>',
}


@pytest.mark.parametrize("what", MORE)
def test_what_is_left_out_acts_on_nothing_and_is_told(tmp_path: Path, what: str) -> None:
    file = written(tmp_path, MORE[what])
    assert outcome(file) == (Outcome.AGREES, "")
    assert what in prepare_robot(file).left_out


@pytest.mark.parametrize(("what", "words"), [
    ("gravity compensation", {"gravcomp": 0.5}), ("a medium", {"density": 1.2}),
])  # fmt: skip
def test_so_are_what_compensates_gravity_and_a_medium(
    tmp_path: Path, what: str, words: dict[str, Any]
) -> None:
    file = written(tmp_path, **words)
    assert outcome(file) == (Outcome.AGREES, "")
    assert what in prepare_robot(file).left_out


def test_with_it_they_do_act(tmp_path: Path) -> None:
    """So that it is the settings that leave them out."""
    more = MORE["actuators"] + MORE["equality constraints"]
    file = written(tmp_path, more, gravcomp=0.5, density=1000)
    engine = compiler(".xml")
    assert engine is not None
    loads = [{"smooth": True}, {"smooth": True, "couplings": False}]
    changes = []
    for settings in loads:
        model = engines()[engine.name].load(ModelSpec(path=file, settings=settings, springs=()))
        _, v = model.rollout(np.full((1, 4), 0.3), np.zeros((1, 4)), 1e-4, 1, None, 1)
        changes.append(v[0, 0])
    assert np.max(np.abs(changes[0] - changes[1])) > 1e-3


@pytest.mark.parametrize(("more", "told"), [
    ('<tendon><fixed stiffness="3"><joint joint="turn" coef="1"/></fixed></tendon>',
     "tendons that pull: not covered yet"),
    ('<worldbody><body name="b"><freejoint name="f"/><geom size="0.1"/></body></worldbody>',
     "free joints (f): not covered yet"),
    ('<worldbody><body><joint type="ball"/><geom size="0.1"/></body></worldbody>',
     "ball joints (one without a name): not covered yet"),
])  # fmt: skip
def test_what_is_not_covered_is_told_by_name(tmp_path: Path, more: str, told: str) -> None:
    file = written(tmp_path, more)
    with pytest.raises(RobotError, match=r"hard\.xml: ") as caught:
        prepare_robot(file)
    assert told in str(caught.value)


def test_all_of_it_is_told_at_once(tmp_path: Path) -> None:
    tendon = '<tendon><fixed stiffness="3"><joint joint="turn" coef="1"/></fixed></tendon>'
    ball = '<worldbody><body><joint type="ball"/><geom size="0.1"/></body></worldbody>'
    robot = read_compiled_robot(written(tmp_path, tendon + ball))
    assert robot.tree is None
    assert len(robot.obstacles) == 2


def test_a_file_that_is_not_compiled_is_told_with_its_name(tmp_path: Path) -> None:
    file = tmp_path / "r.xml"
    file.write_text('<mujoco><worldbody><body><joint type="screw"/></body></worldbody></mujoco>')
    (one,) = read_compiled_robot(file).obstacles
    assert "r.xml" in str(one)
    assert "screw" in str(one)


def test_a_file_without_a_joint_is_told(tmp_path: Path) -> None:
    file = tmp_path / "r.xml"
    file.write_text('<mujoco><worldbody><geom size="1"/></worldbody></mujoco>')
    assert [one.sentence for one in read_compiled_robot(file).obstacles] == [
        "it has no joint that moves"
    ]
