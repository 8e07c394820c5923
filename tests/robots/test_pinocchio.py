"""Public robots, read here and by Pinocchio: the equations agree to rounding."""

import re
from dataclasses import replace
from pathlib import Path

import gymnasium
import numpy as np
import pinocchio
import pytest

from physics_crosscheck.harness.modelfiles.mjcf.read import read_compiled_robot
from physics_crosscheck.harness.modelfiles.robot import Robot
from physics_crosscheck.harness.modelfiles.urdf.read import read_urdf_robot
from physics_crosscheck.reference.dynamics.tree_dynamics import Dynamics
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.tree import Tree

pybullet_data = pytest.importorskip("pybullet_data", reason="comes with PyBullet")
FOLDER = Path(pybullet_data.getDataPath())

ROBOTS = {
    "a1/a1.urdf": 12,
    "cartpole.urdf": 2,
    "differential/diff_ring.urdf": 5,
    "franka_panda/panda.urdf": 9,
    "kuka_iiwa/model.urdf": 7,
    "laikago/laikago.urdf": 12,
    "quadruped/minitaur.urdf": 16,
    "r2d2.urdf": 8,
    "racecar/racecar.urdf": 6,
    "xarm/xarm6_with_gripper.urdf": 12,
}
QUICK = {"a1/a1.urdf", "cartpole.urdf", "kuka_iiwa/model.urdf", "r2d2.urdf", "racecar/racecar.urdf"}

CLOSE = 1e-12


def tree_of(robot: Robot) -> Tree:
    assert robot.obstacles == ()
    assert robot.tree is not None
    return robot.tree


def pinocchio_state(
    model: pinocchio.Model, tree: Tree, q: Array, v: Array
) -> tuple[Array, Array, list[int]]:
    """Return positions, velocities and the indices of our velocities in Pinocchio's order.

    Pinocchio stores the cosine and sine of a continuous joint. Its free joint has the real part
    last, and the linear velocity first.
    """
    positions, order = np.zeros(model.nq), list[int]()
    for link, here in zip(tree.links, tree.positions, strict=True):
        name = "root_joint" if link.kind == "free" else link.name
        joint, position = model.joints[model.getJointId(name)], q[here]
        if link.kind == "free":
            position = np.concatenate([position[:3], position[4:], position[3:4]])
        elif joint.nq == 2:
            position = np.concatenate([np.cos(position), np.sin(position)])
        positions[joint.idx_q : joint.idx_q + joint.nq] = position
        rows = list(range(joint.idx_v, joint.idx_v + joint.nv))
        order += [*rows[3:], *rows[:3]] if link.kind == "free" else rows
    velocity = np.zeros(model.nv)
    velocity[order] = v
    return positions, velocity, order


def differences(model: pinocchio.Model, tree: Tree) -> Array:
    """Return the largest relative errors of mass matrix, nonlinear effects and accelerations.

    Nonlinear effects are relative to the terms of velocities and weights before they cancel.
    """
    model.gravity.linear = tree.gravity
    data, ours, random = model.createData(), Dynamics(tree), np.random.default_rng(5)
    weight = 9.81 * sum(link.mass for link in tree.links) / 10
    errors = []
    for _ in range(5):
        q, v, u = (random.normal(size=n) for n in (tree.nq, tree.nv, tree.nv))
        for link, here in zip(tree.links, tree.positions, strict=True):
            if link.kind == "free":
                q[here.start + 3 : here.stop] /= np.linalg.norm(q[here.start + 3 : here.stop])
        positions, velocity, order = pinocchio_state(model, tree, q, v)
        upper = np.triu(pinocchio.crba(model, data, positions))
        mass = (upper + np.triu(upper, 1).T)[np.ix_(order, order)]
        effects = pinocchio.nonLinearEffects(model, data, positions, velocity)[order]
        force = np.zeros(model.nv)
        damping = [np.repeat(link.damping, there.stop - there.start)
                for link, there in zip(tree.links, tree.velocities, strict=True)]  # fmt: skip
        force[order] = u - np.concatenate(damping) * v - ours.springs(q)
        acceleration = pinocchio.aba(model, data, positions, velocity, force)[order]
        size = max(np.abs(effects).max(), np.abs(mass).max() * (v @ v), weight)
        errors.append([
            np.abs(ours.recursion.mass(q) - mass).max() / np.abs(mass).max(),
            np.abs(ours.recursion.bias(q, v) - effects).max() / size,
            np.abs(ours.acceleration(q, v, u) - acceleration).max() / np.abs(acceleration).max(),
        ])  # fmt: skip
    worst: Array = np.max(errors, axis=0)
    return worst


