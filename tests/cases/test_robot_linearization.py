"""A robot's linearization: poles about a position that forces on its joints hold."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pybullet_data
import pytest

from physics_crosscheck.harness.checks.linearizations import run_linearizations
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.records.model import EngineLinearization
from tests.robots.files import ADRIFT

DATA = Path(pybullet_data.getDataPath())
ARM = """<robot name="arm"><link name="base"/>
<link name="boom"><inertial><origin xyz="0.02 0 -0.3"/><mass value="1.3"/>
<inertia ixx="0.02" iyy="0.018" izz="0.006" ixy="0.001" ixz="0" iyz="0"/></inertial></link>
<joint name="lift" type="revolute"><parent link="base"/><child link="boom"/><axis xyz="0 1 0"/>
<limit lower="0.2" upper="1.4" effort="9" velocity="9"/><dynamics damping="0.7"/></joint></robot>
"""


def linearized(
    file: Path, engine: str = "mujoco", *, floating: bool = False
) -> EngineLinearization:
    prepared = prepare_tree(file, motion=0.1, states=4, floating=floating)
    (found,) = run_linearizations(model_task(prepared, engine))
    return found


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_poles_of_an_arm_are_those_of_its_formula(tmp_path: Path, engine: str) -> None:
    """J a + c v + m g (sin, cos) . center = u about 0.8 rad, by hand."""
    if engines()[engine].version() is None:
        pytest.skip(f"{engine} is not installed")
    file = tmp_path / "arm.urdf"
    file.write_text(ARM)
    found = linearized(file, engine)
    inertia = 0.018 + 1.3 * (0.3**2 + 0.02**2)
    # The height of the center is -0.02 sin q - 0.3 cos q.
    stiffness = 1.3 * 9.81 * (0.02 * np.sin(0.8) + 0.3 * np.cos(0.8))
    by_hand = np.array([[0, 1], [-stiffness / inertia, -0.7 / inertia]])
    np.testing.assert_allclose(np.array(found.a, dtype=float), by_hand, atol=1e-7)
    np.testing.assert_allclose(np.array(found.b, dtype=float)[1], 1 / inertia, rtol=1e-8)
    assert not found.differs


@pytest.mark.slow
def test_a_step_of_a_floating_robot_is_that_of_mujoco_s_own_differences(tmp_path: Path) -> None:
    file = tmp_path / "adrift.urdf"
    file.write_text(ADRIFT)
    found = linearized(file, floating=True)
    assert (found.a_error or 1) < 1e-9
    assert (found.b_error or 1) < 1e-9
    assert not found.differs
    assert found.one_step is not None
    assert (found.one_step.error or 1) < 1e-11


def test_a_cartpole_s_step_is_mujoco_s_own_transition() -> None:
    file = DATA / "cartpole.urdf"
    found = linearized(file)
    model = mujoco.MjModel.from_xml_path(str(file))
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data = mujoco.MjData(model)
    theirs = np.zeros((4, 4))
    mujoco.mjd_transitionFD(model, data, 1e-6, True, theirs, None, None, None)
    assert found.one_step is not None
    np.testing.assert_allclose(np.array(found.one_step.a, dtype=float), theirs, atol=1e-8)


def test_another_damping_of_the_file_differs(tmp_path: Path) -> None:
    file, copy = tmp_path / "arm.urdf", tmp_path / "copy.urdf"
    file.write_text(ARM)
    copy.write_text(ARM.replace('damping="0.7"', 'damping="0.70001"'))
    prepared = prepare_tree(file, motion=0.1, states=4)
    (found,) = run_linearizations(model_task(prepared, "mujoco").with_file(copy))
    assert found.differs
    assert (found.a_error or 0.0) > 1e-7
