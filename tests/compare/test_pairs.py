"""One edit of a file: red where it changes what a run judges, green where it is only a spelling."""

from pathlib import Path

import pytest

from physics_crosscheck.records import Outcome
from tests.compare.asking import compared
from tests.models import written

MJCF = """<mujoco>
<compiler angle="radian"/>
<option timestep="0.002" integrator="Euler"><flag energy="disable"/></option>
<default><geom friction="0.7 0.1 0.1"/><default class="light"><joint damping="0.2"/></default>
</default><asset><hfield name="hill" nrow="2" ncol="2" size="1 1 1 1" elevation="0 1 2 3"/></asset>
<worldbody><geom name="floor" type="plane" size="5 5 1"/>
<body name="box" pos="0 0 0.3"><freejoint name="root"/>
<geom name="trunk" type="box" size="0.1 0.12 0.05" mass="3"/><site name="tip" pos="0.1 0 0"/>
<body name="leg" pos="0 -0.1 -0.1" euler="0 0.3 0"><joint name="hip" axis="0 1 0" range="-0.5 0.5"
 damping="0.2" frictionloss="0.1"/>
<geom name="foot" type="sphere" size="0.05" pos="0 0 -0.2" mass="0.5" friction="0.9"/></body>
<body name="arm" pos="0 0.1 -0.1"><joint name="elbow" axis="1 0 0" damping="0.2"/>
<geom name="hand" type="capsule" size="0.04 0.1" mass="0.4" contype="1"/></body>
</body></worldbody><contact><pair geom1="hand" geom2="trunk"/></contact>
<contact><exclude body1="leg" body2="arm"/></contact>
<equality><joint joint1="hip" joint2="elbow" polycoef="0 0.5"/></equality>
<tendon><fixed name="cord" range="-1 1"><joint joint="hip" coef="1"/></fixed></tendon>
<actuator><motor name="m" joint="hip" ctrlrange="-1 1" forcerange="-3 3"/></actuator>
<equality><weld name="dock" body1="arm" active="false"/></equality>
</mujoco>"""

URDF = """<robot name="r"><link name="base"/>
<joint name="a" type="revolute"><parent link="base"/><child link="one"/><origin xyz="0 0 0.5"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="20" velocity="3"/>
<dynamics damping="0.1" friction="0.2"/></joint>
<link name="one"><inertial><origin xyz="0 0 0.2"/><mass value="1"/>
<inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
<visual><geometry><sphere radius="0.1"/></geometry></visual>
<collision><origin xyz="0 0 0.1" rpy="0 0 0"/><geometry><box size="0.1 0.2 0.3"/></geometry>
</collision></link>
<joint name="b" type="prismatic"><parent link="one"/><child link="two"/><origin xyz="0 0 0.4"/>
<axis xyz="0 0 1"/><limit lower="0" upper="0.1" effort="5" velocity="1"/>
<mimic joint="a" multiplier="0.05"/></joint>
<link name="two"><inertial><mass value="0.5"/>
<inertia ixx="0.002" iyy="0.002" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial></link>
</robot>"""

SDF = (Path(__file__).parents[2] / "docs/cases/flap.sdf").read_text()

OF_SDF = (
    ("<mass>0.7<", "<mass>0.71<", "mass", 10),
    ("<upper>1<", "<upper>1.1<", "range", 8),
    ("<effort>20<", "<effort>21<", "effort", 8),
    ("<friction>0.2<", "<friction>0.3<", "friction", 9),
    ("<xyz>0 1 0<", "<xyz>1 0 0<", "axis", 8),
    ("<size>0.1 0.1 0.4<", "<size>0.1 0.1 0.5<", "size of shape", 13),
    ("<pose>0 0 0.1 0 0 0<", "<pose>0 0 0.11 0 0 0<", "place of shape", 12),
    ("<mu>0.9<", "<mu>0.8<", "mu", 14),
    ("<max_step_size>0.002<", "<max_step_size>0.004<", "max_step_size", 3),
    ("<mass>0.7<", "<mass>7e-1<", "", 0),
    ('name="m"', 'name="n"', "", 0),
)  # fmt: skip

