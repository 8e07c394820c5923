"""The derivation against three independent ones; units, and declared frames of bodies."""

import dataclasses
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy as sp

from physics_crosscheck import DeclarationError, Pose, System, ground, rotation
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.system import frame_function
from physics_crosscheck.reference.mechanism.units import UnitError, dimension_of, parse_unit
from tests.poses.arm import SWING, a, l
from tests.reference.mechanisms import CART, EPS, NAMES, equations_of, oscillator

EVERY = [*NAMES, CART.name]


# Newton's second law, where the source gives it (Eq. 2.4, 2.7, 3.5): m a = sum of the forces.


# Kane's method, from bodies, points and forces, without energies; heyoka has the other systems.


# heyoka's own formulation, numerically, at random states.


def heyoka_accelerations(
    system: System, states: Array | list[list[float]], forces: Array | list[list[float]]
) -> Array:
    """Compute accelerations by `heyoka.lagrangian`; inputs are constant forces, L + Q q."""
    hy = pytest.importorskip("heyoka")
    names = [str(x) for x in (*system.q, *system.v)]
    variables = hy.make_vars(*names)
    variables = list(variables) if isinstance(variables, list | tuple) else [variables]
    n = len(system.q)

    def convert(expression: sp.Expr) -> Any:
        number = sp.sympify(expression).xreplace(system.values).evalf(17)
        return hy.from_sympy(number) if number.free_symbols else hy.expression(float(number))

    accelerations = []
    for state, force in zip(states, forces, strict=True):
        given = dict(zip(system.u, map(sp.Float, force), strict=True))
        power = sum(q * f.xreplace(given) for q, f in zip(system.q, system.forces(), strict=True))
        equations = hy.lagrangian(
            convert(system.T - system.V + power), variables[:n], variables[n:], convert(system.D)
        )
        right = hy.cfunc([rhs for _, rhs in equations[n:]], vars=variables)
        accelerations.append(right(state))
    return np.array(accelerations)


def random_states(system: System, count: int = 5) -> tuple[Array, Array]:
    draw = np.random.default_rng(20240229)
    n = len(system.q)
    return draw.uniform(-2, 2, (count, 2 * n)), draw.uniform(-3, 3, (count, len(system.u)))


@pytest.mark.parametrize("name", EVERY)
def test_heyokas_lagrangian_gives_the_same_accelerations(name: str) -> None:
    derived = equations_of(name)
    system, n = derived.system, len(derived.system.q)
    states, forces = random_states(system)
    theirs = heyoka_accelerations(system, states, forces)
    ours = derived.numeric_acceleration(
        states[:, :n], states[:, n:], forces, np.zeros((len(states), 1))
    )
    # Both round about ten terms of either sign: they differ by 1.5 eps as measured, at most 32.
    assert np.max(np.abs(ours - theirs)) <= 32 * EPS * np.max(np.abs(theirs))


def test_heyokas_dissipation_function_has_our_sign() -> None:
    system = oscillator(2.0, 3.0, 5.0)
    accelerations = heyoka_accelerations(system, [[0.0, 1.0]], [[0.0]])
    assert accelerations[0, 0] == -1.5  # -c v / m
    assert derive(system).acceleration.subs(system.values).subs(
        {system.q[0]: 0, system.v[0]: 1, system.u[0]: 0}
    )[0] == sp.Rational(-3, 2)


# Properties of every derived equation.


@pytest.mark.parametrize("name", EVERY)
def test_energy_balance_is_zero(name: str) -> None:
    assert equations_of(name).energy_balance == 0


@pytest.mark.parametrize("name", EVERY)
def test_energy_balance_detects_a_missing_force(name: str) -> None:
    derived = equations_of(name)
    still = dict.fromkeys(derived.system.u, 0)
    silent = dataclasses.replace(derived, force=derived.force.xreplace(still))
    assert silent.energy_balance != 0


@pytest.mark.parametrize("name", EVERY)
def test_mass_matrix_is_symmetric_and_positive(name: str) -> None:
    derived = equations_of(name)
    assert derived.mass == derived.mass.T
    states, _ = random_states(derived.system)
    for state in states:
        place = dict(zip(derived.system.q, state, strict=False))
        mass = np.array(derived.mass.subs(derived.system.values).subs(place), dtype=float)
        assert np.all(np.linalg.eigvalsh(mass) > 0)


