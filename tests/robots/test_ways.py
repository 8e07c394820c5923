"""Force paths, media and couplings of robot files: they agree, and small errors are detected."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from physics_crosscheck.harness.modelfiles.robot_targets import robots_below
from physics_crosscheck.records import Outcome
from tests.robots.planted import PreparedFile, prepare_file, tree_of

BUSHINGS = """<mujoco model="bushes">
  <compiler angle="radian"/>
  <option gravity="0 1 -9" integrator="RK4"/>
  <worldbody>
    <body name="root" pos="0.1 0.2 1.3" euler="0.2 0.4 0.6">
      <joint name="base" type="free" stiffness="60" damping="0.3"/>
      <inertial pos="0.1 0.05 0.2" mass="1.5" fullinertia="0.05 0.06 0.07 0.01 -0.005 0.004"/>
      <body pos="0 0.1 0.4" euler="0.5 0.3 0.1">
        <joint name="shoulder" type="ball" pos="0.02 0.1 0" stiffness="7 3 2" damping="0.1 0 0.03"/>
        <inertial pos="0.1 0.05 0.2" mass="0.9" diaginertia="0.02 0.03 0.04"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <general joint="base" gear="1 2 -0.5 0.3 0.2 -0.1" gainprm="3" biastype="affine"
      biasprm="0.2 0 -0.4"/>
    <general jointinparent="base" gear="0 0 0 0.3 0.7 -0.1" gainprm="0.6"/>
    <position joint="shoulder" gear="0.4 -0.8 0.6" kp="3" kv="0.2"/>
    <general jointinparent="shoulder" gear="0.5 0.1 -0.2" gainprm="0.7" biastype="affine"
      biasprm="0.1 -2 -0.3"/>
  </actuator>
</mujoco>
"""

FRAMES = """<mujoco model="frames">
  <compiler angle="radian"/>
  <option gravity="0 1 -9" integrator="RK4"/>
  <worldbody>
    <site name="mast" pos="0.3 0.1 0.2" euler="0.1 0.2 0.3"/>
    <body name="trunk" pos="0.1 0.2 0.3">
      <joint name="lean" axis="0.2 1 0"/>
      <inertial pos="0.1 0 0.2" mass="1.5" diaginertia="0.05 0.06 0.07"/>
      <body name="left" pos="0 0.1 0.4" euler="0.5 0.3 0.1">
        <joint name="swing" type="ball"/>
        <inertial pos="0.1 0.05 0.2" mass="0.9" diaginertia="0.02 0.03 0.04"/>
        <site name="hand" pos="0.2 0.1 0.3" euler="0.3 -0.2 0.4"/>
      </body>
      <body name="right" pos="0 -0.3 0.4">
        <joint name="bow" axis="1 0.3 0"/><joint name="reach" type="slide" axis="0 0 1"/>
        <inertial pos="0 0.05 0.2" mass="0.8" diaginertia="0.02 0.03 0.02"/>
        <site name="foot" pos="0.1 -0.2 0.4" euler="0.2 0.3 -0.1"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <general name="jet" site="hand" gear="1 -2 0.5 0.3 0.1 0.2" gainprm="2" biastype="affine"
      biasprm="0.3 0 -0.2"/>
    <general name="arm" site="hand" refsite="foot" gear="3 1 -2 0 0 0" gainprm="2"
      biastype="affine" biasprm="0.1 -4 -0.3"/>
    <general name="aim" site="foot" refsite="mast" gear="0.2 0 0 0.7 0.3 -0.4" gainprm="1"
      biastype="affine" biasprm="0.1 -2 -0.1"/>
    <general name="pump" joint="bow" dyntype="integrator" gainprm="3" actlimited="true"
      actrange="-1 1"/>
    <general name="slow" joint="reach" dyntype="filter" dynprm="0.2" gainprm="2" ctrlrange="-2 3"/>
    <general name="late" joint="lean" dyntype="filterexact" dynprm="0.1" gainprm="4"/>
    <muscle name="flesh" joint="lean" force="20" lengthrange="0.1 1"/>
  </actuator>
