"""The recursion's equations against those of T and V alone, and against more digits."""

from __future__ import annotations

import dataclasses
import itertools

import casadi
import mpmath
import numpy as np
import pytest

from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.dynamics.tree_dynamics import Dynamics, solved
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import DOUBLES, LONG_DOUBLES, objects
from physics_crosscheck.reference.mechanism.tree import Kind, Tree, TreeError, TreeForce
from tests.reference.multibody.trees import KINDS, link, state, tree

casadi.GlobalOptions.setNumpyMode(1)  # arrays of symbols are NumPy's; else it warns

SYMBOLS = objects(casadi.sin, casadi.cos, casadi.SX)
DIGITS = objects(mpmath.sin, mpmath.cos, mpmath.mpf)


def by_lagrange(one: Tree, q: Array, v: Array) -> tuple[Array, Array]:
    """Mass matrix and force of Lagrange's equations in the numbers of q, projected to v.

    Of the kinematics alone: velocities of bodies are derivatives of where they are. With
    dq/dt = N(q) v the equations in q, whose quaternions are held at length one by forces along
    themselves, are N^T (d/dt dT/dq' - dT/dq + dV/dq) = forces, which those do not enter.
    """
    at, rate = casadi.SX.sym("q", one.nq), casadi.SX.sym("r", one.nq)
    columns = np.array([[at[i]] for i in range(one.nq)], dtype=object)
    kinetic = casadi.SX(0)
    velocity = casadi.SX.sym("v", one.nv)
    slopes = casadi.vertcat(
        *Recursion(one, SYMBOLS).rates(
            columns, np.array([[velocity[i]] for i in range(one.nv)], dtype=object)
        )[:, 0]
    )
    tangent = casadi.jacobian(slopes, velocity)
    inverse = casadi.mtimes(casadi.pinv(tangent), rate)
    for body, pose, there in zip(
        one.links, Recursion(one, SYMBOLS).poses(columns), one.velocities, strict=True
    ):
        turn = casadi.SX(3, 3)
        for i, j in itertools.product(range(3), repeat=2):
            turn[i, j] = pose.rotation[i, j, 0]
        center = casadi.vertcat(*pose.origin[:, 0]) + casadi.mtimes(turn, casadi.DM(body.center))
        speed = casadi.jtimes(center, at, rate)
        spun = casadi.reshape(casadi.jtimes(casadi.reshape(turn, 9, 1), at, rate), 3, 3)
        skew = casadi.mtimes(turn.T, spun)
        angular = casadi.vertcat(skew[2, 1], skew[0, 2], skew[1, 0])
        own = inverse[there.start : there.stop]
        kinetic += body.mass * casadi.dot(speed, speed) / 2
        kinetic += casadi.dot(angular, casadi.mtimes(casadi.DM(body.inertia), angular)) / 2
        kinetic += body.armature * casadi.dot(own, own) / 2
    for pull in one.pulls:
        moved = sum(share * inverse[one.velocities[i].start] for i, share in pull.joints)
        kinetic += pull.armature * moved**2 / 2
    potential = Dynamics(one, SYMBOLS).potential(columns)[0]
    momentum = casadi.gradient(kinetic, rate)
    mass = casadi.mtimes([tangent.T, casadi.jacobian(momentum, rate), tangent])
    # d/dt of the momentum at v' = 0: q'' is then N' v.
    drift = casadi.mtimes(casadi.jacobian(slopes, at), slopes)
    carried = casadi.mtimes(casadi.jacobian(momentum, at), rate)
    carried += casadi.mtimes(casadi.jacobian(momentum, rate), drift)
    rest = carried - casadi.gradient(kinetic - potential, at)
    function = casadi.Function("lagrange", [at, rate, velocity], [mass, -tangent.T @ rest])
    rates = Recursion(one).rates(q, v)
    found = [np.array(part) for part in function(q, rates, v)]
    damping = np.concatenate(
        [
            np.full(there.stop - there.start, body.damping)
            for body, there in zip(one.links, one.velocities, strict=True)
        ]
    )
    return found[0], found[1][:, 0] - damping * v - damped(one, v)


