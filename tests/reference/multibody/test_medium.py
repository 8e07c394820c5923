"""Force paths, ball springs, media and coupled joints against formulas and the whole tree."""

import dataclasses
import itertools
import re
from typing import Any

import casadi
import numpy as np
import pytest
import sympy as sp

from physics_crosscheck import (
    CablePath,
    Coupling,
    Fluid,
    ForceElement,
    FrameForce,
    Joint,
    JointForce,
    RigidBody,
)
from physics_crosscheck.reference.dynamics.force_elements import Lines
from physics_crosscheck.reference.dynamics.formulas import SymbolicEquations, formulas
from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.dynamics.tree_dynamics import Dynamics
from physics_crosscheck.reference.dynamics.tree_equations import Charted, TreeEquations
from physics_crosscheck.reference.mechanism.assemble import assembled, tree_system
from physics_crosscheck.reference.mechanism.chart import Coupled, MinimalCoordinates
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import LONG_DOUBLES, from_quaternion
from physics_crosscheck.reference.mechanism.tree import (
    WORLD,
    Bushing,
    Immersed,
    LinkFrame,
    Tree,
    TreeCoupling,
    TreeError,
    TreeForce,
    Way,
)
from physics_crosscheck.reference.solving.samples import samples, smooth_segments
from tests.reference.multibody.kinematics import Poses, Rate, by_virtual_power, spin
from tests.reference.multibody.trees import KINDS, state, tree

WATER = Fluid(density=12.0, viscosity=0.3, wind=(1.0, -2.0, 0.5))


def immersed(fluid: Fluid) -> Tree:
    """Return a tree of every kind of joint with four boxes, two of them on one link."""
    robot, rng = tree(KINDS, 4), np.random.default_rng(8)
    turns = [from_quaternion(turn) for turn in rng.normal(size=(4, 4))]
    boxes = tuple(
        Immersed(
            link=link,
            position=rng.normal(size=3),
            rotation=turns[i],
            size=rng.uniform(0.1, 0.6, 3),
        )
        for i, link in enumerate((0, 1, 1, 3))
    )  # fmt: skip
    return dataclasses.replace(robot, fluid=fluid, immersed=boxes)


def by_power(robot: Tree, q: Array, v: Array) -> Array:
    """Compute the drag forces as MuJoCo documents them, with half the edges r."""
    fluid = robot.fluid
    assert fluid is not None

    def power(poses: Poses, rate: Rate) -> Any:
        total: Any = casadi.SX(0)
        for box in robot.immersed:
            link, origin = poses[box.link]
            turn = casadi.mtimes(link, casadi.DM(box.rotation))
            center = origin + casadi.mtimes(link, casadi.DM(box.position))
            wind = casadi.DM(np.array(fluid.wind))
            u = casadi.mtimes(turn.T, rate(center) - wind)
            w = spin(turn, rate(turn))
            r = box.size / 2
            mean = r.sum() / 3
            for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
                force = -2 * fluid.density * r[j] * r[k] * casadi.fabs(u[i]) * u[i]
                force -= 6 * np.pi * fluid.viscosity * mean * u[i]
                moment = (
                    -fluid.density / 2 * r[i] * (r[j] ** 4 + r[k] ** 4) * casadi.fabs(w[i]) * w[i]
                )
                moment -= 8 * np.pi * fluid.viscosity * mean**3 * w[i]
                along = casadi.mtimes(turn.T, rate(center, true=False))
                total += force * along[i] + moment * spin(turn, rate(turn, true=False))[i]
        return total

    return by_virtual_power(robot, q, v, power)


@pytest.mark.parametrize("wind", [WATER.wind, (0.0, 0.0, 0.0)])
def test_drag_matches_virtual_power(wind: tuple[float, float, float]) -> None:
    robot = immersed(dataclasses.replace(WATER, wind=wind))
    dry = dataclasses.replace(robot, fluid=None)
    q, v = state(robot, seed=3)
    none = np.zeros(robot.nv)
    actual = Dynamics(robot).force(q, v, none) - Dynamics(dry).force(q, v, none)
    expected = by_power(robot, q, v)
    assert np.max(np.abs(actual - expected)) < 1e-12 * np.max(np.abs(expected))
    lost = Dynamics(robot).dissipated(q, v) - Dynamics(dry).dissipated(q, v)
    assert lost == pytest.approx(-expected @ v)
    assert lost > 0 or any(wind)
    long = Dynamics(robot, LONG_DOUBLES).force(*map(LONG_DOUBLES.array, (q, v, none)))
    assert Dynamics(robot).force(q, v, none) == pytest.approx(long.astype(float), rel=1e-12)


