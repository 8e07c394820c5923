"""Coordinates whose rates are the velocities, and bodies declared on frames."""

from typing import Any

import numpy as np
import pytest

from physics_crosscheck import (
    Coupling,
    DeclarationError,
    ForceElement,
    Joint,
    MultibodySystem,
    RigidBody,
)
from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.dynamics.tree_dynamics import Dynamics
from physics_crosscheck.reference.dynamics.tree_equations import Charted
from physics_crosscheck.reference.mechanism.assemble import assembled
from physics_crosscheck.reference.mechanism.chart import MinimalCoordinates
from physics_crosscheck.reference.mechanism.rotations import LONG_DOUBLES, Scalars
from physics_crosscheck.reference.mechanism.tree import WORLD, TreeError
from tests.reference.multibody.trees import tree

TREE = tree(("free", "hinge", "ball", "slide", "free"), 3)
N = TREE.nv
H = 1e-6


@pytest.fixture(scope="module")
def state() -> tuple[Scalars, Scalars, Scalars]:
    """Draw positions, rates and forces, a batch of five."""
    y, rates, forces = np.random.default_rng(0).normal(size=(3, N, 5))
    return y, rates, forces


def test_rates_match_the_motion_of_frames(state: tuple[Scalars, Scalars, Scalars]) -> None:
    """Compare the motion of frames under the tree's velocities and under the coordinates."""
    y, rates, _ = state
    chart, recursion = MinimalCoordinates(TREE), Recursion(TREE)
    v, q = chart.velocities(y, rates), chart.positions(y)
    assert chart.rates(y, v) == pytest.approx(rates, abs=1e-13)
    for body, here in zip(TREE.links, TREE.positions, strict=True):
        if body.kind in ("ball", "free"):
            part = slice(here.stop - 4, here.stop)
            q[part] /= np.sqrt((q[part] ** 2).sum(axis=0))
    moved = H * recursion.rates(q, v)
    by_tree = zip(recursion.placements(q + moved), recursion.placements(q - moved), strict=True)
    by_chart = zip(
        recursion.placements(chart.positions(y + H * rates)),
        recursion.placements(chart.positions(y - H * rates)),
        strict=True,
    )
    for (after, before), (later, earlier) in zip(by_tree, by_chart, strict=True):
        for a, b, c, d in zip(after, before, later, earlier, strict=True):
            assert (a - b) / (2 * H) == pytest.approx((c - d) / (2 * H), abs=1e-8)


def test_accelerations_are_derivatives_of_velocities(
    state: tuple[Scalars, Scalars, Scalars],
) -> None:
    y, rates, forces = state
    chart, charted = MinimalCoordinates(TREE), Charted(TREE)
    second = charted.acceleration(y, rates, forces)
    after, before = (
        chart.velocities(y + h * rates + h * h * second / 2, rates + h * second) for h in (H, -H)
    )
    q, v = chart.positions(y), chart.velocities(y, rates)
    expected = Dynamics(TREE).acceleration(q, v, chart.forces(y, forces))
    assert (after - before) / (2 * H) == pytest.approx(expected, abs=1e-7)
    assert charted.forces_for(y, rates, second) == pytest.approx(forces, abs=1e-11)
    unpushed = charted.acceleration(y, rates, 0 * forces)
    assert charted.effect(y, forces) == pytest.approx(second - unpushed, abs=1e-11)
    more = Charted(TREE, LONG_DOUBLES).acceleration(*map(LONG_DOUBLES.array, state))
    assert second == pytest.approx(more.astype(float), abs=1e-11)


def test_energy_of_the_rates_equals_energy_of_the_bodies(
    state: tuple[Scalars, Scalars, Scalars],
) -> None:
    y, rates, forces = state
    chart, mass = MinimalCoordinates(TREE), Charted(TREE).mass(y)
    kinetic = Dynamics(TREE).kinetic(chart.positions(y), chart.velocities(y, rates))
    assert (rates * (mass * rates).sum(axis=1)).sum(axis=0) / 2 == pytest.approx(kinetic)
    assert mass == pytest.approx(np.swapaxes(mass, 0, 1), abs=1e-13)
    energy, supplied, _ = Charted(TREE).powers(y, rates, forces)
    potential = Dynamics(TREE).potential(chart.positions(y))
    assert energy == pytest.approx(kinetic + potential)
    # A moment about the link's axes is not conjugate to the rates; a force is.
    translational = np.zeros_like(forces)
    translational[3:6] = forces[3:6]
    supplied = Charted(TREE).powers(y, rates, translational)[1]
    assert supplied == pytest.approx((translational * rates).sum(axis=0))


DOWN = (0.0, 0.0, -9.81)
HINGE = Joint(name="a", kind="hinge", axis=(0, 2, 0))
ROD = RigidBody(name="rod", parent=None, joints=(HINGE,), mass=2.0, inertia=(1, 2, 3, 0, 0, 0))


