"""The recursion's equations against Lagrange's equations, and against more digits."""

import dataclasses
import itertools

import casadi
import mpmath
import numpy as np
import pytest

from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.dynamics.tree_dynamics import Dynamics
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import DOUBLES, LONG_DOUBLES, objects
from physics_crosscheck.reference.mechanism.tree import Kind, Tree, TreeError, TreeForce
from tests.reference.multibody.trees import KINDS, link, state, tree

casadi.GlobalOptions.setNumpyMode(1)  # arrays of symbols are NumPy's; else it warns

SYMBOLS = objects(casadi.sin, casadi.cos, casadi.SX)
DIGITS = objects(mpmath.sin, mpmath.cos, mpmath.mpf)


def by_lagrange(robot: Tree, q: Array, v: Array) -> tuple[Array, Array]:
    """Return the mass matrix and force of Lagrange's equations in q, projected to v."""
    position, rate = casadi.SX.sym("q", robot.nq), casadi.SX.sym("r", robot.nq)
    columns = np.array([[position[i]] for i in range(robot.nq)], dtype=object)
    kinetic = casadi.SX(0)
    velocity = casadi.SX.sym("v", robot.nv)
    slopes = casadi.vertcat(
        *Recursion(robot, SYMBOLS).rates(
            columns, np.array([[velocity[i]] for i in range(robot.nv)], dtype=object)
        )[:, 0]
    )
    tangent = casadi.jacobian(slopes, velocity)
    inverse = casadi.mtimes(casadi.pinv(tangent), rate)
    for body, pose, there in zip(
        robot.links, Recursion(robot, SYMBOLS).poses(columns), robot.velocities, strict=True
    ):
        turn = casadi.SX(3, 3)
        for i, j in itertools.product(range(3), repeat=2):
            turn[i, j] = pose.rotation[i, j, 0]
        center = casadi.vertcat(*pose.origin[:, 0]) + casadi.mtimes(turn, casadi.DM(body.center))
        speed = casadi.jtimes(center, position, rate)
        spun = casadi.reshape(casadi.jtimes(casadi.reshape(turn, 9, 1), position, rate), 3, 3)
        skew = casadi.mtimes(turn.T, spun)
        angular = casadi.vertcat(skew[2, 1], skew[0, 2], skew[1, 0])
        joint_rate = inverse[there.start : there.stop]
        kinetic += body.mass * casadi.dot(speed, speed) / 2
        kinetic += casadi.dot(angular, casadi.mtimes(casadi.DM(body.inertia), angular)) / 2
        kinetic += body.armature * casadi.dot(joint_rate, joint_rate) / 2
    for element in robot.pulls:
        moved = sum(share * inverse[robot.velocities[i].start] for i, share in element.joints)
        kinetic += element.armature * moved**2 / 2
    potential = Dynamics(robot, SYMBOLS).potential(columns)[0]
    momentum = casadi.gradient(kinetic, rate)
    mass = casadi.mtimes([tangent.T, casadi.jacobian(momentum, rate), tangent])
    # d/dt of the momentum at v' = 0: q'' is then N' v.
    drift = casadi.mtimes(casadi.jacobian(slopes, position), slopes)
    carried = casadi.mtimes(casadi.jacobian(momentum, position), rate)
    carried += casadi.mtimes(casadi.jacobian(momentum, rate), drift)
    rest = carried - casadi.gradient(kinetic - potential, position)
    function = casadi.Function("lagrange", [position, rate, velocity], [mass, -tangent.T @ rest])
    rates = Recursion(robot).rates(q, v)
    parts = [np.array(part) for part in function(q, rates, v)]
    damping = np.concatenate(
        [
            np.full(there.stop - there.start, body.damping)
            for body, there in zip(robot.links, robot.velocities, strict=True)
        ]
    )
    return parts[0], parts[1][:, 0] - damping * v - damped(robot, v)


def damped(robot: Tree, v: Array) -> Array:
    """Return the forces of the dampers of force elements."""
    out = np.zeros(robot.nv)
    for element in robot.pulls:
        w = sum(share * v[robot.velocities[i].start] for i, share in element.joints)
        force = sum(d * w * abs(w) ** k for k, d in enumerate(element.damping))
        for i, share in element.joints:
            out[robot.velocities[i].start] += share * force
    return out


def loaded(robot: Tree) -> Tree:
    """Return the tree with force elements on hinges and slides, and with buoyancy."""
    single = [i for i, body in enumerate(robot.links) if body.kind in ("hinge", "slide")]
    rng = np.random.default_rng(4)
    pulls = (
        TreeForce(
            name="tendon", joints=tuple((i, float(rng.normal())) for i in single),
            stiffness=(3.0, 2.0, 1.0), damping=(0.3, 0.2, 0.1), rest=(0.2, 0.2), armature=0.7,
        ),
        TreeForce(name="servo", joints=((single[0], 2.0),), constant=1.5, stiffness=(4.0,)),
    )  # fmt: skip
    links = (
        dataclasses.replace(body, lifted=float(rng.uniform(0, 2)), lift=rng.normal(size=3))
        for body in robot.links
    )
    return Tree(links=tuple(links), gravity=robot.gravity, pulls=pulls)