def test_box_has_the_mass_and_inertia_of_its_body() -> None:
    a, b, c, m = 0.2, 0.3, 0.5, 4.0
    moments = (m / 12 * (b**2 + c**2), m / 12 * (a**2 + c**2), m / 12 * (a**2 + b**2))
    body = RigidBody(name="b", parent=None, mass=m, inertia=(*moments, 0.0, 0.0, 0.0))
    assert body.box is not None
    # The format's edges are sqrt(6) of these moments by the mass; r is half of an edge.
    assert body.box[1] == pytest.approx([a, b, c])
    turned = dataclasses.replace(body, inertia_rpy=(0.3, 0.2, -0.5))
    tensor = turned.spatial_inertia.inertia
    whole = (*np.diag(tensor).tolist(), tensor[0, 1], tensor[0, 2], tensor[1, 2])
    box = dataclasses.replace(body, inertia=whole).box
    assert box is not None
    place, size = box
    assert sorted(size) == pytest.approx([a, b, c])
    assert turned.box is not None
    for axis, edge in zip(place.rotation.T, size, strict=True):
        actual = turned.box[0].rotation[:, int(np.argmin(np.abs(turned.box[1] - edge)))]
        assert abs(axis @ actual) == pytest.approx(1.0)
    assert dataclasses.replace(body, mass=0.0).box is None
    plate = dataclasses.replace(body, inertia=(1.0, 2.0, 3.0, 0.0, 0.0, 0.0)).box
    assert plate is not None
    assert plate[1][2] == pytest.approx(np.sqrt(1e-15 * 6 / m))


def test_fixed_bodies_have_their_own_boxes_and_static_bodies_none() -> None:
    moments = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)
    still = RigidBody(name="still", parent=None, mass=1.0, inertia=moments)
    arm = dataclasses.replace(still, name="arm", joints=(Joint(name="j", kind="hinge"),))
    bodies = (
        still, arm,
        dataclasses.replace(still, name="tip", parent="arm", position=(0.0, 0.0, 1.0)),
        dataclasses.replace(still, name="smooth", parent="arm", dragged=False),
    )  # fmt: skip
    boxes = assembled(bodies, (0.0, 0.0, 0.0), fluid=WATER).tree.immersed
    assert [one.position.tolist() for one in boxes] == [[0, 0, 0], [0, 0, 1]]
    assert assembled(bodies, (0.0, 0.0, 0.0)).tree.immersed == ()


def test_segments_avoid_sign_changes_of_a_drag() -> None:
    """Catch segments across a sign change, where a drag is not smooth."""
    robot = immersed(WATER)
    equations = TreeEquations(tree_system(name="n", title="t", source="s", tree=robot))
    n = robot.nv
    drawn = samples(equations, np.tile([-np.inf, np.inf], (n, 1)), np.zeros(n), 30, 1)
    assert equations.nonsmooth
    signs = [equations.switching_functions(at[:, :n], at[:, n:]) for at in (drawn.start, drawn.end)]
    assert signs[0].shape == (30, 6 * 4)
    assert np.array_equal(signs[0] > 0, signs[1] > 0)
    assert np.min(drawn.bound) >= 0


def test_error_if_every_segment_crosses_a_kink() -> None:
    robot = immersed(WATER)
    equations = TreeEquations(tree_system(name="n", title="t", source="s", tree=robot))
    n, far = robot.nv, np.full((8, 2 * robot.nv), np.nan)
    with pytest.raises(RuntimeError, match="every segment crosses a kink"):
        smooth_segments(
            equations, lambda forces: lambda t, y: y, lambda k: (far, far[:, :n]), 2, 1.0
        )


def gripper() -> Tree:
    """Return a floating base with a chain of two coupled joints and a fixed joint."""
    robot = tree(("free", "hinge", "slide", "hinge", "slide"), 5)
    return dataclasses.replace(
        robot,
        couplings=(
            TreeCoupling(follower=4, leader=3, multiplier=-0.7, offset=0.1),
            TreeCoupling(follower=3, leader=1, multiplier=2.0, offset=-0.3),
            TreeCoupling(follower=2, leader=None, offset=0.25),
        ),
    )


