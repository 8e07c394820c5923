"""Differences of limits, friction, contacts and drives: their lines, and effects over a step."""

from pathlib import Path

import pytest

from physics_crosscheck.records import Outcome
from tests.compare.asking import compared, laws, result
from tests.compare.test_acting import SOFT, URDF
from tests.models import written

HOPPER = """<mujoco>
<compiler angle="radian"/>
<default><joint frictionloss="0.4" solreflimit="0.03 1"/></default>
<worldbody><geom name="floor" type="plane" size="5 5 1" friction="0.5"/>
<body name="trunk" pos="0 0 0.3"><freejoint/><geom name="trunk" type="sphere" size="0.1" mass="2"/>
<body name="leg" pos="0 0 -0.1">
<joint name="hip" axis="0 1 0" range="-0.5 0.5"/>
<geom name="foot" type="capsule" fromto="0 0 0 0 0 -0.17" size="0.03" mass="0.5" friction="0.8"/>
</body></body></worldbody>
<actuator>
<position name="servo" joint="hip" kp="30" kv="1" forcerange="-4 4"/>
</actuator></mujoco>"""


def hoppers(folder: Path, old: str, new: str) -> tuple[Path, Path]:
    return written(folder, "a.xml", HOPPER), written(folder, "b.xml", HOPPER, (old, new))


@pytest.mark.parametrize(("old", "new", "message", "line"), [
    ('friction="0.8"', 'friction="0.7"', "friction[0] of geom foot: 0.8 in A, 0.7 in B", 8),
    ('solreflimit="0.03 1"', 'solreflimit="0.03 0.9"',
     "solreflimit[1] of joint hip: 1 in A, 0.9 in B", 3),
    ('range="-0.5 0.5"', "", "range of joint hip: (-0.5 0.5) in A, none in B", 7),
    ('"-4 4"', '"-4 4.1"', "forcerange[1] of actuator servo: 4 in A, 4.1 in B", 11),
    ('angle="radian"/>', 'angle="radian"/><option cone="elliptic"/>',
     "cone of options: pyramidal in A, elliptic in B", 0),
])  # fmt: skip
def test_one_number_of_the_laws_is_named_with_its_line(
    old: str, new: str, message: str, line: int, tmp_path: Path
) -> None:
    """Catch a number of the laws that compare skips or gives no effect."""
    (row,) = laws(*hoppers(tmp_path, old, new))
    assert row.message == message
    assert row.effect is not None
    assert row.effect > 1e-7
    if line:
        assert row.where_a is not None
        assert row.where_a.line == line


@pytest.mark.parametrize(("new", "outcome"), [("0.4", Outcome.AGREES), ("0.9", Outcome.DIFFERS)])
def test_number_is_a_difference_if_it_has_an_effect(
    new: str, outcome: Outcome, tmp_path: Path
) -> None:
    """Catch a verdict from numbers that no contact uses: the larger friction acts."""
    floor = 'size="5 5 1" friction="{}"'
    comparison = compared(*hoppers(tmp_path, floor.format("0.5"), floor.format(new)))
    (row,) = result(comparison).laws or ()
    assert comparison.outcome is outcome
    assert bool(result(comparison).decisive) == bool(row.effect) == (outcome is Outcome.DIFFERS)


def test_equal_files_have_no_different_laws(tmp_path: Path) -> None:
    assert not laws(*hoppers(tmp_path, 'name="trunk" type', 'name="trunk" rgba="1 0 0 1" type'))


@pytest.mark.parametrize(("old", "new", "message"), [
    ('upper="1"', 'upper="0.9"', "range[1] of joint shoulder: 0.9 in A, 1 in B"),
    ('effort="20"', 'effort="19"', "forcerange of actuator on shoulder"),
    ('effort="20"', 'effort="20"', ""),
])  # fmt: skip
@pytest.mark.parametrize("is_first", [True, False])
def test_limits_of_a_urdf_are_compared_with_those_of_an_mjcf(
    old: str, new: str, message: str, is_first: bool, tmp_path: Path
) -> None:
    """Catch limits of rigid and soft joints that compare leaves out or invents."""
    pytest.importorskip("pybullet")
    urdf = written(tmp_path, "a.urdf", URDF, (old, new)), "pybullet"
    mjcf = written(tmp_path, "b.xml", SOFT), "mujoco"
    (a, engine_a), (b, engine_b) = (urdf, mjcf) if is_first else (mjcf, urdf)
    rows = laws(a, b, engine_a, engine_b)
    if not message:
        assert not rows
        return
    (row,) = rows
    effort = "effort of joint shoulder" if is_first else message
    swapped = "range[1] of joint shoulder: 1 in A, 0.9 in B" if not is_first else message
    assert row.message.startswith(effort if "actuator" in message else swapped)
    assert row.effect
    assert row.where_a is not None
    assert row.where_b is not None


LEG = """<robot name="leg"><link name="body"><contact><lateral_friction value="0.6"/></contact>
<inertial><mass value="2"/><inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/>
</inertial><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
<joint name="knee" type="revolute"><parent link="body"/><child link="shin"/>
<origin xyz="0.3 0 0"/><axis xyz="0 1 0"/>
<limit lower="-0.3" upper="0.4" effort="20" velocity="9"/></joint>
<link name="shin"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><box size="0.1 0.1 0.2"/></geometry></collision></link></robot>"""


@pytest.mark.parametrize(("old", "new", "message", "line"), [
    ('value="0.6"', 'value="0.5"', "lateral_friction of link body: 0.6 in A, 0.5 in B", 1),
    ('effort="20"', 'effort="21"', "effort of joint knee: 20 in A, 21 in B", 6),
])  # fmt: skip
def test_numbers_of_impulses_are_compared(
    old: str, new: str, message: str, line: int, tmp_path: Path
) -> None:
    """Catch numbers of limits, motors and contacts that differ between two URDFs."""
    pytest.importorskip("pybullet")
    a = written(tmp_path, "a.urdf", LEG)
    b = written(tmp_path, "b.urdf", LEG, (old, new))
    (row,) = laws(a, b, "pybullet", "pybullet", floating=True)
    assert row.message == message
    assert row.effect
    assert row.where_a is not None
    assert row.where_a.line == line
