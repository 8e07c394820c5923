"""Linearizations of robots about a position that joint forces hold."""

from pathlib import Path

import mujoco
import numpy as np
import pybullet_data
import pytest

from physics_crosscheck.harness.checks.linearizations import run_linearizations
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.records import EngineLinearization
from tests.models import written
from tests.robots.files import ADRIFT

DATA = Path(pybullet_data.getDataPath())
ARM = """<robot name="arm"><link name="base"/>
<link name="boom"><inertial><origin xyz="0.02 0 -0.3"/><mass value="1.3"/>
<inertia ixx="0.02" iyy="0.018" izz="0.006" ixy="0.001" ixz="0" iyz="0"/></inertial></link>
<joint name="lift" type="revolute"><parent link="base"/><child link="boom"/><axis xyz="0 1 0"/>
<limit lower="0.2" upper="1.4" effort="9" velocity="9"/><dynamics damping="0.7"/></joint></robot>
"""


def linearize(file: Path, engine: str = "mujoco", *, floating: bool = False) -> EngineLinearization:
    prepared = prepare_tree(file, motion=0.1, states=4, floating=floating)
    (result,) = run_linearizations(model_task(prepared, engine))
    return result


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_linearization_of_an_arm_matches_its_formula(tmp_path: Path, engine: str) -> None:
    """J a + c v + m g (sin, cos) . center = u about 0.8 rad, by hand."""
    if engines()[engine].version() is None:
        pytest.skip(f"{engine} is not installed")
    file = written(tmp_path, "arm.urdf", ARM)
    result = linearize(file, engine)
    inertia = 0.018 + 1.3 * (0.3**2 + 0.02**2)
    # The height of the center is -0.02 sin q - 0.3 cos q.
    stiffness = 1.3 * 9.81 * (0.02 * np.sin(0.8) + 0.3 * np.cos(0.8))
    by_hand = np.array([[0, 1], [-stiffness / inertia, -0.7 / inertia]])
    np.testing.assert_allclose(np.array(result.a, dtype=float), by_hand, atol=1e-7)
    np.testing.assert_allclose(np.array(result.b, dtype=float)[1], 1 / inertia, rtol=1e-8)
    assert not result.differs


@pytest.mark.slow
def test_step_of_a_floating_robot_matches_mujoco_differences(tmp_path: Path) -> None:
    file = written(tmp_path, "adrift.urdf", ADRIFT)
    result = linearize(file, floating=True)
    assert (result.a_error or 1) < 1e-9
    assert (result.b_error or 1) < 1e-9
    assert not result.differs
    assert result.one_step is not None
    assert (result.one_step.error or 1) < 1e-11


def test_step_of_a_cartpole_matches_mujoco_transition() -> None:
    file = DATA / "cartpole.urdf"
    result = linearize(file)
    model = mujoco.MjModel.from_xml_path(str(file))
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data = mujoco.MjData(model)
    expected = np.zeros((4, 4))
    mujoco.mjd_transitionFD(model, data, 1e-6, True, expected, None, None, None)
    assert result.one_step is not None
    np.testing.assert_allclose(np.array(result.one_step.a, dtype=float), expected, atol=1e-8)


def test_changed_damping_differs(tmp_path: Path) -> None:
    file, copy = tmp_path / "arm.urdf", tmp_path / "copy.urdf"
    file.write_text(ARM)
    copy.write_text(ARM.replace('damping="0.7"', 'damping="0.70001"'))
    prepared = prepare_tree(file, motion=0.1, states=4)
    (result,) = run_linearizations(model_task(prepared, "mujoco").with_file(copy))
    assert result.differs
    assert (result.a_error or 0.0) > 1e-7