@pytest.mark.parametrize("name", EVERY)
def test_numeric_accelerations_match_the_symbolic_ones(name: str) -> None:
    derived = equations_of(name)
    system, n = derived.system, len(derived.system.q)
    states, forces = random_states(system)
    numbers = derived.numeric_acceleration(
        states[:, :n], states[:, n:], forces, np.zeros((len(states), 1))
    )
    for state, force, actual in zip(states, forces, numbers, strict=True):
        given = [map(sp.Rational, state), map(sp.Rational, force)]
        place = dict(zip((*system.q, *system.v, *system.u), (*given[0], *given[1]), strict=True))
        exact = (
            derived.mass.subs(system.values)
            .subs(place)
            .evalf(40)
            .LUsolve(derived.force.subs(system.values).subs(place).evalf(40))
        )
        # As for heyoka: ten terms of either sign, each rounded.
        largest = float(max(abs(e) for e in exact))
        assert np.max(np.abs(actual - np.array(exact, dtype=float).ravel())) <= 32 * EPS * largest


def test_moving_constraint_enters_the_equations() -> None:
    """Compare with a bead on a straight wire turning at w: m r'' = m w^2 r (Goldstein, 1.6)."""
    base = oscillator(1.5, 0.0, 2.0)
    x, m = base.coordinates[0], base.constants[0]
    w = dataclasses.replace(base.constants[2], name="w", unit="1/s")
    system = dataclasses.replace(
        base, T=m * (x.v**2 + w**2 * x.q**2) / 2, V=0, D=0, constants=(m, w)
    )
    derived = derive(system)
    assert derived.force[0] == sp.expand(m * w**2 * x.q) + system.u[0]


x, y, m, angle = sp.symbols("x y m angle", real=True)
DIMENSIONS = {x: parse_unit("m"), y: parse_unit("s"), m: parse_unit("kg"), angle: parse_unit("1")}


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("m", "m"),
        ("1", "1"),
        ("rad", "1"),
        ("N", "kg*m*s^-2"),
        ("kg*m/s^2", "kg*m*s^-2"),
        ("kg*m^2", "kg*m^2"),
        ("N*m/rad", "kg*m^2*s^-2"),
        ("J/s", "kg*m^2*s^-3"),
        ("W", "kg*m^2*s^-3"),
        ("m**2", "m^2"),
        ("1/s", "s^-1"),
        ("N * s / m", "kg*s^-1"),
        ("m/s/s", "m*s^-2"),
    ],
)
def test_unit_is_read_and_written_as_a_dimension(text: str, written: str) -> None:
    assert str(parse_unit(text)) == written


@pytest.mark.parametrize(
    "text", ["Nm", "lb", "kg*", "m^", "m^x", "s^-", "deg", "2*m", "N m", "m^1/2"]
)
def test_unit_with_an_unknown_part_is_refused_naming_it(text: str) -> None:
    with pytest.raises(UnitError, match="has an unknown part"):
        parse_unit(text)


@pytest.mark.parametrize(
    ("expression", "written"),
    [
        (m * x**2 / y**2, "kg*m^2*s^-2"),
        (sp.sqrt(x) ** 2 * sp.cos(angle), "m"),
        (sp.sqrt(x), "m^1/2"),
        (sp.atan2(x, 2 * x), "1"),
        (sp.exp(angle), "1"),
        (3 * x - x, "m"),
        (sp.sin(angle) ** angle, "1"),
        (sp.pi, "1"),
        (sp.Integer(0), "None"),
    ],
)
def test_expression_has_a_dimension(expression: sp.Expr, written: str) -> None:
    assert str(dimension_of(expression, DIMENSIONS)) == written


@pytest.mark.parametrize(
    ("expression", "named"),
    [
        (x + y, "but"),
        (x + 1, "but"),
        (sp.sin(x), "x in sin"),
        (sp.exp(y), "expected a dimensionless number"),
        (sp.Integer(2) ** x, "expected a dimensionless number"),
        (sp.atan2(x, y), "compares"),
        (m * (x + y), "but"),
    ],
)
def test_contradiction_is_named(expression: sp.Expr, named: str) -> None:
    with pytest.raises(UnitError, match=named):
        dimension_of(expression, DIMENSIONS)


