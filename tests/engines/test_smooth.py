"""Smooth models without contacts and limits, and extensions that sidecars declare."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from physics_crosscheck.engine import EngineError, LoadedModel, ModelSpec, Spring
from physics_crosscheck.harness.engines.registry import engines
from tests.engines.protocol_models import GROUND, PAIRINGS, Pairing, joint, link, urdf_settings
from tests.models import written

URDF = """<robot name="r">
  <link name="base">
    <visual><geometry><mesh filename="package://nowhere/base.stl"/></geometry></visual>
    <collision><geometry><box size="2 2 2"/></geometry></collision>
  </link>
  <link name="bob">
    <inertial><origin xyz="0 0 -0.5"/><mass value="1"/>
      <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 -0.5"/><geometry><sphere radius="0.2"/></geometry></collision>
  </link>
  <link name="tip">
    <inertial><mass value="1"/>
      <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><sphere radius="0.2"/></geometry></collision>
  </link>
  <joint name="swing" type="revolute">
    <parent link="base"/><child link="bob"/><axis xyz="0 1 0"/>
    <limit lower="-0.1" upper="0.1" effort="1" velocity="1"/>
  </joint>
  <joint name="lock" type="fixed"><parent link="bob"/><child link="tip"/></joint>
</robot>
"""
MJCF = """<mujoco>
  <option gravity="0 0 -9.81" timestep="0.001"/>
  <worldbody>
    <geom type="box" size="1 1 1"/>
    <body><joint name="swing" axis="0 1 0" limited="true" range="-0.1 0.1" frictionloss="3"/>
      <inertial pos="0 0 -0.25" mass="2" diaginertia="0.145 0.145 0.02"/>
      <geom type="sphere" size="0.2" pos="0 0 -0.5"/></body>
  </worldbody>
  <actuator><position joint="swing" kp="100" forcerange="-1 1"/></actuator>
