"""Trees, and segments from selected states: accurate, reused, and different for each number."""

import dataclasses
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy as sp

from physics_crosscheck import Coordinate, DeclarationError, System
from physics_crosscheck.reference.dynamics.derive import Equations, derive
from physics_crosscheck.reference.dynamics.equations import slopes_of
from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.dynamics.tree_equations import Charted, TreeEquations
from physics_crosscheck.reference.mechanism.assemble import TreeSystem, tree_system
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import DOUBLES, about_axis
from physics_crosscheck.reference.mechanism.tree import Kind, Tree, TreeCoupling, TreeLink
from physics_crosscheck.reference.solving.flows import ReusedSegments
from physics_crosscheck.reference.solving.integrate import ReferenceError, by_runge_kutta
from physics_crosscheck.reference.solving.samples import (
    LockedError,
    samples,
    select_d_optimal,
    solved,
    within,
)
from physics_crosscheck.reference.solving.segments import Segments
from tests.cases.arms import arm
from tests.reference.multibody.trees import state, tree

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


@pytest.mark.parametrize("apart", [1e-11, 1e-6])
def test_difference_of_two_solutions_widens_the_bound_or_fails(
    monkeypatch: pytest.MonkeyPatch, apart: float
) -> None:
    system = equations(tree(KINDS, 0))

    def perturbed(*given: Any, **options: Any) -> Array:
        return by_runge_kutta(*given, **options) * (1 + apart)

    monkeypatch.setattr("physics_crosscheck.reference.solving.samples.by_runge_kutta", perturbed)
    if apart > 1e-9:
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
    ((-np.inf, np.inf), 2.0, (2.0 - 1.0, 2.0 + 1.0)),
    ((-np.inf, -3.0), 0.0, (-3.0 - 1.0, -3.0)),
    ((5.0, np.inf), 0.0, (5.0, 5.0 + 1.0)),
    ((-100.0, 100.0), 1.0, (1.0 - np.pi, 1.0 + np.pi)),
    ((10.0, 100.0), 0.0, (10.0, 10.0 + np.pi)),
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
    assert ranges.tolist() == [[-1.0, 1.0], [0.5 - 1.0, 0.5 + 1.0], [0, 0.5]]


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


@cache
def solved_samples() -> tuple[TreeSystem, Segments]:
    system = tree_system(name="arm", title="", source="", tree=tree(("hinge", "slide", "hinge"), 5))
    limits = np.array([[-1.0, 1.0]] * 3)
    return system, samples(TreeEquations(system), limits, np.zeros(3), 6, 1)


def heavier(segments: Tree, factor: float) -> Tree:
    last = segments.links[-1]
    return replace(segments, links=(*segments.links[:-1], replace(last, mass=last.mass * factor)))


def damped(segments: Tree, damping: float) -> Tree:
    return replace(
        segments, links=(*segments.links[:-1], replace(segments.links[-1], damping=damping))
    )


def by_two_methods(system: TreeSystem, segments: Segments) -> Segments:
    return solved(
        TreeEquations(system),
        segments.start,
        segments.start_inputs,
        segments.length,
        segments.fastest,
    )


@pytest.mark.parametrize("factor", [0.4, 1.001])
def test_changed_tree_matches_new_solutions(factor: float) -> None:
    system, segments = solved_samples()
    drawn = replace(system, tree=heavier(system.tree, factor))
    actual = ReusedSegments(system, segments).for_tree(drawn.tree)
    expected = by_two_methods(drawn, segments)
    assert np.all(np.abs(actual.end - expected.end) <= actual.bound + expected.bound)
    # A mass change of 0.1 % exceeds every bound.
    assert np.max(np.abs(actual.end - segments.end) / actual.bound) > 1e4
    assert np.all(actual.bound < 1e-10 * np.max(np.abs(segments.end - segments.start), axis=0))


def test_unchanged_tree_matches_the_solved_segments() -> None:
    system, segments = solved_samples()
    actual = ReusedSegments(system, segments).for_tree(system.tree)
    assert np.all(np.abs(actual.end - segments.end) <= segments.bound)


def test_quicker_tree_has_shorter_segments() -> None:
    system, segments = solved_samples()
    quick = replace(system, tree=damped(system.tree, 400.0))
    actual = ReusedSegments(system, segments).for_tree(quick.tree)
    assert actual.length < segments.length / 2
    assert actual.fastest > 2 * segments.fastest
    expected = by_two_methods(quick, actual)
    assert np.array_equal(actual.end, expected.end)