</mujoco>
"""

TENDONS = """<mujoco model="cords">
  <compiler angle="radian"/>
  <option gravity="0 1 -9" integrator="RK4"/>
  <worldbody>
    <site name="hook" pos="0.6 0.1 1.2"/><site name="ring" pos="-0.5 0.2 0.9"/>
    <body name="upper" pos="0.1 0.2 0.3">
      <joint name="hip" type="ball"/>
      <inertial pos="0.1 0 0.2" mass="1.5" diaginertia="0.05 0.06 0.07"/>
      <site name="a" pos="0.1 0.2 0.3"/><site name="b" pos="-0.1 0.1 0.4"/>
      <body name="lower" pos="0 0.1 0.4">
        <joint name="knee" axis="1 0.2 0"/>
        <inertial pos="0.1 0.05 0.2" mass="0.9" diaginertia="0.02 0.03 0.04"/>
        <site name="c" pos="0.2 0.1 0.3"/>
      </body>
    </body>
  </worldbody>
  <tendon>
    <spatial name="rope" stiffness="40 5 3" damping="0.4 0.1" springlength="0.3 0.9">
      <site site="hook"/><site site="a"/><site site="b"/><site site="c"/>
      <pulley divisor="2.5"/><site site="c"/><site site="ring"/></spatial>
    <spatial name="wire"><site site="ring"/><site site="c"/></spatial>
  </tendon>
  <actuator><position name="winch" tendon="wire" kp="12" kv="0.7" gear="1.5"/>
  </actuator>
</mujoco>
"""

EEL = """<mujoco model="eel">
  <compiler angle="radian"/>
  <option density="30" viscosity="0.2" wind="0.5 -0.3 0.2" integrator="RK4"/>
  <worldbody>
    <body name="head" pos="0 0 1" euler="0.1 0.2 0.3">
      <joint name="swing" axis="0.3 1 0"/>
      <geom type="box" size="0.1 0.02 0.2" pos="0.05 0 -0.2" euler="0.3 0 0.2" density="500"/>
      <body pos="0.1 0 0">
        <inertial pos="0.02 0 0.1" mass="0.4" diaginertia="0.002 0.001 0.0012"/></body>
      <body name="tail" pos="0.05 0 -0.4">
        <joint name="turn" type="ball" damping="0.01"/>
        <inertial pos="0 0.02 -0.1" mass="0.7" fullinertia="0.004 0.005 0.006 0.001 0.0005 0.0002"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""

TIED = """<mujoco model="tied">
  <compiler angle="radian"/>
  <option gravity="0 1 -9"/>
  <default><joint damping="0.2"/></default>
  <worldbody>
    <body name="trunk" pos="0.1 0.2 0.3">
      <joint name="yaw" axis="0.1 0.2 1" ref="0.3"/>
      <inertial pos="0.1 0 0.2" mass="1.5" diaginertia="0.05 0.06 0.07"/>
      <body pos="0 0.1 0.4" euler="0.5 0.3 0.1">
        <joint name="lift" axis="0 1 0.2"/>
        <inertial pos="0.1 0.05 0.2" mass="0.9" diaginertia="0.02 0.03 0.04"/>
        <body pos="0 0 0.4">
          <joint name="extend" type="slide" axis="0 0 1" ref="0.1"/>
          <inertial pos="0 0.05 0.2" mass="0.8" diaginertia="0.02 0.03 0.02"/>
          <body pos="0 0 0.2">
            <joint name="nod" axis="1 0 0.1"/>
            <inertial pos="0 0.05 0.1" mass="0.4" diaginertia="0.01 0.02 0.01"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <tendon>
    <fixed name="one"><joint joint="yaw" coef="0.5"/><joint joint="lift" coef="-1.2"/></fixed>
    <fixed name="two"><joint joint="extend" coef="2"/><joint joint="nod" coef="0.4"/></fixed>
  </tendon>
  <equality>
    <tendon tendon1="one" tendon2="two" polycoef="0.1 0.7 0 0 0"/>
  </equality>
</mujoco>
"""

