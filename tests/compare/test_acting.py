"""Compare how the numbers of two files act, and name the usual mistake."""

import io
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest
from rich.console import Console

from physics_crosscheck.harness.records.comparison import Compared, ComparedActing
from physics_crosscheck.harness.render.terminal.comparison import _print_acting
from tests.compare.asking import acting, compared, printed

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
])  # fmt: skip
def test_usual_mistake_is_named(old: str, new: str, words: str, tmp_path: Path) -> None:
    assert words in lines_of(tmp_path, ARM, ARM.replace(old, new))


def lines_of(folder: Path, a: str, b: str) -> str:
    """Return the printed quantities of two texts that differ."""
    for name, text in (("a.xml", a), ("b.xml", b)):
        (folder / name).write_text(text)
    return lines(acting(folder / "a.xml", folder / "b.xml"))


def lines(rows: tuple[ComparedActing, ...]) -> str:
    out = io.StringIO()
    _print_acting(Console(file=out, width=300), cast(Compared, SimpleNamespace(acting=rows)))
    return " ".join(out.getvalue().split())


def test_different_order_of_clamps_is_named(tmp_path: Path) -> None:
    """Catch equal limits of force that act before forces add up in one file, after in the other."""
    servo, motor = ARM.replace("dampratio", 'forcerange="-5 5" dampratio'), '<motor joint="hinge"'
    for other, words in (
        (ARM.replace("axis", 'actuatorfrcrange="-5 5" axis'),
         "in A, the drive is clamped, before forces add up; in B, the joint is clamped, after"),
        (ARM.replace('<position joint="hinge" kp="20" dampratio="1"',
                     f'{motor} gear="2" ctrlrange="-2.5 2.5"'),
         "largest force 5 N m in A, 5 N m in B: in A, the drive is clamped, before forces add up;"
         " in B, the control is clamped, before the gain"),
    ):  # fmt: skip
        assert words in lines_of(tmp_path, servo, other)


def test_comparison_prints_acting_quantities_unless_files_are_equal(tmp_path: Path) -> None:
    """Catch a comparison that omits them."""
    assert not lines_of(tmp_path, ARM, ARM.replace('name="arm"', 'name="arm" rgba="1 0 0 1"'))
    (tmp_path / "b.xml").write_text(ARM.replace('friction="0.7"', 'friction="1.7"'))
    text = printed(compared(tmp_path / "a.xml", tmp_path / "b.xml"))
    assert "act as" in text
    assert "floor with arm: friction 1 in A, 1.7 in B" in text


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


def test_impulses_and_soft_constraints_are_compared(tmp_path: Path) -> None:
    """Catch quantities of an impulse engine that compare leaves out or does not pair."""
    pytest.importorskip("pybullet")
    (tmp_path / "a.urdf").write_text(URDF)
    (tmp_path / "b.xml").write_text(SOFT)
    text = lines(acting(tmp_path / "a.urdf", tmp_path / "b.xml", "pybullet"))
    assert "limits of shoulder: rebound 0.2 in A, 0.1353 in B: in A, at most, by the phase" in text
    assert "each step of 0.002 s removes 0.2 of a violation" in text
    assert "drive of shoulder: sag none in A, 0.07848 rad in B" in text
    assert "share of force" not in text  # equal
    assert "largest force" not in text  # equal, and clamped alike
    assert "default damping 0.04 1/s in A, none in B: in A, unless linearDamping" in text
