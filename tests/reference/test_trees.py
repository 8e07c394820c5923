"""Equations and motions of a tree match formulas that are derived from energies."""

import dataclasses

import numpy as np
import pytest
import sympy as sp

from physics_crosscheck import DeclarationError, Scenario, System, t
from physics_crosscheck.reference.dynamics.derive import Equations, derive
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.multibody import TreeSystem
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import DOUBLES, about_axis
from physics_crosscheck.reference.mechanism.tree import Tree, TreeLink
from physics_crosscheck.reference.solving.solve import solve
from tests.cases.arms import arm


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


@pytest.mark.slow
def test_slopes_match_the_formulas(written: Equations, recursive: TreeEquations) -> None:
    q, v, u, time = random_arguments(2)
    states = np.concatenate([q, v], axis=1)
    exact = written.slopes(states, u, time[:, 0])
    actual = recursive.slopes(states, u, time[:, 0])
    assert np.max(np.abs(actual - exact)) < 1e-6 * np.max(np.abs(exact))


@pytest.mark.slow
def test_motion_matches_the_formulas_within_both_bounds(written: Equations) -> None:
    torque = sp.Rational(1, 5) * sp.sin(3 * t)
    given = written.system.scenarios[0]
    scenario = Scenario(
        "one", "-", q=given.q, v=given.v, inputs=dict.fromkeys(given.inputs, torque), duration=0.5
    )
    system = dataclasses.replace(written.system, scenarios=(scenario,))
    expected = solve(derive(system), scenario)
    actual = solve(as_tree(system), scenario)
    assert actual.method == "multiple shooting by Gauss collocation, checked by DOP853"
    assert len(expected.t) == len(actual.t)
    allowed = expected.global_bound + actual.global_bound
    assert np.all(np.abs(expected.start - actual.start) <= allowed[:-1] + 1e-300)
    assert np.max(actual.bound / actual.movement) < 1e-12


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
