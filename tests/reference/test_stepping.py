"""Steps of integration schemes, against exact motions and formulas."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from physics_crosscheck.reference.dynamics.chart_equations import Charted
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.tree import WORLD, Tree, TreeLink
from physics_crosscheck.reference.solving.next_state import Scheme, SteppedBodies, next_states

RNG = np.random.default_rng(4)


def free_body(*, damping: float = 0.0) -> Tree:
    """Return one free body with general numbers."""
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
def test_implicit_springs_match_a_linear_system(
    dampers: float,
) -> None:
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
