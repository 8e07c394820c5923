"""Force paths compared with virtual power, and springs of ball joints with their energy."""

import dataclasses
import itertools
from typing import Any

import casadi
import numpy as np
import pytest

from physics_crosscheck import CablePath, FrameForce, JointForce
from physics_crosscheck.reference.dynamics.force_elements import Lines
from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.dynamics.tree_dynamics import Dynamics
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import (
    LONG_DOUBLES,
    quaternion_product,
    rotation_vector,
)
from physics_crosscheck.reference.mechanism.tree import (
    WORLD,
    Bushing,
    LinkFrame,
    Tree,
    TreeError,
    TreeForce,
    Way,
)
from tests.reference.multibody.kinematics import Poses, Rate, by_virtual_power, spin
from tests.reference.multibody.trees import KINDS, state, tree

TREE = tree(KINDS, 4)
FREE, BALL = 3, 2
RNG = np.random.default_rng(11)


def mark(link: int) -> LinkFrame:
    turn = np.linalg.qr(RNG.normal(size=(3, 3)))[0]
    return LinkFrame(link=link, position=RNG.normal(size=3), rotation=turn * np.linalg.det(turn))


A, B, C, D = (mark(link) for link in (0, 2, WORLD, 3))
GEAR = (0.3, -0.7, 0.5, 0.2, 0.9, -0.4)


def placed(frame: LinkFrame, poses: Poses) -> tuple[Any, Any]:
    turn, origin = casadi.DM(frame.rotation), casadi.DM(frame.position)
    if frame.link == WORLD:
        return casadi.SX(turn), casadi.SX(origin)
    link, link_origin = poses[frame.link]
    return casadi.mtimes(link, turn), link_origin + casadi.mtimes(link, origin)


def above(link: int) -> set[int]:
    return set() if link == WORLD else {link} | above(TREE.links[link].parent)


def row_of(way: Way, q: Array) -> tuple[Array, Array]:
    (line,) = Lines(TREE, Recursion(TREE)).lines_of([way], q)
    return line


def test_length_and_force_of_a_cable() -> None:
    way = CablePath(branches=((1.5, (A, B, C)), (-0.4, (D, A))))
    q, v = state(TREE, seed=3)

    def power(poses: Poses, rate: Rate) -> Any:
        total: Any = 0
        for share, row in way.branches:
            points = [placed(one, poses)[1] for one in row]
            for start, end in itertools.pairwise(points):
                total += share * rate(casadi.norm_2(end - start), true=False)
        return total

    length, row = row_of(way, q)
    assert row == pytest.approx(by_virtual_power(TREE, q, v, power), abs=1e-12)
    poses = Recursion(TREE).poses(q)
    points = [
        one.position if one.link == WORLD
        else poses[one.link].origin + poses[one.link].rotation @ one.position
        for one in (A, B, C, D)
    ]  # fmt: skip
    a, b, c, d = points
    expected = 1.5 * (np.linalg.norm(b - a) + np.linalg.norm(c - b)) - 0.4 * np.linalg.norm(a - d)
    assert length == pytest.approx([expected])


@pytest.mark.parametrize("frame", [A, D])
def test_force_on_a_frame_acts_along_its_axes(frame: LinkFrame) -> None:
    q, v = state(TREE, seed=4)

    def power(poses: Poses, rate: Rate) -> Any:
        turn, position = placed(frame, poses)
        moved, spun = rate(position, true=False), spin(turn, rate(turn, true=False))
        force, moment = casadi.DM(GEAR[:3]), casadi.DM(GEAR[3:])
        return casadi.dot(casadi.mtimes(turn, force), moved) + casadi.dot(moment, spun)

    length, row = row_of(FrameForce(frame=frame, gear=GEAR), q)
    assert row == pytest.approx(by_virtual_power(TREE, q, v, power), abs=1e-12)
    assert length == pytest.approx([0.0])


@pytest.mark.parametrize(("frame", "against"), [(D, A), (B, D), (A, C), (C, B)])
def test_force_between_frames_does_not_act_on_common_ancestors(
    frame: LinkFrame, against: LinkFrame
) -> None:
    q, v = state(TREE, seed=6)

    def power(poses: Poses, rate: Rate) -> Any:
        (turn, position), (other, origin) = placed(frame, poses), placed(against, poses)
        force, moment = (casadi.mtimes(other, casadi.DM(part)) for part in (GEAR[:3], GEAR[3:]))
        spun = [casadi.mtimes(x, spin(x, rate(x, true=False))) for x in (turn, other)]
        return casadi.dot(force, rate(position - origin, true=False)) + casadi.dot(
            moment, spun[0] - spun[1]
        )

    expected = by_virtual_power(TREE, q, v, power)
    for link in above(frame.link) & above(against.link):
        expected[TREE.velocities[link]] = 0.0
    length, row = row_of(FrameForce(frame=frame, gear=GEAR, against=against), q)
    assert row == pytest.approx(expected, abs=1e-12)
    poses = Recursion(TREE).poses(q)
    turns, points = [], []
    for end in (frame, against):
        turn = np.eye(3) if end.link == WORLD else poses[end.link].rotation
        turns.append(turn @ end.rotation)
        points.append(turn @ end.position + (0 if end.link == WORLD else poses[end.link].origin))
    from scipy.spatial.transform import Rotation

    apart = turns[1].T @ (points[0] - points[1])
    vector = Rotation.from_matrix(turns[1].T @ turns[0]).as_rotvec()
    assert length == pytest.approx([GEAR[:3] @ apart + GEAR[3:] @ vector])


