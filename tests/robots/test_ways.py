"""Force paths of robot files, and the formats that robots are read from."""

from pathlib import Path

import pytest

from physics_crosscheck.harness.modelfiles.robot_targets import robots_below
from physics_crosscheck.records import Outcome
from tests.robots.planted import PreparedFile, prepare_file

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


@pytest.fixture(scope="module")
def bushings(tmp_path_factory: pytest.TempPathFactory) -> PreparedFile:
    return prepare_file(tmp_path_factory.mktemp("bushes"), BUSHINGS)


def test_springs_and_motors_of_balls_and_free_joints_agree(bushings: PreparedFile) -> None:
    assert bushings.outcome(integrator="implicitfast") == (Outcome.AGREES, "")
    assert bushings.left_out == ("how MuJoCo compiles the file",)


def test_error_of_a_millionth_in_ball_joints_differs(bushings: PreparedFile) -> None:
    for old, new in (
        ('"0.4 -0.8 0.6"', '"0.4 -0.800001 0.6"'), ('stiffness="60"', 'stiffness="60.00006"'),
        ('"7 3 2"', '"7 3.000003 2"'), ('"0.1 0 0.03"', '"0.1 0 0.03003"'),
        ('-0.5 0.3 0.2', '-0.5 0.3000005 0.2'), ('"0.5 0.1 -0.2"', '"0.5 0.1000005 -0.2"'),
        ('kv="0.2"', 'kv="0.2000004"'), ('"0.1 -2 -0.3"', '"0.1 -2.000002 -0.3"'),
    ):  # fmt: skip
        assert bushings.outcome_with(old, new) is Outcome.DIFFERS, new


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


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> PreparedFile:
    return prepare_file(tmp_path_factory.mktemp("frames"), FRAMES)


def test_forces_on_sites_and_motors_with_a_state_agree(frames: PreparedFile) -> None:
    assert frames.outcome(integrator="Euler") == (Outcome.AGREES, "")
    assert "actuators of other laws or transmissions" in frames.left_out


def test_error_of_a_millionth_in_site_forces_differs(frames: PreparedFile) -> None:
    for old, new in (
        ('"3 1 -2 0 0 0"', '"3 1 -2.000002 0 0 0"'), ('gainprm="3"', 'gainprm="3.000003"'),
        ("0.5 0.3 0.1 0.2", "0.5 0.3000005 0.1 0.2"), ("0.7 0.3 -0.4", "0.7 0.3000005 -0.4"),
        ('"0.2 0.1 0.3"', '"0.2 0.1000003 0.3"'), ('"0.3 -0.2 0.4"', '"0.3 -0.2000003 0.4"'),
        ('"0.3 0 -0.2"', '"0.3 0 -0.2000005"'), ('gainprm="4"', 'gainprm="4.000004"'),
    ):  # fmt: skip
        assert frames.outcome_with(old, new) is Outcome.DIFFERS, new


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


@pytest.fixture(scope="module")
def tendons(tmp_path_factory: pytest.TempPathFactory) -> PreparedFile:
    return prepare_file(tmp_path_factory.mktemp("cords"), TENDONS)


def test_spatial_tendons_agree(tendons: PreparedFile) -> None:
    """Cover pulleys, nonlinear dampers, and springs with a dead band that no segment leaves."""
    assert tendons.outcome() == (Outcome.AGREES, "")
    assert tendons.left_out == ("how MuJoCo compiles the file",)


@pytest.mark.slow
def test_error_of_a_millionth_in_a_spatial_tendon_is_named(tendons: PreparedFile) -> None:
    tendons.assert_named('divisor="2.5"', 'divisor="2.500003"', "spatial[rope]/pulley@divisor", 20)


def test_error_of_a_millionth_in_spatial_tendons_differs(tendons: PreparedFile) -> None:
    for old, new in (
        ('springlength="0.3 0.9"', 'springlength="0.3 0.9000005"'),
        ('"40 5 3"', '"40 5.000005 3"'), ('"0.4 0.1"', '"0.4 0.1000003"'),
        ('gear="1.5"', 'gear="1.500002"'),
        ('"0.1 0.2 0.3"/><site', '"0.1 0.2000002 0.3"/><site'), ('kp="12"', 'kp="12.00001"'),
    ):  # fmt: skip
        assert tendons.outcome_with(old, new) is Outcome.DIFFERS, new


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


def test_include_file_is_not_listed_as_a_robot(tmp_path: Path) -> None:
    for name, root in (("arm", "mujoco"), ("part", "mujocoinclude"), ("page", "html")):
        (tmp_path / f"{name}.xml").write_text(f"<{root}></{root}>")
    assert robots_below(tmp_path) == [tmp_path / "arm.xml"]