RED = (
    ('timestep="0.002"', 'timestep="0.004"', "timestep", 3),
    ('integrator="Euler"', 'integrator="RK4"', "integrator", 3),
    ("<option ", '<option cone="elliptic" ', "cone", 3),
    ("<option ", '<option noslip_iterations="3" ', "noslip_iterations", 3),
    ("<option ", '<option density="1.2" wind="1 0 0" ', "density", 3),
    ('active="false"', 'active="true"', "active of weld dock", 19),
    ('active="false"', 'active="false" torquescale="2"', "inactive equality weld dock: other", 19),
    ('energy="disable"', 'contact="disable"', "contact", 3),
    ('energy="disable"', 'filterparent="disable"', "filterparent", 3),
    ('<geom name="floor" type="plane" size="5 5 1"/>', "", "floor", 6),
    ('type="plane"', 'type="plane" euler="0.02 0 0"', "floor", 6),
    ('type="plane"', 'type="plane" pos="0 0 0.01"', "floor", 6),
    ('size="0.1 0.12 0.05" mass', 'size="0.1 0.12 0.06" mass', "trunk", 8),
    ('size="0.05" pos="0 0 -0.2"', 'size="0.05" pos="0 0 -0.21"', "foot", 11),
    ('pos="0 0 -0.2" mass', '\npos="0 0 -0.21" mass', "foot", 12),
    ("0 1 2 3", "0 1 2 4", "elevation of hfield hill: other heights", 5),
    ('size="1 1 1 1"', 'size="1 1 2 1"', "size of hfield hill", 5),
    ('contype="1"', 'contype="2" conaffinity="2"', "hand", 13),
    ('contype="1"', 'contype="1" gap="0.01"', "gap", 13),
    ('contype="1"', 'contype="1" surfacevel="0.1 0 0 0 0 0"', "surfacevel", 13),
    ('<contact><exclude body1="leg" body2="arm"/></contact>', "", "contacts", 0),
    ("<exclude ", '<pair geom1="floor" geom2="foot" friction="1 1 1 1 1"/><exclude ', "pair", 0),
    ("<pair ", '<pair geom1="trunk" geom2="hand"/><pair ', "pair", 0),
    ('friction="0.9"', 'friction="1.9"', "friction[0] of geom foot", 11),
    ('polycoef="0 0.5"', 'polycoef="0 0.6"', "polycoef", 16),
    ("<equality>", '<equality><weld body1="arm"/>', "weld", 0),
    ('range="-0.5 0.5"', 'range="-0.5 0.51"', "range[1] of joint hip", 9),
    ('frictionloss="0.1"', "", "frictionloss", 10),
    ('coef="1"', 'coef="2"', "path of tendon cord", 17),
    ('range="-1 1"', 'range="-1 1.2"', "range[1] of tendon cord", 17),
    ('"-3 3"', '"-3 4"', "forcerange", 18),
    ('name="tip" pos="0.1 0 0"', 'name="tip" pos="0.1 0 0" euler="0 0 0.1"', "frame tip", 8),
    ('axis="0 1 0" range', 'axis="0 0 1" range', "axis", 9),
    ('effort="20"', 'effort="21"', "effort of joint a", 3),
    ('velocity="3"', 'velocity="4"', "velocity of joint a", 3),
    ('friction="0.2"', 'friction="0.3"', "friction", 4),
    ('multiplier="0.05"', 'multiplier="0.06"', "coupling of joint b", 12),
    ('<mimic joint="a" multiplier="0.05"/>', "", "coupling of joint b", 12),
    ('size="0.1 0.2 0.3"', 'size="0.1 0.2 0.4"', "one", 8),
    ('xyz="0 0 0.1" rpy', 'xyz="0 0 0.09" rpy', "one", 8),
    ("</robot>", '<gazebo reference="one"><mu1>0.4</mu1></gazebo></robot>', "gazebo", 0),
    ('xyz="0 0 0.5"', 'xyz="0 0 0.6"', "place of joint a", 2),
    ('lower="-1"', 'lower="-1.1"', "range", 3),
)  # fmt: skip

GREEN = (
    (' damping="0.2"/>\n<geom name="hand"', ' class="light"/>\n<geom name="hand"'),
    ('type="capsule" size="0.04 0.1"', 'type="capsule" size="0.04" fromto="0 0 0.1 0 0 -0.1"'),
    ('friction="0.9"', 'friction="0.9 0.1 0.1"'),
    ('<body name="leg" pos="0 -0.1 -0.1"', '<body name="leg" pos="0 -0.10 -1e-1"'),
    ('euler="0 0.3 0"', 'quat="0.988771 0 0.149438 0"'),  # six digits
    ('body1="leg" body2="arm"', 'body1="arm" body2="leg"'),
    ('name="foot"', 'name="sole"'),
    ('size="0.1 0.12 0.05" mass', 'size="0.12 0.1 0.05" euler="0 0 1.5707963267948966" mass'),
    ('type="plane" size="5 5 1"', 'type="plane" size="9 9 1" rgba="1 0 0 1"'),
    ('energy="disable"', 'energy="enable"'),
    ("<option ", '<option wind="3 0 0" '),  # without a medium
    ('rpy="0 0 0"', 'rpy="0 0 6.283185307179586"'),
    ('radius="0.1"', 'radius="0.2"'),
    ('axis xyz="0 1 0"', 'axis xyz="0 2 0"'),
    ('size="0.1 0.2 0.3"', 'size="0.10 0.20 3e-1"'),
)


FORMATS = ((URDF, "urdf"), (MJCF, "xml"), (SDF, "sdf"))


def edited(folder: Path, old: str, new: str) -> tuple[Path, Path]:
    text, name = next((t, n) for t, n in FORMATS if old in t)
    a = written(folder, f"a.{name}", text)
    return a, written(folder, f"b.{name}", text.replace(old, new, 1))


@pytest.mark.parametrize(("old", "new", "named", "line"), RED)
def test_edit_that_a_run_judges_is_red_and_named(
    old: str, new: str, named: str, line: int, tmp_path: Path
) -> None:
    """Catch an edit that no motion shows, and that compare takes for none or does not name."""
    comparison = compared(*edited(tmp_path, old, new))
    assert comparison.outcome is Outcome.DIFFERS
    assert named in comparison.reason or "_dot ends" in comparison.reason
    row = comparison.compared.decisive if comparison.compared else None
    if line and row is not None:
        assert line in {where.line for where in (row.where_a, row.where_b) if where}


@pytest.mark.parametrize(("old", "new", "named", "line"), OF_SDF)
def test_edit_of_an_sdf_is_red_if_a_run_judges_it(
    old: str, new: str, named: str, line: int, tmp_path: Path
) -> None:
    """Catch an edit of an SDF that compare takes for none, or a spelling that it fails."""
    pytest.importorskip("pydrake")
    if named:
        test_edit_that_a_run_judges_is_red_and_named(old, new, named, line, tmp_path)
    else:
        test_edit_of_a_spelling_is_green(old, new, tmp_path)


@pytest.mark.parametrize(("old", "new"), GREEN)
def test_edit_of_a_spelling_is_green(old: str, new: str, tmp_path: Path) -> None:
    """Catch a difference of texts that both files mean alike."""
    comparison = compared(*edited(tmp_path, old, new))
    assert comparison.outcome is Outcome.AGREES, comparison.reason
