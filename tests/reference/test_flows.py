"""Segments of a changed tree, compared with new solutions, and to first order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from physics_crosscheck import Fluid
from physics_crosscheck.reference.dynamics.chart_equations import Charted
from physics_crosscheck.reference.dynamics.inertial_parameters import bodies_apart
from physics_crosscheck.reference.dynamics.tree_dynamics import Dynamics
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import Scalars
from physics_crosscheck.reference.mechanism.tree import Kind, Tree, TreeCoupling
from physics_crosscheck.reference.solving import flows
from physics_crosscheck.reference.solving.flows import Flow
from physics_crosscheck.reference.solving.integrate import ReferenceError
from tests.reference.multibody.trees import tree

KINDS: tuple[tuple[Kind, ...], ...] = (
    ("hinge", "slide", "hinge"), ("free", "hinge"), ("ball",), ("hinge", "hinge", "hinge", "hinge"),
)  # fmt: skip
LENGTH = 0.02


def mechanism(kinds: tuple[Kind, ...]) -> Tree:
    """Draw a tree; the last of four hinges follows the first."""
    robot = tree(kinds, 5)
    follows = (TreeCoupling(follower=3, leader=0, multiplier=-0.7),) if len(kinds) == 4 else ()
    return replace(robot, couplings=follows)


def changed(robot: Tree, share: float) -> Tree:
    """Change mass, position and axis of the last link."""
    link = robot.links[-1]
    axis = link.axis + share * np.array([0.3, -0.2, 0.5])
    last = replace(
        link,
        mass=link.mass * (1 + share),
        position=link.position + share * np.array([0.1, 0.2, -0.1]),
        axis=axis / np.linalg.norm(axis),
        damping=link.damping + (0 if link.kind == "free" else share),
    )
    follows = tuple(replace(c, multiplier=c.multiplier * (1 + share)) for c in robot.couplings)
    return replace(robot, links=(*robot.links[:-1], last), couplings=follows)


def draw_state(robot: Tree) -> tuple[Array, Array]:
    random = np.random.default_rng(3)
    return random.normal(size=(5, 2 * robot.dof)), random.normal(size=(5, robot.dof))


def ends(robot: Tree, start: Array, forces: Array) -> Array:
    """Integrate by the classical Runge-Kutta method in many steps."""
    charted, n, steps = Charted(robot), robot.dof, 100
    y, u, h = start.T, forces.T, LENGTH / steps

    def rate(state: Array) -> Array:
        return np.concatenate([state[n:], charted.acceleration(state[:n], state[n:], u)])

    for _ in range(steps):
        k1 = rate(y)
        k2 = rate(y + h / 2 * k1)
        k3 = rate(y + h / 2 * k2)
        k4 = rate(y + h * k3)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return np.asarray(y.T)


@pytest.mark.slow
@pytest.mark.parametrize("kinds", KINDS)
def test_moved_ends_match_two_solutions(kinds: tuple[Kind, ...]) -> None:
    robot = mechanism(kinds)
    start, forces = draw_state(robot)
    other = changed(robot, 0.2)
    flow = Flow(robot, start, forces, LENGTH)
    apart = ends(other, start, forces) - ends(robot, start, forces)
    assert np.abs(apart).max() > 1e-4
    assert np.allclose(flow.moved(other), apart, atol=1e-11)
    back = flow.for_tree(other).moved(robot)
    assert np.allclose(back, -apart, atol=1e-11)


def test_distant_tree_fails_early(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = mechanism(("hinge", "slide", "hinge"))
    start, forces = draw_state(robot)
    flow = Flow(robot, start, forces, LENGTH)
    far = replace(robot.links[-1], mass=1e-3, inertia=1e-9 * np.eye(3), damping=30.0)
    calls, acceleration = [0], Charted.acceleration

    def counted(self: Charted, x: Scalars, rate: Scalars, forces: Scalars) -> Scalars:
        calls[0] += 1
        return acceleration(self, x, rate, forces)

    monkeypatch.setattr(Charted, "acceleration", counted)
    with pytest.raises(ReferenceError, match="do not converge"):
        flow.for_tree(replace(robot, links=(*robot.links[:-1], far)))
    assert calls[0] <= 20


@pytest.mark.parametrize("kinds", KINDS)
def test_variation_matches_finite_differences(kinds: tuple[Kind, ...]) -> None:
    robot = mechanism(kinds)
    flow = Flow(robot, *draw_state(robot), LENGTH)
    step = 1e-5
    both = (flow.moved(changed(robot, step)) - flow.moved(changed(robot, -step))) / (2 * step)
    actual = flow.variation(changed(robot, step)) / step
    assert np.allclose(actual, both, atol=1e-4 * np.abs(both).max())
    assert np.abs(both).max() > 1e-4


@pytest.mark.parametrize("kinds", KINDS)
def test_forces_are_linear_in_the_numbers_of_bodies(
    kinds: tuple[Kind, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Compare the variation for changed bodies with and without the recursion."""
    robot = mechanism(kinds)
    flow = Flow(robot, *draw_state(robot), LENGTH)
    link, by = robot.links[0], np.array([[0.2, 0.1, 0.0], [0.1, 0.3, 0.05], [0.0, 0.05, 0.4]])
    body = replace(link, mass=1.3 * link.mass, center=link.center + 0.1, inertia=link.inertia + by)
    other = replace(robot, links=(body, *robot.links[1:]))
    with monkeypatch.context() as patched:
        patched.setattr(flows, "bodies_apart", lambda *_: None)
        expected = flow.variation(other)
    assert np.abs(expected).max() > 1e-4
    monkeypatch.setattr(flow, "_residual", None)
    assert np.allclose(flow.variation(other), expected, atol=1e-12)


def test_only_changes_of_bodies_count_as_such() -> None:
    robot = mechanism(("hinge", "slide", "hinge"))
    body = replace(robot.links[1], mass=2 * robot.links[1].mass)
    bodies = replace(robot, links=(robot.links[0], body, robot.links[2]))
    apart = bodies_apart(bodies, robot)
    assert apart is not None
    assert np.flatnonzero(apart).min() >= 10
    assert np.flatnonzero(apart).max() < 20
    assert bodies_apart(changed(robot, 0.1), robot) is None
    assert bodies_apart(replace(bodies, gravity=2 * robot.gravity), robot) is None
    assert bodies_apart(replace(bodies, fluid=Fluid(density=1.0)), robot) is None
    lifted = replace(bodies, links=(replace(robot.links[0], lifted=1.0), *robot.links[1:]))
    assert bodies_apart(lifted, robot) is None


def test_residual_matches_the_mass_matrix() -> None:
    robot = tree(("hinge", "free", "ball", "slide"), 6)
    random = np.random.default_rng(4)
    q = random.normal(size=(robot.nq, 6))
    v, a, u = random.normal(size=(3, robot.nv, 6))
    dynamics = Dynamics(robot)
    expected = dynamics.force(q, v, u) - (dynamics.recursion.mass(q) * a).sum(axis=1)
    assert np.allclose(dynamics.residual(q, v, a, u), expected, atol=1e-11)