@pytest.mark.parametrize("inside", [False, True])
def test_moment_on_a_ball_and_force_on_a_free_joint(inside: bool) -> None:
    q, v = state(TREE, seed=8)
    for link, gear in ((BALL, GEAR[:3]), (FREE, GEAR)):

        def power(poses: Poses, rate: Rate, link: int = link, gear: Any = gear) -> Any:
            turn, position = poses[link]
            above, origin = poses[TREE.links[link].parent] if TREE.links[link].parent >= 0 else (
                casadi.SX.eye(3), casadi.SX.zeros(3))  # fmt: skip
            carrier = casadi.mtimes(above, casadi.DM(TREE.links[link].rotation))
            relative = casadi.mtimes(carrier.T, turn)
            spun = spin(relative, rate(relative, true=False))
            moment: Any = casadi.DM(gear[-3:])
            moment = casadi.mtimes(relative.T, moment) if inside else moment
            place = casadi.mtimes(above.T, position - origin)
            along = casadi.mtimes(casadi.DM(TREE.links[link].rotation).T, rate(place, true=False))
            force = casadi.dot(casadi.DM(gear[:3]), along) if len(gear) == 6 else 0
            return casadi.dot(moment, spun) + force

        _, row = row_of(JointForce(joint=link, gear=gear, in_parent=inside), q)
        assert row == pytest.approx(by_virtual_power(TREE, q, v, power), abs=1e-12)


def test_quaternion_and_its_rotation_vector() -> None:
    axis = np.array([2.0, -1.0, 2.0]) / 3
    for angle in (0.0, 1e-9, 0.5, 3.0, 3.3, 6.0):
        turn = np.array([np.cos(angle / 2), *(np.sin(angle / 2) * axis)])
        near = angle if angle < np.pi else angle - 2 * np.pi
        assert rotation_vector(3 * turn) == pytest.approx(near * axis, rel=1e-12, abs=1e-14)
        twice = quaternion_product(turn, turn)
        assert twice == pytest.approx([np.cos(angle), *(np.sin(angle) * axis)], abs=1e-14)


def sprung() -> Tree:
    bushes = (
        Bushing(link=FREE, stiffness=(3.0, 2.0, 1.0), damping=(0.4, 0.2), place=(0.3, -0.2, 0.5),
             turn=(0.5, 0.5, -0.5, 0.5)),
        Bushing(link=BALL, stiffness=(5.0,), turn=(0.8, 0.0, 0.6, 0.0)),
    )  # fmt: skip
    pulls = (
        TreeForce(name="rope", along=CablePath(branches=((1.5, (A, B, C)),)), stiffness=(4.0, 1.0),
             damping=(0.5, 0.3), rest=(0.2, 0.4)),
        TreeForce(name="jet", along=FrameForce(frame=D, gear=GEAR, against=A), constant=2.0,
             stiffness=(0.7,), damping=(0.3,)),
        TreeForce(name="turn", along=JointForce(joint=BALL, gear=GEAR[:3]), stiffness=(0.5,)),
    )  # fmt: skip
    return dataclasses.replace(TREE, bushings=bushes, pulls=pulls)


def test_energy_loss_equals_dissipation() -> None:
    robot = sprung()
    q, v = state(robot, seed=9)
    dynamics = Dynamics(robot)
    rates, a, h = dynamics.recursion.rates(q, v), dynamics.acceleration(q, v, 0 * v), 1e-6
    ends = [
        dynamics.kinetic(q + s * rates, v + s * a) + dynamics.potential(q + s * rates)
        for s in (h, -h)
    ]
    assert (ends[1] - ends[0]) / (2 * h) == pytest.approx(dynamics.dissipated(q, v), rel=1e-6)
    long = Dynamics(robot, LONG_DOUBLES).force(*map(LONG_DOUBLES.array, (q, v, 0 * v)))
    assert dynamics.force(q, v, 0 * v) == pytest.approx(long.astype(float), rel=1e-11)


def test_switching_functions_of_nonsmooth_forces() -> None:
    robot = sprung()
    q, v = state(robot, seed=5, batch=(6,))
    values = Dynamics(robot).switching_functions(q, v)
    # Both ends of play and a rate; the angles of two motors; two angles, and six rates of a damper.
    assert values.shape == (3 + 2 + 2 + 6, 6)
    assert Dynamics(robot).nonsmooth
    assert not Dynamics(TREE).nonsmooth


def test_invalid_force_path_is_rejected_by_name() -> None:
    for element, message in (
        (TreeForce(name="p", along=JointForce(joint=BALL, gear=GEAR)), "p: j2 does not take"),
        (TreeForce(name="p", along=CablePath(branches=()), armature=1.0), "p: its path"),
    ):
        with pytest.raises(TreeError, match=message):
            dataclasses.replace(TREE, pulls=(element,))
