"""Two files side by side: what their numbers act as, and the usual mistake that explains it."""

from __future__ import annotations

from pathlib import Path

import pytest

from physics_crosscheck.harness.interfaces.cli.main import main

ARM = """<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/>
<body pos="0 0 2"><joint name="hinge" axis="0 1 0"/>
<geom name="arm" type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02" mass="1" friction="0.7"/>
</body></worldbody><actuator><position joint="hinge" kp="20" dampratio="1"/></actuator></mujoco>"""


@pytest.mark.parametrize(("old", "new", "words"), [
    ('kp="20" dampratio="1"', 'kp="0.3490658503988659" dampratio="1"',
     "natural frequency 2.431 Hz in A, 0.3211 Hz in B: the gain of B is per degree"),
    ('dampratio="1"', 'kv="1"',
     "the damping of B is the dampratio of the other file, not resolved"),
    (' dampratio="1"', "", "damping ratio 1 in A, 0 in B: the damping of B is lost"),
    ('size="1 1 1"', 'size="1 1 1" friction="0.7"',
     "friction 1 in A, 0.7 in B: the friction of B is the product of the two of the other file"),
    ('friction="0.7"', 'friction="1.7"', "floor with arm: friction 1 in A, 1.7 in B"),
])  # fmt: skip
def test_a_usual_mistake_is_named(
    old: str, new: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.xml").write_text(ARM)
    (tmp_path / "b.xml").write_text(ARM.replace(old, new))
    main(["compare", str(tmp_path / "a.xml"), str(tmp_path / "b.xml"), "--engine", "mujoco"])
    assert words in " ".join(capsys.readouterr().out.split())


def test_another_order_of_clamps_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Catch equal limits of force that act before forces add up in one file, after in the other."""
    servo, motor = ARM.replace("dampratio", 'forcerange="-5 5" dampratio'), '<motor joint="hinge"'
    (tmp_path / "a.xml").write_text(servo)
    for other, words in (
        (ARM.replace("axis", 'actuatorfrcrange="-5 5" axis'),
         "in A, the drive is clamped, before forces add up; in B, the joint is clamped, after"),
        (ARM.replace('<position joint="hinge" kp="20" dampratio="1"',
                     f'{motor} gear="2" ctrlrange="-2.5 2.5"'),
         "largest force 5 N m in A, 5 N m in B: in A, the drive is clamped, before forces add up;"
         " in B, the control is clamped, before the gain"),
    ):  # fmt: skip
        (tmp_path / "b.xml").write_text(other)
        main(["compare", str(tmp_path / "a.xml"), str(tmp_path / "b.xml"), "--engine", "mujoco"])
        assert words in " ".join(capsys.readouterr().out.split())


def test_equal_files_have_no_such_lines(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.xml").write_text(ARM)
    (tmp_path / "b.xml").write_text(ARM.replace('name="arm"', 'name="arm" rgba="1 0 0 1"'))
    main(["compare", str(tmp_path / "a.xml"), str(tmp_path / "b.xml"), "--engine", "mujoco"])
    assert "act as" not in capsys.readouterr().out


URDF = """<robot name="arm"><link name="base"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
<origin xyz="0 0 1"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="20" velocity="9"/></joint>
<link name="upper"><inertial><origin xyz="0.2 0 0"/><mass value="2"/>
<inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""
SOFT = """<mujoco><compiler angle="radian"/><worldbody><body name="upper" pos="0 0 1">
<joint name="shoulder" axis="0 1 0" range="-1 1"/>
<inertial pos="0.2 0 0" mass="2" diaginertia="0.01 0.02 0.02"/></body></worldbody>
<actuator><position joint="shoulder" kp="50" forcerange="-20 20"/></actuator></mujoco>"""


def test_impulses_and_soft_constraints_are_side_by_side(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Catch quantities of an impulse engine that compare leaves out, or pairs with nothing."""
    pytest.importorskip("pybullet")
    (tmp_path / "a.urdf").write_text(URDF)
    (tmp_path / "b.xml").write_text(SOFT)
    engines = ["--engine-a", "pybullet", "--engine-b", "mujoco"]
    main(["compare", str(tmp_path / "a.urdf"), str(tmp_path / "b.xml"), *engines])
    text = " ".join(capsys.readouterr().out.split())
    assert "limits of shoulder: rebound 0.2 in A, 0.1353 in B: in A, at most, by the phase" in text
    assert "each step of 0.002 s removes 0.2 of a violation" in text
    assert "drive of shoulder: sag none in A, 0.07848 rad in B" in text
    assert "share of force" not in text  # equal
    assert "largest force" not in text  # equal, and clamped alike
    assert "default damping 0.04 1/s in A, none in B: in A, unless linearDamping" in text