def test_distant_tree_is_solved_again(monkeypatch: pytest.MonkeyPatch) -> None:
    system, segments = solved_samples()
    near = ReusedSegments(system, segments)

    def refused(*_: object) -> Segments:
        raise ReferenceError("it does not converge")

    monkeypatch.setattr(ReusedSegments, "_near", refused)
    drawn = replace(system, tree=heavier(system.tree, 2.0))
    assert np.array_equal(near.for_tree(drawn.tree).end, by_two_methods(drawn, segments).end)


CHAINS: tuple[tuple[Kind, ...], ...] = (
    ("hinge", "slide", "hinge"), ("free", "hinge"), ("ball", "slide"), ("hinge",) * 4,
)  # fmt: skip


def about_origin(link: TreeLink) -> Array:
    """Return a link's mass, mass times center, and inertia about its origin, (10,)."""
    c = link.center
    whole = link.inertia + link.mass * (c @ c * np.eye(3) - np.outer(c, c))
    products = whole[[0, 0, 1], [1, 2, 2]]
    return np.concatenate([[link.mass], link.mass * c, np.diag(whole), products])


def test_regressor_times_parameters_equals_inverse_dynamics() -> None:
    robot = tree(("hinge", "free", "ball", "slide", "hinge"), 4)
    q, v = state(robot, 1, (5,))
    a = state(robot, 2, (5,))[1]
    dynamics = Recursion(robot)
    numbers = np.concatenate([about_origin(link) for link in robot.links])
    forces = np.einsum("npk,p->nk", dynamics.regressor(q, v, a), numbers)
    assert np.allclose(forces, dynamics.bias(q, v, a), atol=1e-11)


def with_mass(robot: Tree, index: int, share: float) -> Tree:
    """Add mass to a link, with the same center and the same inertia about it."""
    link = robot.links[index]
    return with_link(robot, index, replace(link, mass=link.mass + share))


def with_link(robot: Tree, index: int, link: TreeLink) -> Tree:
    return replace(robot, links=(*robot.links[:index], link, *robot.links[index + 1 :]))


@pytest.mark.parametrize("kinds", CHAINS)
def test_slopes_match_finite_differences(kinds: tuple[Kind, ...]) -> None:
    robot = tree(kinds, 5)
    if len(kinds) == 4:
        robot = replace(robot, couplings=(TreeCoupling(follower=3, leader=0, multiplier=-0.7),))
    random, n, index, by = np.random.default_rng(3), robot.dof, len(kinds) - 2, 1e-6
    x, rate, forces = random.normal(size=(3, n, 6))
    dynamics = Charted(robot)
    second = dynamics.acceleration(x, rate, forces)
    slopes = dynamics.slopes(x, rate, second)
    ends = [with_mass(robot, index, way * by) for way in (1, -1)]
    up, down = (Charted(end).acceleration(x, rate, forces) for end in ends)
    change = (about_origin(ends[0].links[index]) - about_origin(ends[1].links[index])) / (2 * by)
    expected = -np.einsum("npk,p->nk", slopes[:, 10 * index : 10 * index + 10], change)
    assert np.allclose((up - down) / (2 * by), expected, atol=1e-6 * np.abs(expected).max())

    link, there = robot.links[0], robot.velocities[0]
    other = with_link(robot, 0, replace(link, damping=link.damping + by))
    moved = (Charted(other).acceleration(x, rate, forces) - second) / by
    first = 10 * len(robot.links)
    damped = -slopes[:, first + there.start : first + there.stop].sum(axis=1)
    assert np.allclose(moved, damped, atol=1e-4 * np.abs(damped).max() + 1e-9)


def test_only_state_that_shows_a_number_is_selected() -> None:
    rows = np.zeros((50, 2, 3))
    rows[:, 0, 0] = rows[:, 1, 1] = np.linspace(1, 2, 50)
    rows[17, 0, 2] = 1e-3
    assert 17 in select_d_optimal(rows, 2)
    assert sorted(select_d_optimal(rows, 50)) == list(range(50))


def test_selection_does_not_depend_on_parameterization() -> None:
    random = np.random.default_rng(2)
    rows = random.normal(size=(60, 3, 8)) * random.uniform(0.1, 3, size=(60, 1, 1))
    mixed = rows @ random.normal(size=(8, 8)) * 10.0 ** random.integers(-9, 9, size=8)
    twice = np.concatenate([rows, rows[..., :2], 0 * rows[..., :1]], axis=2)
    assert select_d_optimal(rows, 12) == select_d_optimal(mixed, 12) == select_d_optimal(twice, 12)


def test_selected_states_are_better_conditioned_than_random_ones() -> None:
    random = np.random.default_rng(4)
    rows = random.normal(size=(200, 2, 30)) * random.uniform(0, 1, size=(200, 1, 30)) ** 3

    def condition(states: list[int]) -> float:
        return float(np.linalg.cond(rows[states].reshape(-1, 30)))

    assert condition(select_d_optimal(rows, 24)) < condition(list(range(24))) / 2


