"""Symbolic equations of small trees match the numbers of the recursion."""

from __future__ import annotations

import re

import numpy as np
import pytest
import sympy as sp

from physics_crosscheck import Coupling, ForceElement, Joint, RigidBody
from physics_crosscheck.reference.dynamics.formulas import SymbolicEquations, formulas
from physics_crosscheck.reference.dynamics.tree_dynamics import Dynamics
from physics_crosscheck.reference.mechanism.assemble import assembled
from physics_crosscheck.reference.mechanism.tree import Tree

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