def test_fixed_bodies_merge_and_several_joints_form_a_chain() -> None:
    tip = RigidBody(name="tip", parent="rod", position=(0, 0, -1), mass=2.0)
    base = RigidBody(name="base", parent=None, position=(1, 0, 0), mass=9.0)
    two = (Joint(name="b", kind="slide", zero=0.5), Joint(name="c", kind="hinge", at=(0, 0, 1)))
    last = RigidBody(name="last", parent="tip", joints=two, mass=1.0)
    built = assembled([base, ROD, tip, last], DOWN)
    links = {name: link for name, (link, _) in built.tree.frames.items()}
    assert links == {"base": WORLD, "rod": 0, "tip": 0, "last": 2}
    assert [link.mass for link in built.tree.links] == [4.0, 0.0, 1.0]
    assert built.tree.links[0].center.tolist() == [0, 0, -0.5]
    assert built.tree.links[0].inertia.tolist() == np.diag([2.0, 3.0, 3.0]).tolist()
    assert built.tree.links[0].axis.tolist() == [0, 1, 0]
    assert built.tree.links[1].position.tolist() == [-0.5, 0, -1]
    assert built.tree.links[2].center.tolist() == [0, 0, -1]
    assert built.cancelled == ()


def test_rpy_equals_quaternion() -> None:
    half = np.sqrt(0.5)
    by_angles = RigidBody(name="x", parent=None, rpy=(0, 0, np.pi / 2))
    by_quaternion = RigidBody(name="x", parent=None, quaternion=(half, 0, 0, half))
    np.testing.assert_allclose(by_angles.place.rotation, by_quaternion.place.rotation, atol=1e-15)


def test_nonlinear_spring_and_control_become_force_elements() -> None:
    joint = Joint(name="a", kind="hinge", stiffness=(3.0, 2.0, 0.0), damping=0.5, rest=0.1)
    servo = ForceElement(
        name="p", joints=(("a", 2.0),), bias=(1, -5, -0.2), gain=(5, 0, 0), control=0.5
    )
    rod = RigidBody(name="rod", parent=None, joints=(joint,), mass=1.0)
    spring, drive = assembled([rod], DOWN, [servo]).tree.pulls
    assert (spring.stiffness, spring.damping, spring.rest) == ((3.0, 2.0), (), (0.1, 0.1))
    assert (drive.constant, drive.stiffness, drive.damping) == (3.5, (5.0,), (0.2,))
    assert assembled([rod], DOWN).tree.links[0].damping == 0.5


WRONG: list[tuple[Any, str]] = [
    (lambda: RigidBody(name="x", parent=None, mass=float("nan")), "mass and lift of body 'x'"),
    (lambda: RigidBody(name="x", parent=None, position=(1, 2)), "3 finite numbers"),  # type: ignore[arg-type]
    (lambda: RigidBody(name="x", parent=None, rpy=(1, 0, 0), quaternion=(1, 0, 0, 0)), "one of"),
    (lambda: RigidBody(name="x", parent=None, quaternion=(0, 0, 0, 0)), "has no length"),
    (lambda: Joint(name="x", kind="ball", rest_turn=(0.0, 0.0, 0.0, 0.0)), "rest_turn of joint"),
    (lambda: Joint(name="x", kind="hinge", limits=(1.0, 0.0)), "limits of joint 'x'"),
    (lambda: assembled([ROD, ROD], DOWN), "two bodies have the name 'rod'"),
    (
        lambda: assembled([ROD], DOWN, [ForceElement(name="p", joints=(("z", 1),))]),
        "pull 'p' names joint",
    ),
    (lambda: assembled([ROD], DOWN, (), [Coupling(follower="z", leader="a")]), "names joint 'z'"),
]


@pytest.mark.parametrize(("make", "message"), WRONG, ids=[message for _, message in WRONG])
def test_invalid_body_is_rejected_by_name(make: Any, message: str) -> None:
    with pytest.raises(TreeError, match=message):
        make()


def system(*bodies: RigidBody, **rest: Any) -> MultibodySystem:
    return MultibodySystem(name="s", title="s", source="s", gravity=DOWN, bodies=bodies, **rest)


def test_coupled_joints_have_no_coordinates() -> None:
    two = (Joint(name="b", kind="hinge"), Joint(name="c", kind="ball"))
    more = RigidBody(name="more", parent="rod", mass=1.0, joints=two)
    declared = system(ROD, more, couplings=(Coupling(follower="a", leader="b"),))
    names = [one.name for one in declared.tree_system.coordinates]
    assert names == ["b", "c:rx", "c:ry", "c:rz"]


@pytest.mark.parametrize(("bodies", "rest", "message"), [
    ((RigidBody(name="x", parent=None, mass=1.0),), {}, "has no joint"),
    ((ROD, RigidBody(name="x", parent="rod", mass=-2.0)), {}, "'x' and of the bodies fixed to it"),
    ((ROD,), {"couplings": (Coupling(follower="a", leader="a"),)}, "in a cycle"),
])  # fmt: skip
def test_invalid_system_is_rejected(
    bodies: tuple[RigidBody, ...], rest: dict[str, Any], message: str
) -> None:
    with pytest.raises(DeclarationError, match=message):
        system(*bodies, **rest)