</mujoco>
"""
ACCELERATION = -2 * 9.81 * 0.25 * np.sin(0.8) / (0.145 + 2 * 0.25**2)
"""The pendulum at 0.8 rad: two bodies of 1 kg, at 0.5 m and at the pivot."""

SERVO = -100 * 0.8 / (0.145 + 2 * 0.25**2)
"""The acceleration by the servo without its force limit."""


def loaded(engine: str, tmp_path: Path, **settings: object) -> LoadedModel:
    mjcf = engine == "mujoco mjcf"
    file = written(tmp_path, ("r.xml" if mjcf else "r.urdf"), MJCF if mjcf else URDF)
    given = settings if mjcf else {"step": 0.001, "gravity": [0.0, 0.0, -9.81], **settings}
    return engines()[engine.split()[0]].load(ModelSpec(path=file, settings=given, springs=()))


@pytest.mark.parametrize("engine", ["mujoco mjcf", "mujoco", "pybullet"])
def test_smooth_pendulum_ignores_limits_and_contacts(engine: str, tmp_path: Path) -> None:
    model = loaded(engine, tmp_path, smooth=True)
    h = 1e-7
    _, v = model.rollout(np.array([[0.8]]), np.zeros((1, 1)), h, 1, None, 1)
    servo = SERVO if engine == "mujoco mjcf" else 0.0
    assert v[0, 0, 0] / h == pytest.approx(ACCELERATION + servo, rel=1e-6)


def test_without_smooth_meshes_are_required(tmp_path: Path) -> None:
    with pytest.raises(EngineError, match=r"r\.urdf"):
        loaded("pybullet", tmp_path)


def test_without_smooth_a_limit_acts(tmp_path: Path) -> None:
    model = loaded("mujoco", tmp_path)
    _, v = model.rollout(np.array([[0.8]]), np.zeros((1, 1)), 1e-3, 1, None, 1)
    assert abs(v[0, 0, 0] / 1e-3 - ACCELERATION) > 1


def test_inertias_from_shapes_use_shapes_without_contacts(tmp_path: Path) -> None:
    model = loaded("pybullet", tmp_path, smooth=True, inertia_from_file=False)
    _, w = model.rollout(np.array([[0.8]]), np.zeros((1, 1)), 1e-3, 1, None, 1)
    inertia = 2 * 0.4 * 0.2**2 + 0.5**2  # two balls of 0.2 m, one at the pivot
    assert w[0, 0, 0] / 1e-3 == pytest.approx(-9.81 * 0.5 * np.sin(0.8) / inertia, rel=1e-9)


def test_file_is_not_changed(tmp_path: Path) -> None:
    loaded("pybullet", tmp_path, smooth=True)
    assert (tmp_path / "r.urdf").read_text() == URDF
    assert [path.name for path in tmp_path.iterdir()] == ["r.urdf"]


@pytest.mark.parametrize("engine", ["mujoco mjcf", "mujoco", "pybullet"])
def test_smooth_is_true_or_false(engine: str, tmp_path: Path) -> None:
    with pytest.raises(EngineError, match=r"\[settings\] smooth is 1.0; expected true or false"):
        loaded(engine, tmp_path, smooth=1.0)


BALL = """<robot name="ball"><link name="world"/><link name="guide"><inertial><mass value="0"/>
<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>
<joint name="x" type="prismatic"><parent link="world"/><child link="guide"/><axis xyz="1 0 0"/>
<limit lower="-50" upper="50" effort="0" velocity="9"/></joint>
<joint name="z" type="prismatic"><parent link="guide"/><child link="ball"/><axis xyz="0 0 1"/>
<origin xyz="0 0 0.1"/><limit lower="-50" upper="50" effort="0" velocity="9"/></joint>
<link name="ball"><contact><lateral_friction value="0.3"/></contact>
<inertial><mass value="2"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
<collision><geometry><sphere radius="0.1"/></geometry></collision></link></robot>"""


def test_floor_applies_friction_without_memory_of_contacts(tmp_path: Path) -> None:
    file = written(tmp_path, "ball.urdf", BALL)
    settings = {"step": 0.001, "gravity": [0.0, 0.0, -10.0], "floor": True}
    model = engines()["pybullet"].load(ModelSpec(path=file, settings=settings, springs=()))
    # PyBullet leaves a contact 1e-5 m deep as it is; the third state is that of the first again.
    z = np.array([[0.0, -1e-5], [0.0, 0.5], [0.0, -1e-5]])
    w = np.array([[2.0, 0.0], [2.0, 0.0], [2.0, 0.0]])
    _, after = model.rollout(z, w, 1e-3, 1, None, 1)
    np.testing.assert_allclose(after[:, 0, 0], [1.997, 2.0, 1.997], rtol=1e-14)
    np.testing.assert_allclose(after[:, 0, 1], [0.0, -0.01, 0.0], atol=1e-14)


ON_URDF = [p for p in PAIRINGS if p.format == "urdf"]


def load(
    pairing: Pairing,
    tmp_path: Path,
    parts: Sequence[str],
    springs: tuple[Spring, ...] = (),
    **settings: object,
) -> LoadedModel:
    pytest.importorskip(pairing.engine)
    path = tmp_path / "model.urdf"
    path.write_text(f'<robot name="r">{GROUND}{"".join(parts)}</robot>')
    spec = ModelSpec(path, springs, urdf_settings(pairing) | settings)
    return engines()[pairing.engine].load(spec)


@pytest.mark.parametrize("pairing", [p for p in ON_URDF if p.integrator != "RK4"], ids=str)
def test_mimic_joint_follows_its_leader_and_brings_its_inertia(
    pairing: Pairing, tmp_path: Path
) -> None:
    mimic = '<mimic joint="q1" multiplier="3"/>'
    parts = [
        link("a", 2.0),
        joint("q1", "prismatic", "a"),
        link("b", 0.5),
        joint("q2", "prismatic", "b", extra=mimic),
        '<gazebo reference="q1"><springStiffness>30</springStiffness></gazebo>',
    ]
    hard: Any = {"solref": [1e-6, 0.5], "solimp": [0.9999, 0.9999, 0.001, 0.5, 2]}
    model = load(pairing, tmp_path, parts, **(hard if pairing.engine == "mujoco" else {}))
    h, n = 1e-4, 4000
    zs, ws = model.rollout(np.array([[0.2, 0.6]]), np.zeros((1, 2)), h, n, None, 100)
    assert zs[0, :, 1] == pytest.approx(3 * zs[0, :, 0], abs=2e-5)
    assert ws[0, :, 1] == pytest.approx(3 * ws[0, :, 0], abs=2e-4)
    # Both move like one mass of 2 + 3^2 * 0.5 on the spring.
    rate = np.sqrt(30 / (2.0 + 9 * 0.5))
    t = h * 100 * np.arange(1, 41)
    assert zs[0, :, 0] == pytest.approx(0.2 * np.cos(rate * t), abs=2e-4)


def test_gears_of_a_chain_converge_in_pybullet(tmp_path: Path) -> None:
    """Catch iterations that leave 1e-6 of the speeds of six followers."""
    p = pytest.importorskip("pybullet")
    inertia = '<inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/>'
    inner = f'<inertial><origin xyz="0.01 0 0.02"/><mass value="0.1"/>{inertia}</inertial>'
    parts = [f'<link name="{name}">{inner}</link>' for name in ("base", "lead", *"abcdef")]
    for parent, name in zip(("base", "base", *"abcde"), ("lead", *"abcdef"), strict=True):
        mimic = "" if name == "lead" else '<mimic joint="lead"/>'
        ends = f'<parent link="{parent}"/><child link="{name}"/><origin xyz="0 0 0.03"/>'
        parts.append(
            f'<joint name="{name}" type="continuous">{ends}<axis xyz="0 1 0"/>{mimic}</joint>'
        )
    file = written(tmp_path, "chain.urdf", f'<robot name="r">{"".join(parts)}</robot>')
    settings = {"smooth": True, "step": 0.002, "gravity": [0.0, 0.0, -9.81]}
    model = engines()["pybullet"].load(ModelSpec(path=file, settings=settings, springs=()))
    q, v = np.full((1, 7), 0.3), np.full((1, 7), 0.5)
    _, shipped = model.rollout(q, v, 2e-3, 3, None, 3)
    p.setPhysicsEngineParameter(numSolverIterations=20000, solverResidualThreshold=0.0)
    _, converged = model.rollout(q, v, 2e-3, 3, None, 3)
    assert np.max(np.abs(shipped - converged)) < 1e-9
