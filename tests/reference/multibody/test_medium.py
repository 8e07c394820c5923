"""Bodies in a fluid: drag forces by virtual power, from positions alone."""

import dataclasses
from typing import Any

import casadi
import numpy as np
import pytest

from physics_crosscheck import Fluid, Joint, RigidBody
from physics_crosscheck.reference.dynamics.tree_dynamics import Dynamics
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.assemble import assembled
from physics_crosscheck.reference.mechanism.multibody import tree_system
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import LONG_DOUBLES, from_quaternion
from physics_crosscheck.reference.mechanism.tree import Immersed, Tree
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


def test_batch_equals_single_states() -> None:
    robot = immersed(WATER)
    q, v = state(robot, seed=5, batch=(2, 3))
    whole = Dynamics(robot).force(q, v, 0 * v)
    single = Dynamics(robot).force(q[:, 1, 2], v[:, 1, 2], 0 * v[:, 1, 2])
    assert whole[:, 1, 2] == pytest.approx(single)


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
