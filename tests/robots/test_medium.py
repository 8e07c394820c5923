"""Robots in a medium, and joints that follow others."""

from pathlib import Path

import pytest

from physics_crosscheck.records import Outcome
from tests.robots.planted import PreparedFile, prepare_file, tree_of

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


@pytest.fixture(scope="module")
def eel(tmp_path_factory: pytest.TempPathFactory) -> PreparedFile:
    return prepare_file(tmp_path_factory.mktemp("eel"), EEL)


def test_bodies_in_a_wind_agree(eel: PreparedFile) -> None:
    """Cover a welded body with its separate box, and a box with products of inertia."""
    assert eel.outcome(integrator="implicit") == (Outcome.AGREES, "")
    assert not [one for one in eel.left_out if "medium" in one]


def test_error_of_a_millionth_in_the_medium_differs(eel: PreparedFile) -> None:
    assert eel.outcome_with('density="30"', 'density="30.00003"') is Outcome.DIFFERS
    assert eel.outcome_with('viscosity="0.2"', 'viscosity="0.2000004"') is Outcome.DIFFERS


@pytest.mark.slow
def test_error_of_a_millionth_in_a_wind_is_named(eel: PreparedFile) -> None:
    eel.assert_named('wind="0.5 -0.3 0.2"', 'wind="0.5 -0.3000006 0.2"', "mujoco/option@wind[1]", 3)


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


@pytest.fixture(scope="module")
def tied(tmp_path_factory: pytest.TempPathFactory) -> PreparedFile:
    return prepare_file(tmp_path_factory.mktemp("tied"), TIED)


def test_joint_follows_others_through_tendons(tied: PreparedFile) -> None:
    """Choose the joint with the largest coefficient that does not follow or lead another yet."""
    tree = tree_of(tied.file)
    names = [link.name for link in tree.links]
    couplings = {
        names[one.follower]: {names[i]: share for i, share in one.leaders} for one in tree.couplings
    }
    assert couplings["extend"] == pytest.approx({"yaw": 0.5 / 1.4, "lift": -1.2 / 1.4, "nod": -0.2})
    assert list(couplings) == ["extend"]
    assert tied.outcome() == (Outcome.AGREES, "")
    assert tied.left_out == ("how MuJoCo compiles the file",)


def test_error_of_a_millionth_in_tied_tendons_differs(tied: PreparedFile) -> None:
    for old, new in (
        ('"0.1 0.7 0 0 0"', '"0.1000001 0.7 0 0 0"'), ('coef="-1.2"', 'coef="-1.200002"'),
    ):  # fmt: skip
        assert tied.outcome_with(old, new) is Outcome.DIFFERS, new


def test_nonlinear_equality_is_left_out_and_reported(tmp_path: Path) -> None:
    text = TIED.replace("0.1 0.7 0 0 0", "0.1 0.7 0.2 0 0")
    prepared = prepare_file(tmp_path, text)
    assert "equality constraints" in prepared.left_out
    assert prepared.outcome() == (Outcome.AGREES, "")
