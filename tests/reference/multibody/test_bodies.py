"""Bodies of a file are assembled to a tree, or rejected by name."""

from __future__ import annotations

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
from physics_crosscheck.reference.mechanism.assemble import assembled
from physics_crosscheck.reference.mechanism.bodies import powers
from physics_crosscheck.reference.mechanism.tree import WORLD, TreeError

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
    assert links == {
        "base": WORLD,
        "rod": 0,
        "tip": 0,
        "last": 2,
    }
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
    assert powers(0.0) == powers((0.0, 0.0)) == ()


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