FILES = {"bushes": BUSHINGS, "frames": FRAMES, "cords": TENDONS, "eel": EEL, "tied": TIED}
COMPILED = ("how MuJoCo compiles the file",)
Prepare = Callable[[str], PreparedFile]


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Prepare:
    """Return a function that prepares each of the files once."""
    return cache(lambda name: prepare_file(tmp_path_factory.mktemp(name), FILES[name]))


@pytest.mark.parametrize(("name", "integrator", "left_out"), [
    ("bushes", "implicitfast", COMPILED), ("cords", "RK4", COMPILED), ("tied", "Euler", COMPILED),
    ("frames", "Euler", ("actuators of other laws or transmissions",)),
    ("eel", "implicit", ()),
])  # fmt: skip
def test_force_paths_media_and_couplings_agree(
    prepared: Prepare, name: str, integrator: str, left_out: tuple[str, ...]
) -> None:
    """Cover springs and motors of balls and free joints, forces on sites, motors with a state,
    pulleys, nonlinear dampers, springs with a dead band, a welded body and its box in a wind.
    """
    file = prepared(name)
    assert file.outcome(integrator=integrator) == (Outcome.AGREES, "")
    assert set(left_out) <= set(file.left_out)
    assert left_out != COMPILED or file.left_out == COMPILED
    assert not [one for one in file.left_out if "medium" in one]


@pytest.mark.parametrize(("name", "old", "new"), [
    ("bushes", '"0.4 -0.8 0.6"', '"0.4 -0.800001 0.6"'),
    ("bushes", 'stiffness="60"', 'stiffness="60.00006"'),
    ("bushes", '"7 3 2"', '"7 3.000003 2"'), ("bushes", '"0.1 0 0.03"', '"0.1 0 0.03003"'),
    ("bushes", "-0.5 0.3 0.2", "-0.5 0.3000005 0.2"),
    ("bushes", '"0.5 0.1 -0.2"', '"0.5 0.1000005 -0.2"'),
    ("bushes", 'kv="0.2"', 'kv="0.2000004"'), ("bushes", '"0.1 -2 -0.3"', '"0.1 -2.000002 -0.3"'),
    ("frames", '"3 1 -2 0 0 0"', '"3 1 -2.000002 0 0 0"'),
    ("frames", 'gainprm="3"', 'gainprm="3.000003"'),
    ("frames", "0.5 0.3 0.1 0.2", "0.5 0.3000005 0.1 0.2"),
    ("frames", "0.7 0.3 -0.4", "0.7 0.3000005 -0.4"),
    ("frames", '"0.2 0.1 0.3"', '"0.2 0.1000003 0.3"'),
    ("frames", '"0.3 -0.2 0.4"', '"0.3 -0.2000003 0.4"'),
    ("frames", '"0.3 0 -0.2"', '"0.3 0 -0.2000005"'),
    ("frames", 'gainprm="4"', 'gainprm="4.000004"'),
    ("cords", 'springlength="0.3 0.9"', 'springlength="0.3 0.9000005"'),
    ("cords", '"40 5 3"', '"40 5.000005 3"'), ("cords", '"0.4 0.1"', '"0.4 0.1000003"'),
    ("cords", 'gear="1.5"', 'gear="1.500002"'), ("cords", 'kp="12"', 'kp="12.00001"'),
    ("cords", '"0.1 0.2 0.3"/><site', '"0.1 0.2000002 0.3"/><site'),
    ("eel", 'density="30"', 'density="30.00003"'), ("eel", '"0.2" wind', '"0.2000004" wind'),
    ("tied", '"0.1 0.7 0 0 0"', '"0.1000001 0.7 0 0 0"'),
    ("tied", 'coef="-1.2"', 'coef="-1.200002"'),
])  # fmt: skip
def test_error_of_a_millionth_differs(prepared: Prepare, name: str, old: str, new: str) -> None:
    assert prepared(name).outcome_with(old, new) is Outcome.DIFFERS