@pytest.mark.parametrize(
    ("name", "dof"),
    [pytest.param(*one, marks=() if one[0] in QUICK else pytest.mark.slow)
     for one in ROBOTS.items()],
)  # fmt: skip
def test_equations_of_a_public_robot_match_pinocchio(name: str, dof: int) -> None:
    tree = tree_of(read_urdf_robot(FOLDER / name))
    model = pinocchio.buildModelFromUrdf(str(FOLDER / name))
    assert tree.nv == model.nv == dof
    assert {link.name for link in tree.links} == set(model.names) - {"universe"}
    assert differences(model, tree).max() < CLOSE


def test_commas_are_read_as_blanks(tmp_path: Path) -> None:
    file = FOLDER / "bicycle/bike.urdf"
    tree = tree_of(read_urdf_robot(file))
    path = tmp_path / "blanks.urdf"
    path.write_text(re.sub(r"(?<=\d), ", " ", file.read_text()))
    assert differences(pinocchio.buildModelFromUrdf(str(path)), tree).max() < CLOSE


@pytest.mark.parametrize(
    "name", ["laikago/laikago.urdf", "mini_cheetah/mini_cheetah.urdf", "quadruped/minitaur.urdf"]
)
def test_equations_of_a_floating_robot_match_pinocchio(name: str) -> None:
    tree = tree_of(read_urdf_robot(FOLDER / name, floating=True))
    model = pinocchio.buildModelFromUrdf(str(FOLDER / name), pinocchio.JointModelFreeFlyer())
    assert tree.nv == model.nv
    assert tree.links[0].kind == "free"
    assert differences(model, tree).max() < CLOSE


ASSETS = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"
COMPILED = sorted(path.name for path in ASSETS.glob("*.xml"))


def rebuild(tree: Tree) -> pinocchio.Model:
    """Build the same bodies and joints with Pinocchio."""
    model = pinocchio.Model()
    kinds = {
        "hinge": pinocchio.JointModelRevoluteUnaligned,
        "slide": pinocchio.JointModelPrismaticUnaligned,
        "ball": lambda _: pinocchio.JointModelSpherical(),
        "free": lambda _: pinocchio.JointModelFreeFlyer(),
    }
    numbers: list[int] = []
    for link in tree.links:
        parent = 0 if link.parent < 0 else numbers[link.parent]
        placed = pinocchio.SE3(np.array(link.rotation), np.array(link.position))
        name = "root_joint" if link.kind == "free" else link.name
        numbers.append(model.addJoint(parent, kinds[link.kind](link.axis), placed, name))
        body = pinocchio.Inertia(link.mass, np.array(link.center), np.array(link.inertia))
        model.appendBodyToJoint(numbers[-1], body, pinocchio.SE3.Identity())
    return model


@pytest.mark.parametrize("name", COMPILED)
def test_equations_of_a_compiled_robot_match_pinocchio(name: str) -> None:
    tree = tree_of(read_compiled_robot(ASSETS / name))
    plain = replace(
        tree,
        links=tuple(replace(link, armature=0.0) for link in tree.links),
        pulls=(),
        couplings=(),
        fluid=None,
    )
    assert differences(rebuild(plain), plain).max() < CLOSE
