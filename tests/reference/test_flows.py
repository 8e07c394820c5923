"""Segments of a changed tree, and its next states by the rules of engines."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from physics_crosscheck import Fluid
from physics_crosscheck.reference.dynamics.recursion import bodies_apart
from physics_crosscheck.reference.dynamics.tree_dynamics import Dynamics
from physics_crosscheck.reference.dynamics.tree_equations import Charted
from physics_crosscheck.reference.mechanism.laws import Substeps
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import Scalars
from physics_crosscheck.reference.mechanism.tree import WORLD, Kind, Tree, TreeCoupling, TreeLink
from physics_crosscheck.reference.solving import flows
from physics_crosscheck.reference.solving.flows import Flow
from physics_crosscheck.reference.solving.integrate import ReferenceError
from physics_crosscheck.reference.solving.next_state import Scheme, SteppedBodies, next_states
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
    monkeypatch.setattr(flow, "_residuals", None)
    assert np.allclose(flow.variation(other), expected, atol=1e-12)


@pytest.mark.parametrize("which", range(4))
def test_residuals_of_a_changed_link_are_those_of_the_whole_tree(which: int) -> None:
    """Find a link, a child or an ancestor that keeps what it had before the change."""
    robot = mechanism(("hinge", "slide", "ball", "hinge"))
    robot = replace(robot, couplings=())
    link = robot.links[which]
    moved = replace(link, position=link.position + 0.1, mass=1.2 * link.mass, damping=0.3)
    links = (*robot.links[:which], moved, *robot.links[which + 1 :])
    n, draw = robot.dof, np.random.default_rng(4)
    given = draw.normal(size=(4, n, 7))
    other = replace(robot, links=links)
    actual = Charted(robot).residuals(*given)(other)
    assert np.array_equal(actual, Charted(other).residual(*given))
    assert not np.allclose(actual, Charted(robot).residual(*given))


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


RNG = np.random.default_rng(4)


def free_body(*, damping: float = 0.0) -> Tree:
    link = TreeLink(
        name="body", parent=WORLD, kind="free", mass=1.7, damping=damping,
        position=np.array([0.1, 0.2, 0.3]), rotation=np.eye(3), axis=np.array([1.0, 0, 0]),
        center=np.array([0.1, -0.2, 0.05]),
        inertia=np.array([[0.5, 0.02, 0.0], [0.02, 0.6, -0.03], [0.0, -0.03, 0.3]]),
    )  # fmt: skip
    return Tree(links=(link,), gravity=np.array([0.3, 0.0, -9.81]))


def exactly(tree: Tree, states: Array, h: float) -> Array:
    """Integrate with coordinates whose rates are velocities, by DOP853."""
    charted, n = Charted(tree), states.shape[1] // 2

    def rate(_: float, y: Array) -> Array:
        return np.concatenate([y[n:], charted.acceleration(y[:n], y[n:], 0 * y[n:])])

    return np.array([
        solve_ivp(rate, (0, h), one, "DOP853", rtol=1e-13, atol=1e-15).y[:, -1] for one in states
    ])  # fmt: skip


@pytest.mark.parametrize(
    ("scheme", "by_velocity", "order"),
    [
        ("semi-implicit Euler", False, 2),
        ("semi-implicit Euler", True, 2),
        ("Runge-Kutta 4", False, 5),
    ],
)
def test_step_of_a_turning_body_errs_by_its_order(
    scheme: Scheme, by_velocity: bool, order: int
) -> None:
    """Catch the mean of angular velocities, which would be of third order in a step."""
    tree = free_body(damping=0.4)
    states = RNG.uniform(-1, 1, (3, 12))
    still = np.zeros((3, 1, 6))
    stepped = SteppedBodies(tree)

    def error(h: float) -> float:
        ends = next_states(stepped, states, still, h, scheme=scheme, by_velocity=by_velocity)
        return float(np.max(np.abs(ends - exactly(tree, states, h))))

    assert np.log2(error(0.02) / error(0.01)) == pytest.approx(order, abs=0.15)


def test_velocities_and_rates_are_inverse() -> None:
    stepped = SteppedBodies(free_body())
    q, rate = RNG.uniform(-1, 1, (2, 4, 6))
    np.testing.assert_allclose(
        stepped.rates(q, stepped.velocities(q, rate)), rate, rtol=0, atol=1e-15
    )


def test_implicit_damping_matches_a_linear_system() -> None:
    """Compare with (M + h D) v' = M v of a slide, also with all forces by velocity."""
    slide = TreeLink(
        name="x", parent=WORLD, kind="slide", mass=2.0, damping=3.0, position=np.zeros(3),
        rotation=np.eye(3), axis=np.array([1.0, 0, 0]), center=np.zeros(3), inertia=np.eye(3),
    )  # fmt: skip
    stepped = SteppedBodies(Tree(links=(slide,), gravity=np.zeros(3)))
    state, still = np.array([[0.0, 1.0]]), np.zeros((1, 1, 1))
    implicit = next_states(
        stepped, state, still, 0.1, scheme="semi-implicit Euler", damping=np.array([[3.0]])
    )
    assert implicit[0, 1] == pytest.approx(2 / 2.3, abs=1e-15)
    whole = next_states(stepped, state, still, 0.1, scheme="semi-implicit Euler", by_velocity=True)
    np.testing.assert_allclose(whole, implicit, rtol=0, atol=1e-15)
    explicit = next_states(stepped, state, still, 0.1, scheme="semi-implicit Euler")
    assert explicit[0, 1] == pytest.approx(1 - 0.1 * 3 / 2, abs=1e-15)