@pytest.mark.slow
@pytest.mark.parametrize(("name", "old", "new", "address", "line"), [
    ("cords", 'divisor="2.5"', 'divisor="2.500003"', "spatial[rope]/pulley@divisor", 20),
    ("eel", '"0.5 -0.3 0.2"', '"0.5 -0.3000006 0.2"', "mujoco/option@wind[1]", 3),
])  # fmt: skip
def test_error_of_a_millionth_is_named(
    prepared: Prepare, name: str, old: str, new: str, address: str, line: int
) -> None:
    prepared(name).assert_named(old, new, address, line)


UNSUPPORTED = {
    "tendons around shapes that pull":
        '<spatial stiffness="3"><site site="hook"/><geom geom="drum"/><site site="a"/></spatial>',
    "armatures along tendons in space":
        '<spatial armature="0.3"><site site="hook"/><site site="a"/></spatial>',
}  # fmt: skip


@pytest.mark.parametrize("feature", UNSUPPORTED)
def test_unsupported_tendons_are_disabled_and_reported(tmp_path: Path, feature: str) -> None:
    text = TENDONS.replace("</tendon>", UNSUPPORTED[feature] + "</tendon>")
    drum = '<geom name="drum" type="sphere" size="0.1" pos="0.4 0.1 1" contype="0"/>'
    prepared = prepare_file(tmp_path, text.replace("<worldbody>", f"<worldbody>{drum}"))
    assert prepared.accelerations() is Outcome.AGREES
    assert feature in prepared.left_out


def test_ellipsoid_drag_is_left_out_and_reported(tmp_path: Path) -> None:
    """Confirm that bodies with ellipsoids do not get the drag of boxes."""
    shaped = EEL.replace(' density="500"', ' density="500" fluidshape="ellipsoid"')
    prepared = prepare_file(tmp_path, shaped)
    assert prepared.accelerations() is Outcome.AGREES
    assert "ellipsoids in a medium" in prepared.left_out
    assert len(tree_of(prepared.file).immersed) == 2


def test_spring_and_damper_flags_disable_drag_and_gravity_compensation(tmp_path: Path) -> None:
    flags = '<option><flag spring="disable" damper="disable"/></option><worldbody>'
    text = EEL.replace("<worldbody>", flags).replace('"tail"', '"tail" gravcomp="0.5"')
    prepared = prepare_file(tmp_path, text)
    assert prepared.accelerations() is Outcome.AGREES
    assert tree_of(prepared.file).fluid is None


def test_joint_follows_others_through_tendons(prepared: Prepare) -> None:
    """Choose the joint with the largest coefficient that does not follow or lead another yet."""
    tree = tree_of(prepared("tied").file)
    names = [link.name for link in tree.links]
    couplings = {
        names[one.follower]: {names[i]: share for i, share in one.leaders} for one in tree.couplings
    }
    assert couplings["extend"] == pytest.approx({"yaw": 0.5 / 1.4, "lift": -1.2 / 1.4, "nod": -0.2})
    assert list(couplings) == ["extend"]


def test_nonlinear_equality_is_left_out_and_reported(tmp_path: Path) -> None:
    text = TIED.replace("0.1 0.7 0 0 0", "0.1 0.7 0.2 0 0")
    prepared = prepare_file(tmp_path, text)
    assert "equality constraints" in prepared.left_out
    assert prepared.outcome() == (Outcome.AGREES, "")


def test_include_file_is_not_listed_as_a_robot(tmp_path: Path) -> None:
    for name, root in (("arm", "mujoco"), ("part", "mujocoinclude"), ("page", "html")):
        (tmp_path / f"{name}.xml").write_text(f"<{root}></{root}>")
    assert robots_below(tmp_path) == [tmp_path / "arm.xml"]
