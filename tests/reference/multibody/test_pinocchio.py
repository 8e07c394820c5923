"""The algorithms of Pinocchio on the same trees."""

from dataclasses import replace

import numpy as np
import pinocchio
import pytest

from physics_crosscheck.reference.dynamics.tree_dynamics import Dynamics
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.tree import Kind, Tree, TreeLink
from tests.reference.multibody.trees import KINDS, state, tree


def joint(link: TreeLink) -> pinocchio.JointModel:
    match link.kind:
        case "hinge":
            return pinocchio.JointModelRevoluteUnaligned(*link.axis)
        case "slide":
            return pinocchio.JointModelPrismaticUnaligned(*link.axis)
        case "ball":
            return pinocchio.JointModelSpherical()
    return pinocchio.JointModelFreeFlyer()


def theirs(robot: Tree) -> pinocchio.Model:
    """Return the tree as a Pinocchio model, whose joint 0 is the world."""
    model = pinocchio.Model()
    model.gravity.linear = robot.gravity
    for link in robot.links:
        place = pinocchio.SE3(link.rotation, link.position)
        index = model.addJoint(link.parent + 1, joint(link), place, link.name)
        inertia = pinocchio.Inertia(link.mass, link.center, link.inertia)
        model.appendBodyToJoint(index, inertia, pinocchio.SE3.Identity())
    return model


def in_their_order(robot: Tree, q: Array, v: Array) -> tuple[Array, Array, list[int]]:
    """Return q and v in Pinocchio's order, and the indices of its velocities in ours.

    Quaternions have the real part last, free joints the linear velocity first.
    """
    places, order = [], list[int]()
    for link, here, there in zip(robot.links, robot.positions, robot.velocities, strict=True):
        columns, rows = list(range(here.start, here.stop)), list(range(there.start, there.stop))
        if link.kind in ("ball", "free"):
            columns = [*columns[:-4], *columns[-3:], columns[-4]]
        if link.kind == "free":
            rows = [*rows[3:], *rows[:3]]
        places += columns
        order += rows
    return q[places], v[order], order


HINGES = (KINDS[0],) * 24

TREES: list[tuple[tuple[Kind, ...], bool]] = [
    (HINGES[:7], True),
    (("free", *HINGES), False),
    (("slide", "hinge", "ball", "free", "slide", "hinge", "ball"), False),
]


@pytest.mark.parametrize(("kinds", "chain"), TREES)
def test_mass_matrix_bias_and_accelerations_are_the_same(
    kinds: tuple[Kind, ...], chain: bool
) -> None:
    robot = tree(kinds, seed=11, chain=chain)
    model = theirs(robot)
    data = model.createData()
    bare = Dynamics(
        replace(
            robot,
            links=tuple(replace(k, armature=0.0, damping=0.0, stiffness=0.0) for k in robot.links),
        )
    )
    for seed in range(4):
        q, v = state(robot, seed)
        u = np.random.default_rng(seed).normal(size=robot.nv)
        there, rate, order = in_their_order(robot, q, v)
        mass = bare.recursion.mass(q)[np.ix_(order, order)]
        lower = pinocchio.crba(model, data, there)
        expected = np.triu(lower) + np.triu(lower, 1).T
        assert np.max(np.abs(mass - expected)) < 1e-13 * np.max(np.abs(expected))
        bias = pinocchio.nonLinearEffects(model, data, there, rate)
        actual_bias = bare.recursion.bias(q, v)[order]
        assert np.max(np.abs(actual_bias - bias)) < 1e-12 * np.max(np.abs(bias))
        accelerations = pinocchio.aba(model, data, there, rate, u[order])
        actual = bare.acceleration(q, v, u)[order]
        assert np.max(np.abs(actual - accelerations)) < 1e-10 * np.max(np.abs(accelerations))