@pytest.mark.parametrize("dampers", [0.0, 0.7])
def test_implicit_springs_match_a_linear_system(dampers: float) -> None:
    """Compare with M (v' - v) / h = -K (q + h v') - D v', of two slides."""
    links = tuple(
        TreeLink(
            name=name, parent=WORLD, kind="slide", mass=m, position=np.zeros(3), stiffness=k,
            rotation=np.eye(3), axis=np.array([1.0, 0, 0]), center=np.zeros(3), inertia=np.eye(3),
            damping=dampers,
        )
        for name, m, k in (("a", 2.0, 30.0), ("b", 0.5, 4.0))
    )  # fmt: skip
    stepped = SteppedBodies(Tree(links=links, gravity=np.zeros(3)))
    h, stiffness, damping = 0.1, np.diag([30.0, 4.0]), dampers * np.eye(2)
    q, v = np.array([0.3, -0.2]), np.array([1.0, 0.4])
    implicit = damping if dampers else None
    end = next_states(
        stepped, np.array([[*q, *v]]), np.zeros((1, 1, 2)), h, scheme="semi-implicit Euler",
        damping=implicit, stiffness=stiffness,
    )[0]  # fmt: skip
    force = -stiffness @ (q + h * end[2:]) - damping @ end[2:]
    np.testing.assert_allclose(np.array([2.0, 0.5]) * (end[2:] - v) / h, force, rtol=1e-14)
    np.testing.assert_allclose(end[:2], q + h * end[2:], rtol=1e-15)


@pytest.mark.parametrize(("changes", "speed"), [
    ({}, None),  # the same as four implicit steps
    ({"effort": 0.5}, 1 - 0.1 * 0.5 / 2),
    ({"stiffness": 0.0, "damping": 0.0, "passive": 8.0}, (1 - 0.1 / 4 * 8 / 2) ** 4),
    ({"stiffness": 0.0, "damping": 0.0, "passive": 1e3}, 0.0),  # no more than stops it
    ({"stiffness": 0.0, "damping": 0.0, "passive": 0.8, "repeats": 1}, 1 - 0.1 * 0.4 * 0.960596),
])  # fmt: skip
def test_substeps_match_a_slide(changes: dict[str, float], speed: float | None) -> None:
    numbers = {"stiffness": 30.0, "damping": 3.0, "effort": np.inf, "passive": 0.0, **changes}
    arrays = {key: np.array([one]) for key, one in numbers.items() if key != "repeats"}
    zero, repeats = np.zeros(1), int(changes.get("repeats", 0))
    law = Substeps(count=4, repeats=repeats, order=(0,), target=zero, speed=zero, **arrays)
    slide = TreeLink(
        name="x", parent=WORLD, kind="slide", mass=2.0, position=np.zeros(3), rotation=np.eye(3),
        axis=np.array([1.0, 0, 0]), center=np.zeros(3), inertia=np.eye(3),
        stiffness=numbers["stiffness"], damping=numbers["damping"] + numbers["passive"],
    )  # fmt: skip
    stepped = SteppedBodies(Tree(links=(slide,), gravity=np.zeros(3)))
    scheme: Scheme = "semi-implicit Euler"
    state, still = np.array([[0.3, 1.0]]), np.zeros((1, 4, 1))
    end = next_states(stepped, state, still[:, :1], 0.1, scheme=scheme, substeps=law)
    implicit = next_states(
        stepped, state, still, 0.1 / 4, scheme=scheme, steps=4,
        damping=np.array([[3.0]]), stiffness=np.array([[30.0]]),
    )  # fmt: skip
    wanted = implicit[0, 1] if speed is None else speed
    assert end[0, 1] == pytest.approx(wanted, rel=1e-6, abs=1e-14)
    if speed is None:
        assert end[0, 0] == pytest.approx(implicit[0, 0], rel=1e-14)


def test_diverging_motion_returns_nan() -> None:
    """Catch an exception, since a coarse step may cause the divergence."""
    nothing = TreeLink(
        name="x", parent=WORLD, kind="slide", mass=0.0, position=np.zeros(3), rotation=np.eye(3),
        axis=np.array([1.0, 0, 0]), center=np.zeros(3), inertia=np.zeros((3, 3)),
    )  # fmt: skip
    stepped = SteppedBodies(Tree(links=(nothing,), gravity=np.zeros(3)))
    still = np.zeros((1, 2, 1))
    states = next_states(
        stepped, np.ones((1, 2)), still, 0.1, scheme="semi-implicit Euler", steps=2
    )
    assert not np.isfinite(states).any()
