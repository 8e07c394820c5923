"""Segments from selected states: within limits, and accurate compared with more digits."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from physics_crosscheck import Coordinate
from physics_crosscheck.reference.dynamics.equations import slopes_of
from physics_crosscheck.reference.dynamics.tree_dynamics import Dynamics
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.multibody import TreeSystem
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import LONG_DOUBLES, Scalars
from physics_crosscheck.reference.mechanism.tree import Kind, Tree
from physics_crosscheck.reference.solving.integrate import ReferenceError, by_runge_kutta
from physics_crosscheck.reference.solving.samples import (
    MAX_DIFFERENCE,
    MAX_LIMIT_DISTANCE,
    SAMPLING_RANGE,
    LockedError,
    samples,
    within,
)
from physics_crosscheck.reference.solving.segments import Segments
from tests.reference.multibody.trees import tree

KINDS: tuple[Kind, ...] = ("hinge", "slide", "hinge", "hinge")
OPEN = np.array([-np.inf, np.inf])


def equations(robot: Tree) -> TreeEquations:
    units = {"hinge": "rad", "slide": "m"}
    return TreeEquations(
        TreeSystem(
            name="t", title="t", source="a test", constants=(), inputs=(), outputs=(),
            T=0, V=0, D=0, equilibria=(), scenarios=(), published=(), tree=robot,
            coordinates=tuple(Coordinate(k.name, units[k.kind], "-") for k in robot.links),
        )
    )  # fmt: skip


def in_long_doubles(robot: Tree, segments: Segments) -> Array:
    """Compute ends by the classical Runge-Kutta method, extrapolated, (K, 2n)."""
    dynamics, n = Dynamics(robot, LONG_DOUBLES), robot.nv
    forces = LONG_DOUBLES.array(segments.start_inputs.T)

    def rate(state: Scalars) -> Scalars:
        a = dynamics.acceleration(state[:n], state[n:], forces)
        return np.concatenate([state[n:], a])

    def ends(steps: int) -> Scalars:
        h, y = np.longdouble(segments.length) / steps, LONG_DOUBLES.array(segments.start.T)
        for _ in range(steps):
            k1 = rate(y)
            k2 = rate(y + h / 2 * k1)
            k3 = rate(y + h / 2 * k2)
            k4 = rate(y + h * k3)
            y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return y

    coarse, fine = ends(96), ends(192)
    return np.array(fine + (fine - coarse) / 15).T


@pytest.mark.slow
def test_ends_match_more_digits_within_their_bound() -> None:
    robot = tree(KINDS, 0)
    segments = samples(equations(robot), np.tile(OPEN, (4, 1)), np.zeros(4), 40, 0)
    error = np.max(np.abs(segments.end - in_long_doubles(robot, segments)), axis=0)
    movement = np.max(np.abs(segments.end - segments.start), axis=0)
    assert np.all(error <= segments.bound)
    assert np.all(segments.bound < 1e-12 * movement)
    # The bound is tight.
    assert np.max(error / segments.bound) > 1e-3


@pytest.mark.parametrize("apart", [1e-11, 1e-6])
def test_difference_of_two_solutions_widens_the_bound_or_fails(
    monkeypatch: pytest.MonkeyPatch, apart: float
) -> None:
    system = equations(tree(KINDS, 0))

    def perturbed(*given: Any, **options: Any) -> Array:
        return by_runge_kutta(*given, **options) * (1 + apart)

    monkeypatch.setattr("physics_crosscheck.reference.solving.samples.by_runge_kutta", perturbed)
    if apart > MAX_DIFFERENCE:
        with pytest.raises(ReferenceError, match=r"two solutions of \S+ are \S+e-0[567] apart"):
            samples(system, np.tile(OPEN, (4, 1)), np.zeros(4), 40, 0)
        return
    segments = samples(system, np.tile(OPEN, (4, 1)), np.zeros(4), 40, 0)
    assert np.all(segments.bound >= 0.9 * apart * np.max(np.abs(segments.end), axis=0))


def test_every_joint_moves_and_has_forces() -> None:
    segments = samples(equations(tree(KINDS, 1)), np.tile(OPEN, (4, 1)), np.zeros(4), 40, 1)
    n = segments.start_inputs.shape[1]
    turned = np.max(np.abs(segments.end - segments.start), axis=0)
    assert np.all(turned[:n] > 1e-3)
    assert np.all(turned[n:] > 1e-2)
    assert np.all(np.std(segments.start_inputs, axis=0) > 0)


def test_states_are_within_limits_and_the_same_for_one_seed() -> None:
    limits = np.array([[-0.5, 0.2], [0.1, 0.4], OPEN, [-np.inf, -3.0]])
    first, second = (
        samples(equations(tree(KINDS, 1)), limits, np.zeros(4), 60, 5) for _ in range(2)
    )
    q = first.start[:, :4]
    assert np.all((q >= limits[:, 0]) & (q <= limits[:, 1]))
    assert np.array_equal(first.start, second.start)
    assert np.array_equal(first.end, second.end)


@pytest.mark.parametrize(("limits", "home", "expected"), [
    ((-0.5, 0.2), 0.0, (-0.5, 0.2)),
    ((-np.inf, np.inf), 2.0, (2.0 - SAMPLING_RANGE, 2.0 + SAMPLING_RANGE)),
    ((-np.inf, -3.0), 0.0, (-3.0 - SAMPLING_RANGE, -3.0)),
    ((5.0, np.inf), 0.0, (5.0, 5.0 + SAMPLING_RANGE)),
    ((-100.0, 100.0), 1.0, (1.0 - MAX_LIMIT_DISTANCE, 1.0 + MAX_LIMIT_DISTANCE)),
    ((10.0, 100.0), 0.0, (10.0, 10.0 + MAX_LIMIT_DISTANCE)),
])  # fmt: skip
def test_positions_are_drawn_near_home(
    limits: tuple[float, float], home: float, expected: tuple[float, float]
) -> None:
    assert within(np.array([limits]), np.array([home]))[0] == pytest.approx(expected)


def test_slopes_under_forces_are_differences_of_accelerations() -> None:
    system = equations(tree(KINDS, 1))
    rng = np.random.default_rng(3)
    states, forces = rng.normal(size=(5, 8)), rng.normal(size=(5, 4))
    slopes = system.pushed_slopes(states, forces)
    plain = slopes_of(lambda q, v: system.pushed_acceleration(q, v, forces), states)
    assert slopes.shape == (5, 4, 8)
    assert slopes == pytest.approx(plain, abs=1e-7 * np.max(np.abs(plain)))


def test_locked_joint_is_rejected_by_name() -> None:
    robot = tree(("hinge", "hinge"), 1, chain=True)
    light = dataclasses.replace(
        robot.links[1], mass=1e-14, inertia=1e-14 * np.eye(3), armature=0.0, damping=1.0
    )
    bad = dataclasses.replace(robot, links=(robot.links[0], light))
    with pytest.raises(LockedError, match=r"damping 1 stops joint 'j1', .*, within 1e-14 s"):
        samples(equations(bad), np.tile(OPEN, (2, 1)), np.zeros(2), 10, 1)


def test_empty_limits_are_ignored() -> None:
    limits = np.array([[0.0, 0.0], [0.5, 0.5], [0.0, 0.5]])
    ranges = within(limits, np.array([0.0, 0.5, 0.1]))
    assert ranges.tolist() == [
        [-SAMPLING_RANGE, SAMPLING_RANGE],
        [0.5 - SAMPLING_RANGE, 0.5 + SAMPLING_RANGE],
        [0, 0.5],
    ]


def test_joint_without_any_inertia_is_refused() -> None:
    robot = tree(("hinge", "hinge"), 1, chain=True)
    light = dataclasses.replace(robot.links[1], mass=0.0, inertia=np.zeros((3, 3)), armature=0.0)
    bad = dataclasses.replace(robot, links=(robot.links[0], light))
    with pytest.raises(ReferenceError, match="joint 'j1' moves no mass"):
        samples(equations(bad), np.tile(OPEN, (2, 1)), np.zeros(2), 10, 1)


def test_joints_that_move_no_inertia_together_are_all_named() -> None:
    """Catch one joint that is blamed for two about the same axis with no mass between them."""
    robot = tree(("hinge", "hinge", "hinge"), 1, chain=True)
    first, second, third = (dataclasses.replace(one, armature=0.0) for one in robot.links)
    second = dataclasses.replace(second, mass=0.0, inertia=np.zeros((3, 3)))
    third = dataclasses.replace(third, axis=second.axis, position=np.zeros(3), rotation=np.eye(3))
    bad = dataclasses.replace(robot, links=(first, second, third))
    with pytest.raises(ReferenceError, match="together, joints 'j1' and 'j2' move no mass"):
        samples(equations(bad), np.tile(OPEN, (3, 1)), np.zeros(3), 10, 1)
