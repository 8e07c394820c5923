"""Free and ball joints in every engine: starts, steps, forces and poses."""

from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.engine import Array, LoadedModel, ModelSpec, StateForce
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.readers import read_robot, robot_system
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.rotations import from_quaternion, unit_quaternion
from tests.engines.test_readings import BELOW
from tests.models import written

MJCF = """<mujoco><option gravity="0 0 0" timestep="0.001"/><worldbody>
<body name="top" pos="1 2 3" euler="0 0 90"><joint name="top" type="free"/>
<inertial pos="0 0 0" mass="2" diaginertia="0.1 0.2 0.3"/>
<body><joint name="neck" type="ball"/><inertial pos="0 0 0" mass="1" diaginertia="0.4 0.4 0.4"/>
</body></body></worldbody></mujoco>"""
H = 1e-6


TUMBLING = (
    '<robot name="r"><link name="g"><inertial><origin xyz="0.1 0.2 0"/><mass value="2"/>'
    '<inertia ixx="1" iyy="2" izz="1.5" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    f'<link name="a">{BELOW}</link><joint name="j" type="continuous"><parent link="g"/>'
    '<child link="a"/><axis xyz="0 1 0"/></joint></robot>'
)
"""A URDF with a hinge and a root whose centre of mass is off its origin."""


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> LoadedModel:
    file = written(tmp_path_factory.mktemp("free"), "top.xml", MJCF)
    return engines()["mujoco"].load(ModelSpec(file))


def test_coordinates_match_the_degrees_of_freedom(model: LoadedModel) -> None:
    place, turn = ("top:x", "top:y", "top:z"), ("top:rx", "top:ry", "top:rz")
    assert model.coordinates == (*place, *turn, "neck:rx", "neck:ry", "neck:rz")
    # A quarter turn about z has the coordinate 4 tan(90/4 degrees).
    assert model.home[:3] == pytest.approx([1, 2, 3])
    assert model.home[3:6] == pytest.approx([0, 0, 4 * np.tan(np.pi / 8)])
    assert model.sampling_range.shape == model.limits.shape == (9, 2)
    assert np.isinf(model.limits).all()


def test_coordinates_continue_beyond_half_a_turn(model: LoadedModel) -> None:
    """Spin about z from 170 degrees beyond 180: the sign of a quaternion has no effect."""
    q, v = np.zeros((1, 9)), np.zeros((1, 9))
    q[0, 5] = 4 * np.tan(np.radians(170) / 4)
    rate = (1 + (q[0, 5] / 4) ** 2) * 10.0  # 10 rad/s
    v[0, 5] = rate
    positions, _ = model.rollout(q, v, 1e-3, 40, None, 1)
    angles = 4 * np.arctan(positions[0, :, 5] / 4)
    assert np.diff(angles) == pytest.approx(0.01, rel=1e-6)
    assert angles[-1] == pytest.approx(np.radians(170) + 0.4, rel=1e-6)


def test_forces_are_in_world_axes_and_moments_in_body_axes(model: LoadedModel) -> None:
    """After a quarter turn about z, a moment about body x acts about world y."""
    q, push = model.home[None], np.zeros((1, 1, 9))
    push[0, 0, 0], push[0, 0, 3] = 6.0, 0.05
    held = model.rollout(q, np.zeros((1, 9)), H, 1, push, 1)[1][0, 0] / H
    assert held[:3] == pytest.approx([6.0 / 3, 0, 0])
    by_state = StateForce(push, lambda z, u: list(u))
    again = model.rollout(q, np.zeros((1, 9)), H, 1, by_state, 1)[1][0, 0] / H
    assert again == pytest.approx(held)
    # dp/dt of an angular velocity (w, 0, 0) is (1 - s^2) w along x and 2 s w along y.
    s = np.tan(np.pi / 8)
    w = 0.05 / 0.1
    assert held[3:6] == pytest.approx([(1 - s * s) * w, 2 * s * w, 0])


@pytest.mark.parametrize("name", ["mujoco", "pybullet"])
def test_links_of_a_floating_urdf_match_their_coordinates(name: str, tmp_path: Path) -> None:
    path = written(tmp_path, "r.urdf", TUMBLING)
    settings = {"step": 1e-3, "gravity": [0.0, 0.0, 0.0], "floating": True}
    model = engines()[name].load(ModelSpec(path, settings=settings))
    z = np.array([[0.1, 0.2, 0.3, 0.5, -0.3, 0.2, 0.4]])
    origins, turns = model.poses(["link:g", "centre:a"], z)
    root, hinge = (
        from_quaternion(q)
        for q in (unit_quaternion(z[0, 3:6]), np.array([np.cos(0.2), 0, np.sin(0.2), 0]))
    )
    assert turns[0] == pytest.approx(np.stack([root, root @ hinge]), abs=1e-12)
    pos = z[0, :3]
    assert origins[0] == pytest.approx(np.stack([pos, pos + root @ hinge @ [0, 0, -1]]), abs=1e-12)


