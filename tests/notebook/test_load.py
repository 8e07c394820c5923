"""`load`: a robot's numbers and matrices; causes, advice and page of a check."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck import MotionError, load

PENDULUM = """<robot name="pendulum">
  <link name="base"/>
  <link name="rod"><inertial><origin xyz="0 0 -0.5"/><mass value="2"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="hinge" type="revolute"><parent link="base"/><child link="rod"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="2" effort="50" velocity="1"/></joint>
</robot>
"""


@pytest.fixture
def pendulum(tmp_path: Path) -> Path:
    file = tmp_path / "pendulum.urdf"
    file.write_text(PENDULUM)
    return file


def test_a_robot_has_joints_masses_and_total_inertia(pendulum: Path) -> None:
    robot = load(pendulum)
    (joint,) = robot.joints
    assert (joint.name, joint.kind, joint.link, joint.limits) == ("hinge", "hinge", "rod", (-1, 2))
    assert robot.masses == {"base": 0.0, "rod": 2.0}
    assert robot.mass == 2.0
    np.testing.assert_allclose(robot.inertia.center, [0, 0, -0.5])
    np.testing.assert_allclose(np.diag(robot.inertia.inertia), [0.1, 0.1, 0.01])
    np.testing.assert_allclose(robot.gravity, [0, 0, -9.81])
    assert "1 joint, 2 links, 2 kg" in repr(robot)
    assert "<td" in robot._repr_html_()


def test_its_matrices_are_those_of_a_pendulum(pendulum: Path) -> None:
    robot = load(pendulum)
    np.testing.assert_allclose(robot.mass_matrix(), [[0.1 + 2 * 0.5**2]])
    for q in ({"hinge": 0.7}, [0.7]):
        held = robot.gravity_forces(q)
        np.testing.assert_allclose(held, [2 * 9.81 * 0.5 * np.sin(0.7)], rtol=1e-12)


def test_positions_of_other_names_or_sizes_are_refused(pendulum: Path) -> None:
    robot = load(pendulum)
    with pytest.raises(MotionError, match="no coordinate 'elbow'; there are hinge"):
        robot.mass_matrix({"elbow": 1.0})
    with pytest.raises(MotionError, match="1 positions expected"):
        robot.mass_matrix([0.1, 0.2])


def test_a_folder_of_energies_has_no_bodies() -> None:
    with pytest.raises(MotionError, match="declares energies, not bodies"):
        load("simple_pendulum")