EYE = sp.eye(3)
TILTED = rotation((1, 2, 2), a.q)


def frames(*declared: Any) -> System:
    return replace(SWING, frames=declared)


def test_frames_and_poses_are_functions_of_q() -> None:
    turned = ground.at(0, 0, 1).hinge(a, about=(0, -1, 0)).at(0, 0, -l)
    system = frames(turned.pose("end", "the end"), Pose("tip", tuple(turned.origin), "the same"))
    values = frame_function(system)(np.array([[0.3]])).reshape(2, 12)
    place = [0.8 * np.sin(0.3), 0, 1 - 0.8 * np.cos(0.3)]
    np.testing.assert_allclose(values[:, :3], [place, place], atol=1e-16)
    c, s = np.cos(0.3), np.sin(0.3)
    np.testing.assert_allclose(values[0, 3:], [c, 0, -s, 0, 1, 0, s, 0, c], atol=1e-16)
    np.testing.assert_array_equal(values[1, 3:], np.eye(3).ravel())


def test_quaternion_equals_its_rotation() -> None:
    half = a.q / 2
    turn = Pose("rod", (0, 0, 0), "rod", (sp.cos(half), 0, -sp.sin(half), 0)).rotation
    assert sp.simplify(turn - rotation((0, -1, 0), a.q)) == sp.zeros(3, 3)


@pytest.mark.parametrize(
    ("declared", "words"),
    [
        (Pose("", (0, 0, 0), "nothing"), "a frame needs a name"),
        (Pose("world", (0, 0, 0), "all"), "'world' is taken"),
        (Pose("rod", (0, 0, 0), ""), "it has no description"),
        (Pose("rod", (0, 0), "flat"), "its position must be three expressions, (x, y, z)"),  # type: ignore[arg-type]
        (Pose("rod", (a.v, 0, 0), "rod"), "it uses a_dot; use only positions and constants"),
        (Pose("rod", (sp.Symbol("w"), 0, 0), "rod"), "it uses w"),
        (Pose("rod", (l**2, 0, 0), "rod"), "its position has the unit m^2; expected m"),
        (Pose("rod", (l + a.q, 0, 0), "rod"), "has the unit"),
        (Pose("rod", (sp.I, 0, 0), "rod"), "which is not a real number"),
        (Pose("rod", (0, 0, 0), "rod", 2 * EYE), "not orthonormal"),
        (Pose("rod", (0, 0, 0), "rod", (0, 0, 0, 0)), "not orthonormal"),
        (Pose("rod", (0, 0, 0), "rod", (2, 0, 0, 0)), "not orthonormal"),
        (Pose("rod", (0, 0, 0), "rod", sp.diag(1, 1, -1)), "its rotation mirrors"),
        (Pose("rod", (0, 0, 0), "rod", sp.eye(2)), "must be a 3 x 3 matrix or a quaternion"),
        (Pose("rod", (0, 0, 0), "rod", l * TILTED), "its rotation has the unit m; expected 1"),
        ("rod", "is not a Pose"),
    ],
)
def test_wrong_frame_is_refused(declared: Any, words: str) -> None:
    with pytest.raises(DeclarationError) as error:
        frames(declared)
    assert words in str(error.value)


def test_two_frames_of_one_name_are_refused() -> None:
    with pytest.raises(DeclarationError, match="two frames share this name"):
        frames(Pose("rod", (0, 0, 0), "one"), Pose("rod", (0, 0, 1), "other"))


def test_plain_number_beside_a_length_is_in_metres() -> None:
    assert frames(Pose("rod", (l + 1.2, 0, 3), "rod", TILTED)).frames[0].position[2] == 3


@pytest.mark.parametrize(
    ("position", "rotation"),
    [
        (("print('run')", 0, 0), None),
        ((0, 0, 0), "print('run')"),
        ((0, 0, 0), ("print('run')", 0, 0, 0)),
        ((0, 0, 0), ((1, 0, 0), (0, 1, 0), (0, 0, "print('run')"))),
    ],
)
def test_text_in_a_pose_is_not_run(
    position: Any, rotation: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(ValueError, match="write a number or an expression"):
        Pose("rod", position, "rod", rotation)
    assert capsys.readouterr().out == ""
