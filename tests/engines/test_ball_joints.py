"""PyBullet's spherical joints of a URDF: a chain of them follows its equations."""

from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.engine import Array, LoadedModel, ModelSpec, StateForce
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.readers import read_robot
from physics_crosscheck.harness.modelfiles.robot_system import robot_system
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations


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
H = 1e-7


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("balls") / "balls.urdf"
    file.write_text(URDF)
    return file


@pytest.fixture
def model(path: Path) -> LoadedModel:
    pytest.importorskip("pybullet")
    return engines()["pybullet"].load(ModelSpec(path, settings=SETTINGS))


def states(count: int) -> tuple[Array, Array, Array]:
    rng = np.random.default_rng(1)
    q, v, f = rng.uniform(-1, 1, (3, count, 7))
    return q, v, f


def test_accelerations_match_the_equations(path: Path, model: LoadedModel) -> None:
    equations = TreeEquations(robot_system(read_robot(path)))
    names = [c.name for c in equations.system.coordinates]
    order = [names.index(name) for name in model.coordinates]
    assert sorted(model.coordinates) == sorted(names)
    q, v, f = states(4)
    inverse = np.argsort(order)
    expected = equations.pushed_acceleration(q[:, inverse], v[:, inverse], f[:, inverse])[:, order]
    actual = (model.rollout(q, v, H, 1, f[:, None], 1)[1][:, 0] - v) / H
    assert actual == pytest.approx(expected, abs=1e-5 * np.max(np.abs(expected)))


def test_positions_follow_rates_and_forces_by_state_are_equal(
    model: LoadedModel,
) -> None:
    q, v, f = states(3)
    moved, after = model.rollout(q, v, 1e-6, 1, f[:, None], 1)
    assert (moved[:, 0] - q) / 1e-6 == pytest.approx(after[:, 0], abs=1e-4)
    by_state = StateForce(f[:, None], lambda z, u: list(u))
    assert model.rollout(q, v, 1e-6, 1, by_state, 1)[1] == pytest.approx(after)


def test_motors_are_off_by_default(path: Path) -> None:
    """Compare with PyBullet's default: a motor that holds the joint with its full force."""
    pytest.importorskip("pybullet")
    q, v, _ = states(1)
    change = {}
    for on in (False, True):
        model = engines()["pybullet"].load(ModelSpec(path, settings={**SETTINGS, "motors": on}))
        change[on] = np.abs(model.rollout(q, v, 1e-4, 1, None, 1)[1][0, 0, :3] - v[0, :3])
    assert np.all(change[False] < 0.02)
    assert np.all(change[True] > 10)


def test_links_are_placed_by_their_rotations(model: LoadedModel) -> None:
    turned = np.zeros((1, 7))
    turned[0, 2] = 4 * np.tan(np.pi / 8)  # a quarter turn of q about the joint's z
    still, moved = (model.poses(["link:a"], z)[1][0, 0] for z in (np.zeros((1, 7)), turned))
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    assert still.T @ moved == pytest.approx(quarter, abs=1e-6)
