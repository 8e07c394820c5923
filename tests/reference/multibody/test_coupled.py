"""Coupled joints and formulas, compared with the whole tree and with the recursion."""

import dataclasses
import re

import numpy as np
import pytest
import sympy as sp

from physics_crosscheck import Coupling, ForceElement, Joint, RigidBody
from physics_crosscheck.reference.dynamics.chart_equations import Charted
from physics_crosscheck.reference.dynamics.formulas import SymbolicEquations, formulas
from physics_crosscheck.reference.dynamics.tree_dynamics import Dynamics
from physics_crosscheck.reference.mechanism.assemble import assembled
from physics_crosscheck.reference.mechanism.chart import MinimalCoordinates
from physics_crosscheck.reference.mechanism.couplings import Coupled
from physics_crosscheck.reference.mechanism.rotations import LONG_DOUBLES
from physics_crosscheck.reference.mechanism.tree import Tree, TreeCoupling, TreeError
from tests.reference.multibody.trees import tree


def gripper() -> Tree:
    """Return a floating base with a chain of two coupled joints and a fixed joint."""
    robot = tree(("free", "hinge", "slide", "hinge", "slide"), 5)
    return dataclasses.replace(
        robot,
        couplings=(
            TreeCoupling(follower=4, leader=3, multiplier=-0.7, offset=0.1),
            TreeCoupling(follower=3, leader=1, multiplier=2.0, offset=-0.3),
            TreeCoupling(follower=2, leader=None, offset=0.25),
        ),
    )


def test_follower_positions_follow_the_leader() -> None:
    coupled = Coupled(gripper())
    assert coupled.kept == [0, 1, 2, 3, 4, 5, 6]
    x = np.arange(7.0)
    y = coupled.positions(x)
    assert y[:7] == pytest.approx(x)
    assert y[7] == pytest.approx(0.25)
    assert y[8] == pytest.approx(2 * 6 - 0.3)
    assert y[9] == pytest.approx(-0.7 * (2 * 6 - 0.3) + 0.1)


def test_accelerations_match_the_constrained_tree() -> None:
    """Solve the equations with multipliers (KKT) directly."""
    held = gripper()
    whole = dataclasses.replace(held, couplings=())
    coupled, chart, dynamics = Coupled(held), MinimalCoordinates(held), Dynamics(whole)
    x, rate, forces = np.random.default_rng(2).normal(size=(3, 7, 4))
    y, rates = coupled.positions(x), coupled.rates(rate)
    given = np.zeros_like(y)
    given[coupled.kept] = forces
    q, v = chart.positions(y), chart.velocities(y, rates)
    rows = np.zeros((3, 10))
    rows[0, [9, 8]], rows[1, [8, 6]], rows[2, 7] = (1.0, 0.7), (1.0, -2.0), 1.0
    mass, force = dynamics.mass(q), dynamics.force(q, v, chart.forces(y, given))
    for k in range(4):
        whole_matrix = np.block([[mass[:, :, k], rows.T], [rows, np.zeros((3, 3))]])
        a = np.linalg.solve(whole_matrix, [*force[:, k], 0, 0, 0])[:10]
        expected = chart.second_derivatives(y[:, k : k + 1], v[:, k : k + 1], a[:, None])[:7, 0]
        actual = Charted(held).acceleration(x[:, k], rate[:, k], forces[:, k])
        assert actual == pytest.approx(expected, rel=1e-10, abs=1e-10)
    batch = Charted(held).acceleration(x, rate, forces)
    assert Charted(held).forces_for(x, rate, batch) == pytest.approx(forces, abs=1e-10)
    long = Charted(held, LONG_DOUBLES).acceleration(*map(LONG_DOUBLES.array, (x, rate, forces)))
    assert batch == pytest.approx(long.astype(float), abs=1e-10)
    unpushed = Charted(held).acceleration(x, rate, 0 * forces)
    assert Charted(held).effect(x, forces) == pytest.approx(batch - unpushed, abs=1e-10)


def test_energy_matches_the_whole_tree() -> None:
    held = gripper()
    x, rate = np.random.default_rng(3).normal(size=(2, 7, 4))
    mass = Charted(held).mass(x)
    kinetic = (rate * (mass * rate).sum(axis=1)).sum(axis=0) / 2
    coupled, chart = Coupled(held), MinimalCoordinates(held)
    y = coupled.positions(x)
    v = chart.velocities(y, coupled.rates(rate))
    assert kinetic == pytest.approx(Dynamics(held).kinetic(chart.positions(y), v))


def test_joint_with_several_leaders() -> None:
    robot = tree(("hinge", "slide", "hinge", "slide"), 5)
    ends = (
        TreeCoupling(follower=1, leader=0, multiplier=2.0, others=((3, -0.5),), offset=0.1),
        TreeCoupling(follower=2, leader=1, multiplier=3.0, others=((0, 1.0),)),
    )
    coupled = Coupled(dataclasses.replace(robot, couplings=ends))
    y = coupled.positions(np.array([0.7, -0.4]))
    followed = 2 * 0.7 + 0.5 * 0.4 + 0.1
    assert y == pytest.approx([0.7, followed, 3 * followed + 0.7, -0.4])


