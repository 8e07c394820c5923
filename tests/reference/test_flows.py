"""Segments of a changed tree: as those that are solved from scratch, and to first order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from physics_crosscheck.reference.dynamics.chart_equations import Charted
from physics_crosscheck.reference.dynamics.inertial_parameters import bodies_apart
from physics_crosscheck.reference.dynamics.tree_dynamics import Dynamics
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import Scalars
from physics_crosscheck.reference.mechanism.tree import Fluid, Kind, Tree, TreeCoupling
from physics_crosscheck.reference.solving import flows
from physics_crosscheck.reference.solving.flows import Flow
from physics_crosscheck.reference.solving.integrate import ReferenceError
from tests.reference.multibody.trees import tree

KINDS: tuple[tuple[Kind, ...], ...] = (
    ("hinge", "slide", "hinge"), ("free", "hinge"), ("ball",), ("hinge", "hinge", "hinge", "hinge"),
)  # fmt: skip
LENGTH = 0.02


def mechanism(kinds: tuple[Kind, ...]) -> Tree:
    """A tree; of four hinges the last follows the first."""
    one = tree(kinds, 5)
    follows = (TreeCoupling(follower=3, leader=0, multiplier=-0.7),) if len(kinds) == 4 else ()
    return replace(one, couplings=follows)


def changed(one: Tree, share: float) -> Tree:
    """Another mass, place and axis of the last link."""
    link = one.links[-1]
    axis = link.axis + share * np.array([0.3, -0.2, 0.5])
    last = replace(
        link,
        mass=link.mass * (1 + share),
        position=link.position + share * np.array([0.1, 0.2, -0.1]),
        axis=axis / np.linalg.norm(axis),
        damping=link.damping + (0 if link.kind == "free" else share),
    )
    follows = tuple(replace(c, multiplier=c.multiplier * (1 + share)) for c in one.couplings)
    return replace(one, links=(*one.links[:-1], last), couplings=follows)


def given(one: Tree) -> tuple[Array, Array]:
    random = np.random.default_rng(3)
    return random.normal(size=(5, 2 * one.dof)), random.normal(size=(5, one.dof))


def ends(one: Tree, start: Array, forces: Array) -> Array:
    """By the classical Runge-Kutta method in many steps."""
    own, n, steps = Charted(one), one.dof, 100
    y, u, h = start.T, forces.T, LENGTH / steps

    def rate(state: Array) -> Array:
        return np.concatenate([state[n:], own.acceleration(state[:n], state[n:], u)])

    for _ in range(steps):
        k1 = rate(y)
        k2 = rate(y + h / 2 * k1)
        k3 = rate(y + h / 2 * k2)
        k4 = rate(y + h * k3)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return np.asarray(y.T)


@pytest.mark.slow
@pytest.mark.parametrize("kinds", KINDS)
def test_a_changed_tree_moves_the_ends_as_two_solutions_differ(kinds: tuple[Kind, ...]) -> None:
    one = mechanism(kinds)
    start, forces = given(one)
    other = changed(one, 0.2)
    flow = Flow(one, start, forces, LENGTH)
    apart = ends(other, start, forces) - ends(one, start, forces)
    assert np.abs(apart).max() > 1e-4
    assert np.allclose(flow.moved(other), apart, atol=1e-11)
    back = flow.for_tree(other).moved(one)
    assert np.allclose(back, -apart, atol=1e-11)


def test_a_tree_too_far_away_is_soon_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    one = mechanism(("hinge", "slide", "hinge"))
    start, forces = given(one)
    flow = Flow(one, start, forces, LENGTH)
    far = replace(one.links[-1], mass=1e-3, inertia=1e-9 * np.eye(3), damping=30.0)
    asked, own = [0], Charted.acceleration

    def counted(self: Charted, x: Scalars, rate: Scalars, forces: Scalars) -> Scalars:
        asked[0] += 1
        return own(self, x, rate, forces)

    monkeypatch.setattr(Charted, "acceleration", counted)
    with pytest.raises(ReferenceError, match="do not converge"):
        flow.for_tree(replace(one, links=(*one.links[:-1], far)))
    assert asked[0] <= 20


@pytest.mark.parametrize("kinds", KINDS)
def test_a_variation_is_the_slope_of_the_ends(kinds: tuple[Kind, ...]) -> None:
    one = mechanism(kinds)
    flow = Flow(one, *given(one), LENGTH)
    step = 1e-5
    both = (flow.moved(changed(one, step)) - flow.moved(changed(one, -step))) / (2 * step)
    found = flow.variation(changed(one, step)) / step
    assert np.allclose(found, both, atol=1e-4 * np.abs(both).max())
    assert np.abs(both).max() > 1e-4


@pytest.mark.parametrize("kinds", KINDS)
def test_forces_are_linear_in_the_numbers_of_bodies(
    kinds: tuple[Kind, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """So a tree of other bodies takes no recursion, and its variation is that of one that does."""
    one = mechanism(kinds)
    flow = Flow(one, *given(one), LENGTH)
    link, by = one.links[0], np.array([[0.2, 0.1, 0.0], [0.1, 0.3, 0.05], [0.0, 0.05, 0.4]])
    body = replace(link, mass=1.3 * link.mass, center=link.center + 0.1, inertia=link.inertia + by)
    other = replace(one, links=(body, *one.links[1:]))
    with monkeypatch.context() as patched:
        patched.setattr(flows, "bodies_apart", lambda *_: None)
        wanted = flow.variation(other)
    assert np.abs(wanted).max() > 1e-4
    monkeypatch.setattr(flow, "_residual", None)
    assert np.allclose(flow.variation(other), wanted, atol=1e-12)


def test_what_differs_in_more_than_bodies_is_not_taken_for_it() -> None:
    one = mechanism(("hinge", "slide", "hinge"))
    body = replace(one.links[1], mass=2 * one.links[1].mass)
    bodies = replace(one, links=(one.links[0], body, one.links[2]))
    apart = bodies_apart(bodies, one)
    assert apart is not None
    assert np.flatnonzero(apart).min() >= 10
    assert np.flatnonzero(apart).max() < 20
    assert bodies_apart(changed(one, 0.1), one) is None
    assert bodies_apart(replace(bodies, gravity=2 * one.gravity), one) is None
    assert bodies_apart(replace(bodies, fluid=Fluid(density=1.0)), one) is None
    lifted = replace(bodies, links=(replace(one.links[0], lifted=1.0), *one.links[1:]))
    assert bodies_apart(lifted, one) is None


def test_what_accelerations_leave_of_the_forces_is_that_of_the_mass_matrix() -> None:
    one = tree(("hinge", "free", "ball", "slide"), 6)
    random = np.random.default_rng(4)
    q = random.normal(size=(one.nq, 6))
    v, a, u = random.normal(size=(3, one.nv, 6))
    own = Dynamics(one)
    wanted = own.force(q, v, u) - (own.recursion.mass(q) * a).sum(axis=1)
    assert np.allclose(own.residual(q, v, a, u), wanted, atol=1e-11)