def damped(one: Tree, v: Array) -> Array:
    """What the dampers of pulls ask."""
    out = np.zeros(one.nv)
    for pull in one.pulls:
        w = sum(share * v[one.velocities[i].start] for i, share in pull.joints)
        force = sum(d * w * abs(w) ** k for k, d in enumerate(pull.damping))
        for i, share in pull.joints:
            out[one.velocities[i].start] += share * force
    return out


def loaded(one: Tree) -> Tree:
    """With pulls on all its hinges and slides, and with parts that gravity does not pull on."""
    single = [i for i, body in enumerate(one.links) if body.kind in ("hinge", "slide")]
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
        for body in one.links
    )
    return Tree(links=tuple(links), gravity=one.gravity, pulls=pulls)


TREES: list[tuple[Kind, ...]] = [
    *((kind,) for kind in KINDS),
    *itertools.product(KINDS, repeat=2),
    ("free", "hinge", "hinge", "slide"),
    ("hinge", "ball", "slide", "free", "hinge"),
]


@pytest.mark.parametrize("kinds", TREES, ids="-".join)
def test_the_equations_are_those_of_the_energies(kinds: tuple[Kind, ...]) -> None:
    one = tree(kinds, seed=len(kinds))
    q, v = state(one, seed=7)
    dynamics = Dynamics(one)
    mass, force = by_lagrange(one, q, v)
    assert np.max(np.abs(dynamics.recursion.mass(q) - mass)) < 1e-12 * np.max(np.abs(mass))
    own = dynamics.force(q, v, np.zeros(one.nv))
    assert np.max(np.abs(own - force)) < 1e-12 * max(1.0, np.max(np.abs(force)))


@pytest.mark.parametrize("kinds", TREES[-2:], ids="-".join)
def test_so_they_are_with_pulls_and_lifted_parts(kinds: tuple[Kind, ...]) -> None:
    one = loaded(tree(kinds, seed=len(kinds)))
    q, v = state(one, seed=7)
    dynamics = Dynamics(one)
    mass, force = by_lagrange(one, q, v)
    assert np.max(np.abs(dynamics.mass(q) - mass)) < 1e-12 * np.max(np.abs(mass))
    own = dynamics.force(q, v, np.zeros(one.nv))
    assert np.max(np.abs(own - force)) < 1e-12 * max(1.0, np.max(np.abs(force)))
    energy = dynamics.kinetic(q, v) + dynamics.potential(q)
    rates, a, h = dynamics.recursion.rates(q, v), dynamics.acceleration(q, v, 0 * v), 1e-6
    ends = [
        dynamics.kinetic(q + s * rates, v + s * a) + dynamics.potential(q + s * rates)
        for s in (h, -h)
    ]
    lost = (ends[1] - ends[0]) / (2 * h)
    assert lost == pytest.approx(dynamics.dissipated(q, v), rel=1e-6)
    assert np.isfinite(energy)


def test_a_spring_pulls_nothing_between_its_rests() -> None:
    one = tree(("slide",), 0)
    pull = TreeForce(name="t", joints=((0, 2.0),), stiffness=(3.0,), rest=(-0.1, 0.2))
    plain, sprung = Dynamics(one), Dynamics(dataclasses.replace(one, pulls=(pull,)))
    q, none = np.array([[-0.5, -0.05, 0.0, 0.1, 0.5]]), np.zeros((1, 5))
    added = sprung.force(q, none, none) - plain.force(q, none, none)
    assert added[0] == pytest.approx([2 * 3 * 0.9, 0, 0, 0, -2 * 3 * 0.8])


def test_a_pull_on_a_ball_is_refused_by_name() -> None:
    one = tree(("ball",), 0)
    with pytest.raises(TreeError, match="t: j0 is neither a hinge"):
        dataclasses.replace(one, pulls=(TreeForce(name="t", joints=((0, 1.0),)),))


