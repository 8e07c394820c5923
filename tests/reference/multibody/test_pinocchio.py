"""Another library's algorithms on the same trees."""

from __future__ import annotations

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


def theirs(one: Tree) -> pinocchio.Model:
    """The tree as Pinocchio has it: its joint 0 is the world."""
    model = pinocchio.Model()
    model.gravity.linear = one.gravity
    for link in one.links:
        place = pinocchio.SE3(link.rotation, link.position)
        own = model.addJoint(link.parent + 1, joint(link), place, link.name)
        inertia = pinocchio.Inertia(link.mass, link.center, link.inertia)
        model.appendBodyToJoint(own, inertia, pinocchio.SE3.Identity())
    return model


def in_their_order(one: Tree, q: Array, v: Array) -> tuple[Array, Array, list[int]]:
    """Quaternions with the real part last, a free joint's linear velocity first.

    With where each of their velocities stands among ours.
    """
    places, order = [], list[int]()
    for link, here, there in zip(one.links, one.positions, one.velocities, strict=True):
        at, rows = list(range(here.start, here.stop)), list(range(there.start, there.stop))
        if link.kind in ("ball", "free"):
            at = [*at[:-4], *at[-3:], at[-4]]
        if link.kind == "free":
            rows = [*rows[3:], *rows[:3]]
        places += at
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
    one = tree(kinds, seed=11, chain=chain)
    model = theirs(one)
    data = model.createData()
    bare = Dynamics(
        replace(
            one,
            links=tuple(replace(k, armature=0.0, damping=0.0, stiffness=0.0) for k in one.links),
        )
    )
    for seed in range(4):
        q, v = state(one, seed)
        u = np.random.default_rng(seed).normal(size=one.nv)
        there, rate, order = in_their_order(one, q, v)
        mass = bare.recursion.mass(q)[np.ix_(order, order)]
        lower = pinocchio.crba(model, data, there)
        expected = np.triu(lower) + np.triu(lower, 1).T
        assert np.max(np.abs(mass - expected)) < 1e-13 * np.max(np.abs(expected))
        bias = pinocchio.nonLinearEffects(model, data, there, rate)
        found = bare.recursion.bias(q, v)[order]
        assert np.max(np.abs(found - bias)) < 1e-12 * np.max(np.abs(bias))
        accelerations = pinocchio.aba(model, data, there, rate, u[order])
        own = bare.acceleration(q, v, u)[order]
        assert np.max(np.abs(own - accelerations)) < 1e-10 * np.max(np.abs(accelerations))