def link(name: str, origin: str, moments: str) -> str:
    xx, yy, zz = moments.split()
    return (
        f'<link name="{name}"><inertial><origin {origin}/><mass value="1.3"/><inertia ixx="{xx}"'
        f' iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def joint(name: str, kind: str, ends: tuple[str, str], inner: str) -> str:
    parent, child = ends
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f"{inner}</joint>"
    )


# Inertia about rotated axes, limits near the initial position, and a damper.
URDF = "".join([
    '<robot name="r"><link name="g"/>',
    link("a", 'xyz="0.1 0.2 0.3" rpy="0.7 0.2 -0.4"', "0.1 0.2 0.25"),
    link("b", 'xyz="0 0.2 -0.5" rpy="0.1 1.2 0"', "0.03 0.02 0.04"),
    link("c", 'xyz="0.3 0.2 0"', "0.03 0.02 0.04"),
    joint("q", "spherical", ("g", "a"), '<origin xyz="1 0 0" rpy="0.3 0 1.2"/>'
          '<dynamics damping="0.4"/><limit lower="-0.2" upper="0.3" twist="0.1" effort="9"/>'),
    joint("h", "continuous", ("a", "b"), '<origin xyz="0 0.1 0.3"/><axis xyz="0 1 0"/>'),
    joint("k", "spherical", ("b", "c"), '<origin xyz="0 0.1 -0.8" rpy="0 0.5 0"/>'),
    "</robot>",
])  # fmt: skip
SETTINGS = {"step": 0.002, "gravity": [0.0, 0.0, -9.81], "smooth": True}
STEP = 1e-7


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("balls") / "balls.urdf"
    file.write_text(URDF)
    return file


@pytest.fixture
def ball_model(path: Path) -> LoadedModel:
    pytest.importorskip("pybullet")
    return engines()["pybullet"].load(ModelSpec(path, settings=SETTINGS))


def states(count: int) -> tuple[Array, Array, Array]:
    rng = np.random.default_rng(1)
    q, v, f = rng.uniform(-1, 1, (3, count, 7))
    return q, v, f


def test_accelerations_match_the_equations(path: Path, ball_model: LoadedModel) -> None:
    equations = TreeEquations(robot_system(read_robot(path)))
    names = [c.name for c in equations.system.coordinates]
    order = [names.index(name) for name in ball_model.coordinates]
    assert sorted(ball_model.coordinates) == sorted(names)
    q, v, f = states(4)
    inverse = np.argsort(order)
    expected = equations.pushed_acceleration(q[:, inverse], v[:, inverse], f[:, inverse])[:, order]
    actual = (ball_model.rollout(q, v, STEP, 1, f[:, None], 1)[1][:, 0] - v) / STEP
    assert actual == pytest.approx(expected, abs=1e-5 * np.max(np.abs(expected)))


def test_positions_follow_rates_and_forces_by_state_are_equal(ball_model: LoadedModel) -> None:
    q, v, f = states(3)
    moved, after = ball_model.rollout(q, v, 1e-6, 1, f[:, None], 1)
    assert (moved[:, 0] - q) / 1e-6 == pytest.approx(after[:, 0], abs=1e-4)
    by_state = StateForce(f[:, None], lambda z, u: list(u))
    assert ball_model.rollout(q, v, 1e-6, 1, by_state, 1)[1] == pytest.approx(after)


def test_motors_are_off_by_default(path: Path) -> None:
    """Compare with PyBullet's default: a motor that holds the joint with its full force."""
    pytest.importorskip("pybullet")
    q, v, _ = states(1)
    change = {}
    for on in (False, True):
        ball_model = engines()["pybullet"].load(
            ModelSpec(path, settings={**SETTINGS, "motors": on})
        )
        change[on] = np.abs(ball_model.rollout(q, v, 1e-4, 1, None, 1)[1][0, 0, :3] - v[0, :3])
    assert np.all(change[False] < 0.02)
    assert np.all(change[True] > 10)


def test_links_are_placed_by_their_rotations(ball_model: LoadedModel) -> None:
    turned = np.zeros((1, 7))
    turned[0, 2] = 4 * np.tan(np.pi / 8)  # a quarter turn of q about the joint's z
    still, moved = (ball_model.poses(["link:a"], z)[1][0, 0] for z in (np.zeros((1, 7)), turned))
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    assert still.T @ moved == pytest.approx(quarter, abs=1e-6)