def test_a_batch_is_each_of_its_states() -> None:
    one = tree(("free", "hinge", "ball", "slide"), seed=3)
    q, v = state(one, seed=5, batch=(2, 3))
    u = np.random.default_rng(6).normal(size=v.shape)
    whole = Dynamics(one).acceleration(q, v, u)
    for at in np.ndindex(2, 3):
        alone = Dynamics(one).acceleration(q[:, *at], v[:, *at], u[:, *at])
        assert np.max(np.abs(whole[:, *at] - alone)) < 1e-13 * np.max(np.abs(alone))


@pytest.mark.parametrize(("joints", "most"), [(7, 2e-14), (30, 1e-12)])
def test_what_doubles_lose_is_what_long_doubles_tell(joints: int, most: float) -> None:
    """Of a chain, against 40 digits; the difference of both is the doubles' error to a digit."""
    one = tree([KINDS[0]] * joints, seed=1, chain=True)
    q, v = state(one, seed=2)
    u = np.zeros(one.nv)
    with mpmath.workdps(40):
        exact = Dynamics(one, DIGITS).acceleration(*map(DIGITS.array, (q, v, u)))
        doubles = Dynamics(one, DOUBLES).acceleration(q, v, u)
        long = Dynamics(one, LONG_DOUBLES).acceleration(*map(LONG_DOUBLES.array, (q, v, u)))
        error = np.array(
            [float(a - mpmath.mpf(float(b))) for a, b in zip(exact, doubles, strict=True)]
        )
        told = np.array((long - doubles), dtype=float)
    size = float(max(abs(float(a)) for a in exact))
    assert np.max(np.abs(error)) < most * size
    assert np.max(np.abs(told - error)) < 0.1 * np.max(np.abs(error)) + 1e-16 * size


def test_energy_is_kept_where_nothing_takes_it() -> None:
    """dE/dt = T' + V' by the accelerations is what dampers take, with every kind of joint."""
    one = tree(("free", "hinge", "ball", "slide"), seed=4)
    q, v = state(one, seed=8)
    dynamics = Dynamics(one, LONG_DOUBLES)
    wide = LONG_DOUBLES.array(q), LONG_DOUBLES.array(v)
    a = dynamics.acceleration(*wide, LONG_DOUBLES.array(np.zeros(one.nv)))
    h = np.longdouble(1e-6)

    def energy(step: np.longdouble) -> float:
        """Along the motion, to the second order in the step."""
        rate = dynamics.recursion.rates(*wide)
        later = dynamics.recursion.rates(wide[0] + step * rate, wide[1] + step * a)
        at = wide[0] + step * (rate + later) / 2, wide[1] + step * a
        kinetic, potential = dynamics.kinetic(*at), dynamics.potential(at[0])
        return kinetic + potential  # type: ignore[return-value]  # kept long

    damping = sum(
        body.damping * float((v[there] ** 2).sum())
        for body, there in zip(one.links, one.velocities, strict=True)
    )
    assert float((energy(h) - energy(-h)) / (2 * h)) == pytest.approx(-damping, rel=1e-8)


def test_linear_equations_are_solved_in_any_numbers() -> None:
    rng = np.random.default_rng(0)
    root = rng.normal(size=(5, 5, 4))
    mass, force = np.einsum("ikb,jkb->ijb", root, root), rng.normal(size=(5, 4))
    wide = solved(LONG_DOUBLES.array(mass), LONG_DOUBLES.array(force))
    assert np.max(np.abs(wide - solved(mass, force))) < 1e-10 * float(np.max(np.abs(wide)))


def test_a_link_before_the_one_that_carries_it_is_refused() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(TreeError, match="j0: the link that carries it must come before it"):
        Tree(links=(link("hinge", "j0", 0, rng),), gravity=np.zeros(3))