TREES: list[tuple[Kind, ...]] = [
    *((kind,) for kind in KINDS),
    *itertools.product(KINDS, repeat=2),
    ("free", "hinge", "hinge", "slide"),
    ("hinge", "ball", "slide", "free", "hinge"),
]


@pytest.mark.parametrize("kinds", TREES, ids="-".join)
def test_equations_match_lagrange(kinds: tuple[Kind, ...]) -> None:
    robot = tree(kinds, seed=len(kinds))
    q, v = state(robot, seed=7)
    dynamics = Dynamics(robot)
    mass, force = by_lagrange(robot, q, v)
    assert np.max(np.abs(dynamics.recursion.mass(q) - mass)) < 1e-12 * np.max(np.abs(mass))
    actual = dynamics.force(q, v, np.zeros(robot.nv))
    assert np.max(np.abs(actual - force)) < 1e-12 * max(1.0, np.max(np.abs(force)))


@pytest.mark.parametrize("kinds", TREES[-2:], ids="-".join)
def test_equations_match_lagrange_with_force_elements_and_buoyancy(kinds: tuple[Kind, ...]) -> None:
    robot = loaded(tree(kinds, seed=len(kinds)))
    q, v = state(robot, seed=7)
    dynamics = Dynamics(robot)
    mass, force = by_lagrange(robot, q, v)
    assert np.max(np.abs(dynamics.mass(q) - mass)) < 1e-12 * np.max(np.abs(mass))
    actual = dynamics.force(q, v, np.zeros(robot.nv))
    assert np.max(np.abs(actual - force)) < 1e-12 * max(1.0, np.max(np.abs(force)))
    energy = dynamics.kinetic(q, v) + dynamics.potential(q)
    rates, a, h = dynamics.recursion.rates(q, v), dynamics.acceleration(q, v, 0 * v), 1e-6
    ends = [
        dynamics.kinetic(q + s * rates, v + s * a) + dynamics.potential(q + s * rates)
        for s in (h, -h)
    ]
    lost = (ends[1] - ends[0]) / (2 * h)
    assert lost == pytest.approx(dynamics.dissipated(q, v), rel=1e-6)
    assert np.isfinite(energy)


def test_spring_is_slack_within_its_rest_range() -> None:
    robot = tree(("slide",), 0)
    spring = TreeForce(name="t", joints=((0, 2.0),), stiffness=(3.0,), rest=(-0.1, 0.2))
    plain, sprung = Dynamics(robot), Dynamics(dataclasses.replace(robot, pulls=(spring,)))
    q, none = np.array([[-0.5, -0.05, 0.0, 0.1, 0.5]]), np.zeros((1, 5))
    added = sprung.force(q, none, none) - plain.force(q, none, none)
    assert added[0] == pytest.approx([2 * 3 * 0.9, 0, 0, 0, -2 * 3 * 0.8])


def test_force_element_on_a_ball_joint_is_rejected() -> None:
    robot = tree(("ball",), 0)
    with pytest.raises(TreeError, match="t: j0 is neither a hinge"):
        dataclasses.replace(robot, pulls=(TreeForce(name="t", joints=((0, 1.0),)),))


def test_batch_equals_single_states() -> None:
    robot = tree(("free", "hinge", "ball", "slide"), seed=3)
    q, v = state(robot, seed=5, batch=(2, 3))
    u = np.random.default_rng(6).normal(size=v.shape)
    whole = Dynamics(robot).acceleration(q, v, u)
    for index in np.ndindex(2, 3):
        single = Dynamics(robot).acceleration(q[:, *index], v[:, *index], u[:, *index])
        assert np.max(np.abs(whole[:, *index] - single)) < 1e-13 * np.max(np.abs(single))


@pytest.mark.parametrize(("joints", "tolerance"), [(7, 2e-14), (30, 1e-12)])
def test_long_doubles_estimate_the_error_of_doubles(joints: int, tolerance: float) -> None:
    """Compare the estimated error of a chain with the error against 40 digits."""
    robot = tree([KINDS[0]] * joints, seed=1, chain=True)
    q, v = state(robot, seed=2)
    u = np.zeros(robot.nv)
    with mpmath.workdps(40):
        exact = Dynamics(robot, DIGITS).acceleration(*map(DIGITS.array, (q, v, u)))
        doubles = Dynamics(robot, DOUBLES).acceleration(q, v, u)
        long = Dynamics(robot, LONG_DOUBLES).acceleration(*map(LONG_DOUBLES.array, (q, v, u)))
        error = np.array(
            [float(a - mpmath.mpf(float(b))) for a, b in zip(exact, doubles, strict=True)]
        )
        estimate = np.array((long - doubles), dtype=float)
    size = float(max(abs(float(a)) for a in exact))
    assert np.max(np.abs(error)) < tolerance * size
    assert np.max(np.abs(estimate - error)) < 0.1 * np.max(np.abs(error)) + 1e-16 * size


def test_link_before_its_parent_is_rejected() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(TreeError, match="j0: the link that carries it must come before it"):
        Tree(links=(link("hinge", "j0", 0, rng),), gravity=np.zeros(3))