def test_follower_positions_follow_the_leader() -> None:
    coupled = Coupled(gripper())
    assert coupled.kept == [0, 1, 2, 3, 4, 5, 6]
    x = np.arange(7.0)
    y = coupled.positions(x)
    assert y[:7] == pytest.approx(x)
    assert y[7] == pytest.approx(0.25)
    assert y[8] == pytest.approx(2 * 6 - 0.3)
    assert y[9] == pytest.approx(-0.7 * (2 * 6 - 0.3) + 0.1)


def test_accelerations_match_the_constrained_tree() -> None:
    """Solve the equations with multipliers (KKT) directly."""
    held = gripper()
    whole = dataclasses.replace(held, couplings=())
    coupled, chart, dynamics = Coupled(held), MinimalCoordinates(held), Dynamics(whole)
    x, rate, forces = np.random.default_rng(2).normal(size=(3, 7, 4))
    y, rates = coupled.positions(x), coupled.rates(rate)
    given = np.zeros_like(y)
    given[coupled.kept] = forces
    q, v = chart.positions(y), chart.velocities(y, rates)
    rows = np.zeros((3, 10))
    rows[0, [9, 8]], rows[1, [8, 6]], rows[2, 7] = (1.0, 0.7), (1.0, -2.0), 1.0
    mass, force = dynamics.mass(q), dynamics.force(q, v, chart.forces(y, given))
    for k in range(4):
        whole_matrix = np.block([[mass[:, :, k], rows.T], [rows, np.zeros((3, 3))]])
        a = np.linalg.solve(whole_matrix, [*force[:, k], 0, 0, 0])[:10]
        expected = chart.second_derivatives(y[:, k : k + 1], v[:, k : k + 1], a[:, None])[:7, 0]
        actual = Charted(held).acceleration(x[:, k], rate[:, k], forces[:, k])
        assert actual == pytest.approx(expected, rel=1e-10, abs=1e-10)
    batch = Charted(held).acceleration(x, rate, forces)
    assert Charted(held).forces_for(x, rate, batch) == pytest.approx(forces, abs=1e-10)
    long = Charted(held, LONG_DOUBLES).acceleration(*map(LONG_DOUBLES.array, (x, rate, forces)))
    assert batch == pytest.approx(long.astype(float), abs=1e-10)
    unpushed = Charted(held).acceleration(x, rate, 0 * forces)
    assert Charted(held).effect(x, forces) == pytest.approx(batch - unpushed, abs=1e-10)


def test_energy_matches_the_whole_tree() -> None:
    held = gripper()
    x, rate = np.random.default_rng(3).normal(size=(2, 7, 4))
    mass = Charted(held).mass(x)
    kinetic = (rate * (mass * rate).sum(axis=1)).sum(axis=0) / 2
    coupled, chart = Coupled(held), MinimalCoordinates(held)
    y = coupled.positions(x)
    v = chart.velocities(y, coupled.rates(rate))
    assert kinetic == pytest.approx(Dynamics(held).kinetic(chart.positions(y), v))


def test_joint_with_several_leaders() -> None:
    robot = tree(("hinge", "slide", "hinge", "slide"), 5)
    ends = (
        TreeCoupling(follower=1, leader=0, multiplier=2.0, others=((3, -0.5),), offset=0.1),
        TreeCoupling(follower=2, leader=1, multiplier=3.0, others=((0, 1.0),)),
    )
    coupled = Coupled(dataclasses.replace(robot, couplings=ends))
    y = coupled.positions(np.array([0.7, -0.4]))
    followed = 2 * 0.7 + 0.5 * 0.4 + 0.1
    assert y == pytest.approx([0.7, followed, 3 * followed + 0.7, -0.4])


def test_cycle_of_couplings_is_rejected() -> None:
    robot = tree(("hinge", "hinge"), 0)
    ends = (TreeCoupling(follower=0, leader=1), TreeCoupling(follower=1, leader=0))
    with pytest.raises(TreeError, match="j0, j1 follow each other in a cycle"):
        Coupled(dataclasses.replace(robot, couplings=ends))


def test_coupled_ball_joint_is_rejected() -> None:
    robot = tree(("ball", "hinge"), 0)
    with pytest.raises(TreeError, match="j0 is coupled, but neither a hinge"):
        dataclasses.replace(robot, couplings=(TreeCoupling(follower=1, leader=0),))


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