def _tensor(values: list[float]) -> Array:
    xx, yy, zz, xy, xz, yz = values
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def links(declared: System) -> tuple[TreeLink, TreeLink]:
    """Return the arm as bodies: a turning shoulder, and a link on a slanted hinge."""
    c = {constant.name: constant.value for constant in declared.constants}
    names = ("xx", "yy", "zz", "xy", "xz", "yz")
    first, second = (
        _tensor([c[f"{body}_i{name}"] for name in names]) for body in ("shoulder", "link")
    )
    axes = np.eye(3)
    slant = about_axis(axes[1], np.array(c["slant"]), DOUBLES)
    return (
        TreeLink(
            name="pan", parent=-1, position=np.zeros(3), rotation=axes, kind="hinge",
            axis=axes[2], mass=c["shoulder_mass"], center=np.zeros(3), inertia=first,
            damping=c["friction"], stiffness=c["stiffness"],
        ),
        TreeLink(
            name="lift", parent=0, position=np.array([c["reach"], 0, 0]), rotation=slant,
            kind="hinge", axis=axes[0], mass=c["link_mass"],
            center=np.array([c["link_x"], c["link_y"], c["link_z"]]), inertia=second,
            damping=c["friction"],
        ),
    )  # fmt: skip


def as_tree(declared: System) -> TreeEquations:
    plain = {f.name: getattr(declared, f.name) for f in dataclasses.fields(declared)}
    del plain["interactions"]
    plain |= {"T": sp.Integer(0), "V": sp.Integer(0), "D": sp.Integer(0), "equilibria": ()}
    gravity = np.array([0.0, 0.0, -9.81])
    return TreeEquations(TreeSystem(**plain, tree=Tree(links=links(declared), gravity=gravity)))


@pytest.fixture(scope="module")
def written() -> Equations:
    return derive(arm())


@pytest.fixture(scope="module")
def recursive() -> TreeEquations:
    return as_tree(arm())


def random_arguments(n: int) -> tuple[Array, Array, Array, Array]:
    rng = np.random.default_rng(3)
    return tuple(rng.normal(size=(20, size)) for size in (n, n, 1, 1))  # type: ignore[return-value]


@pytest.mark.slow
def test_accelerations_masses_and_powers_match_the_formulas(
    written: Equations, recursive: TreeEquations
) -> None:
    arguments = random_arguments(2)
    pairs = (
        (written.numeric_acceleration, recursive.numeric_acceleration),
        (written.numeric_mass, recursive.numeric_mass),
    )
    for formula, recursion in pairs:
        assert np.max(np.abs(formula(*arguments) - recursion(*arguments))) < 1e-13 * np.max(
            np.abs(formula(*arguments))
        )
    # Energies may differ by a constant.
    apart = written.numeric_power(*arguments) - recursive.numeric_power(*arguments)
    assert np.ptp(apart[:, 0]) < 1e-13
    assert np.max(np.abs(apart[:, 1:])) < 1e-13


def test_scalars_equal_a_batch_of_one(recursive: TreeEquations) -> None:
    q, v, u, time = (part[0] for part in random_arguments(2))
    scalar = recursive.numeric_acceleration.scalar(*q, *v, *u, *time)
    assert scalar == pytest.approx(recursive.numeric_acceleration(q, v, u, time), rel=1e-14)


def test_rounding_error_has_the_size_of_doubles(recursive: TreeEquations) -> None:
    q, v, u, time = random_arguments(2)
    states, none = np.concatenate([q, v], axis=1), np.zeros(20)
    arguments = states, u, time[:, 0]
    still = recursive.acceleration_error(*arguments, off=0 * u, time_error=none, rounded=False)
    assert not still.any()
    rounding = recursive.acceleration_error(*arguments, off=0 * u, time_error=none, rounded=True)
    size = np.max(np.abs(recursive.numeric_acceleration(q, v, u, time)))
    assert 0 < np.max(rounding) < 1e-13 * size
    moved = recursive.acceleration_error(
        *arguments, off=0 * u + 1e-3, time_error=none, rounded=False
    )
    pushed = recursive.numeric_acceleration(q, v, u + 1e-3, time)
    effect = np.abs(pushed - recursive.numeric_acceleration(q, v, u, time))
    assert np.max(np.abs(moved - effect)) < 1e-9 * np.max(effect)


def test_wrong_number_of_coordinates_is_rejected(recursive: TreeEquations) -> None:
    system = recursive.system
    with pytest.raises(DeclarationError, match="has 1 coordinates, but its tree has 2 degrees"):
        dataclasses.replace(system, coordinates=system.coordinates[:1])