def test_cycle_of_couplings_is_rejected() -> None:
    robot = tree(("hinge", "hinge"), 0)
    ends = (TreeCoupling(follower=0, leader=1), TreeCoupling(follower=1, leader=0))
    with pytest.raises(TreeError, match="j0, j1 follow each other in a cycle"):
        Coupled(dataclasses.replace(robot, couplings=ends))


def test_coupled_ball_joint_is_rejected() -> None:
    robot = tree(("ball", "hinge"), 0)
    with pytest.raises(TreeError, match="j0 is coupled, but neither a hinge"):
        dataclasses.replace(robot, couplings=(TreeCoupling(follower=1, leader=0),))


INERTIA = (0.1, 0.11, 0.05, 0.0, 0.0, 0.0)


def body(i: int, parent: str | None, joint: Joint, **rest: object) -> RigidBody:
    return RigidBody(
        name=f"b{i}", parent=parent, joints=(joint,), mass=1.0 + i / 10, center=(0.02, 0.01, -0.1),
        inertia=INERTIA, **rest,  # type: ignore[arg-type]
    )  # fmt: skip


def chain(count: int, *kinds: str) -> Tree:
    bodies = []
    for i in range(count):
        kind = kinds[i] if i < len(kinds) else "hinge"
        joint = Joint(
            name=f"j{i}", kind=kind, axis=(0, 1, 0), damping=0.1 + i, stiffness=2.0, rest=0.3,  # type: ignore[arg-type]
            armature=0.01,
        )  # fmt: skip
        # A quarter turn with the digits of a file, so that its cosine is not exactly zero.
        rpy = (0.0, 1.57079632679, 0.0) if i == 1 else (0.0, 0.0, 0.0)
        parent = f"b{i - 1}" if i else None
        bodies.append(body(i, parent, joint, position=(0.0, 0.1, -0.2), rpy=rpy))
    return assembled(bodies, (0.0, 0.0, -9.81)).tree


@pytest.mark.parametrize("kinds", [("hinge",), ("slide", "hinge"), ("hinge", "hinge")])
def test_formulas_match_the_recursion(kinds: tuple[str, ...]) -> None:
    tree, n = chain(len(kinds), *kinds), len(kinds)
    q, v = (sp.symbols(f"{letter}:{n}", real=True) for letter in "qv")
    result = formulas(tree, q, v)
    assert isinstance(result, SymbolicEquations)
    dynamics = Dynamics(tree)
    for point in np.random.default_rng(3).uniform(-2, 2, (4, 2, n)):
        values = dict(zip((*q, *v), point.ravel().tolist(), strict=True))
        mass = [[float(x.subs(values)) for x in row] for row in result.mass]
        force = [float(sum(x.subs(values) for x in row)) for row in result.force]
        np.testing.assert_allclose(mass, dynamics.mass(point[0]), rtol=1e-9, atol=1e-9)
        expected = dynamics.force(point[0], point[1], np.zeros(n))
        np.testing.assert_allclose(force, expected, rtol=1e-8, atol=1e-8)


def test_terms_from_rounded_angles_are_dropped() -> None:
    q, v = (sp.symbols(f"{letter}:2", real=True) for letter in "qv")
    result = formulas(chain(2), q, v)
    assert isinstance(result, SymbolicEquations)
    numbers = [abs(float(x)) for row in result.force for term in row for x in term.atoms(sp.Float)]
    assert min(numbers) > 1e-6


@pytest.mark.parametrize(("tree", "message"), [
    (chain(4), "they are too long for 4 joints"),
    (chain(3), r"they have \d+ terms; more than 80 are too long"),
    (assembled(
        [body(0, None, Joint(name="b", kind="ball"))], (0, 0, -9.81)).tree, "'b' is a ball joint"),
    (assembled([body(0, None, Joint(name="b", kind="hinge"))], (0, 0, -9.81),
               [ForceElement(name="p", joints=(("b", 1.0),), bias=(1, 0, 0))]).tree, "for tendons"),
    (assembled([body(0, None, Joint(name="a", kind="hinge")),
                body(1, "b0", Joint(name="b", kind="hinge"))], (0, 0, -9.81),
               couplings=[Coupling(follower="b", leader="a")]).tree, "joint couplings"),
])  # fmt: skip
def test_missing_formulas_have_a_reason(tree: Tree, message: str) -> None:
    q, v = (sp.symbols(f"{letter}:{tree.nv}", real=True) for letter in "qv")
    result = formulas(tree, q, v)
    assert isinstance(result, str)
    assert re.search(message, result)
