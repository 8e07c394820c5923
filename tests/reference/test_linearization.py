"""Linearizations against derivatives and textbook formulas, and the range of linear equations."""

import dataclasses

import mpmath as mp
import numpy as np
import pytest
import sympy as sp

from physics_crosscheck import Coordinate, Equilibrium, Input, Output, System
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.dynamics.linearize import (
    TaylorLinearization,
    damped_shapes,
    evaluate_transfer,
    linearize,
    modes,
    poles,
    s,
    taylor,
    transfer_functions,
)
from physics_crosscheck.reference.solving.linearity import LinearityError, linearity
from tests.reference.mechanisms import (
    CART,
    EPS,
    LINEAR,
    NAMES,
    X,
    built_in,
    constant,
    declared,
    equations_of,
    oscillator,
    pendulum,
)

RESTS = [
    *((name, e.name) for name in NAMES for e in built_in(name).equilibria),
    (CART.name, "hanging"),
]


def linearized(name: str, rest: str) -> TaylorLinearization:
    equations = equations_of(name)
    (equilibrium,) = (e for e in equations.system.equilibria if e.name == rest)
    return linearize(equations, equilibrium)


def linear(system: System) -> TaylorLinearization:
    return linearize(derive(system), system.equilibria[0])


# A and B


def derivatives(name: str, linearization: TaylorLinearization) -> mp.matrix:
    """Compute A and B as derivatives of the first-order field, by mpmath with 40 digits."""
    equations = equations_of(name)
    system = equations.system
    variables = (*system.q, *system.v, *system.u)
    field = sp.lambdify(
        variables, list(equations.first_order.xreplace(system.values)), modules="mpmath"
    )
    rest = [mp.mpf(sp.N(p.subs(system.values), 50)) for p in linearization.symbolic_position]
    rest += [mp.mpf(0)] * (len(variables) - len(rest))

    def entry(row: int, column: int) -> mp.mpf:
        def along(value: mp.mpf) -> mp.mpf:
            return field(*rest[:column], value, *rest[column + 1 :])[row]

        return mp.diff(along, rest[column])

    n = len(system.q)
    return mp.matrix(
        [[entry(row, column) for column in range(len(variables))] for row in range(2 * n)]
    )


@pytest.mark.parametrize(("name", "rest"), RESTS)
def test_linearization_is_the_derivative_of_the_first_order_field(name: str, rest: str) -> None:
    linearization = linearized(name, rest)
    n = len(linearization.symbolic_position)
    with mp.workdps(40):
        matrices = derivatives(name, linearization)
        for row in range(2 * n):
            for column in range(matrices.cols):
                exact = linearization.exact["A" if column < 2 * n else "B"]
                ours = exact[row, column if column < 2 * n else column - 2 * n]
                # mpmath's step is near the square root of 10^-40: its error near 10^-19.
                assert abs(matrices[row, column] - ours) <= mp.mpf(10) ** -18 * (1 + abs(ours))


def test_two_rests_of_the_pendulum_differ_in_the_sign_of_their_stiffness() -> None:
    down, up = (linearized("simple_pendulum", rest) for rest in ("hanging", "upright"))
    assert down.stiffness == -up.stiffness
    names = {c.name: c.symbol for c in built_in("simple_pendulum").constants}
    assert down.stiffness[0] == names["m"] * names["g"] * names["l"]
    assert down.arrays["A"][1, 0] == -9.81 / 0.75
    assert up.arrays["A"][1, 0] == 9.81 / 0.75


def test_searched_equilibrium_is_recognized() -> None:
    linearization = linearized("drum_pendulum", "upright")
    assert linearization.symbolic_position == (0, sp.pi)
    np.testing.assert_array_equal(linearization.position, [0.0, np.pi])


def test_searched_equilibrium_has_40_digits() -> None:
    """Compare with k x = m g of a mass that hangs on a spring."""
    weight = constant("w", 3.7, "N")
    base = oscillator(1.3, 0.9, 47.0)
    system = dataclasses.replace(
        base,
        V=base.V - weight * X.q,
        constants=(*base.constants, weight),
        equilibria=(Equilibrium("hanging", {X: 0.1}, True, "the spring stretched"),),
    )
    (position,) = linear(system).symbolic_position
    assert abs(position - sp.Rational(3.7) / 47) < sp.Float(10, 40) ** -40


# Modes and poles


def pair(first: float, second: float, coupling: float) -> System:
    """Declare two oscillators of mass 1.3 on springs, joined by a third."""
    y = Coordinate("y", "m", "another displacement")
    m, k1, k2, k3 = (
        constant("m", 1.3, "kg"),
        *(constant(f"k{i}", k, "N/m") for i, k in enumerate((first, second, coupling))),
    )
    force = Input("f", "N", "force", on={X: 1})
    return System(
        **declared(
            coordinates=(X, y),
            constants=(m, k1, k2, k3),
            inputs=(force,),
            T=m * X.v**2 / 2 + m * y.v**2 / 2,
            V=k1 * X.q**2 / 2 + k2 * y.q**2 / 2 + k3 * (X.q - y.q) ** 2 / 2,
            D=0,
            outputs=(Output("x", X.q, "m", "displacement"), Output("v", y.v, "m/s", "speed")),
            equilibria=(Equilibrium("rest", {X: 0, y: 0}, False, "relaxed"),),
            scenarios=(
                dataclasses.replace(
                    declared()["scenarios"][0], q={X: 0.1, y: 0}, v={X: 0, y: 0}, inputs={force: 0}
                ),
            ),
        )
    )


def test_repeated_roots_have_mass_orthogonal_shapes() -> None:
    linearization = linear(pair(20.0, 20.0, 0.0))
    first, second = modes(linearization)
    assert first.frequency == pytest.approx(np.sqrt(20 / 1.3), rel=4 * EPS)
    assert second.frequency == pytest.approx(first.frequency, rel=4 * EPS)
    mass = linearization.arrays["M"]
    assert abs(first.shape @ mass @ second.shape) <= 4 * EPS * mass[0, 0]
    assert [(p.multiplicity, p.damping) for p in poles(linearization)] == [(2, 0.0)]


def test_nearly_repeated_roots_stay_apart() -> None:
    linearization = linear(pair(20.0, 20.0 * (1 + 1e-9), 0.0))
    assert [p.multiplicity for p in poles(linearization)] == [1, 1]


def test_free_pair_has_a_rigid_body_mode() -> None:
    linearization = linearized("free_pair", "rest")
    first, second = modes(linearization)
    assert first.rigid
    np.testing.assert_allclose(first.shape, [1, 1], rtol=0, atol=16 * EPS)
    assert not second.rigid
    m1, m2, c, k = (constant.value for constant in built_in("free_pair").constants)
    reduced = m1 * m2 / (m1 + m2)
    assert second.frequency == pytest.approx(np.sqrt(k / reduced), rel=8 * EPS)
    # The centre of mass stays: m1 x1 + m2 x2 = 0.
    assert second.shape[0] / second.shape[1] == pytest.approx(-m2 / m1, rel=32 * EPS)
    zero, swinging = poles(linearization)
    assert (zero.value, zero.multiplicity, zero.frequency) == (0, 2, 0)
    assert np.isnan(zero.damping)
    assert swinging.frequency == pytest.approx(np.sqrt(k / reduced), rel=4 * EPS)
    assert swinging.damping == pytest.approx(c / (2 * np.sqrt(k * reduced)), rel=4 * EPS)


def test_weak_spring_to_the_ground_is_no_rigid_body_mode() -> None:
    # A frequency of 1e-5 of the other's: its square is 1e-10, well above rounding.
    soft = pair(2e-9, 2e-9, 20.0)
    assert not any(mode.rigid for mode in modes(linear(soft)))


@pytest.mark.parametrize(("m", "c", "k", "expected"), [
    (1.0, 4.0, 4.0, [(-2, 2, 1)]),  # critical
    (1.0, 4.0 * (1 + 4 * EPS), 4.0, [(-2, 1, 1), (-2, 1, 1)]),
    (2.0, 10.0, 8.0, [(-1, 1, 1), (-4, 1, 1)]),  # 2 s^2 + 10 s + 8 = 2 (s + 1)(s + 4)
    (1.0, -0.4, 4.0, [(0.2 + 3.96**0.5 * 1j, 1, -0.1)]),
])  # fmt: skip
def test_poles_of_an_oscillator_match_the_textbook(
    m: float, c: float, k: float, expected: list[tuple[complex, int, float]]
) -> None:
    actual = poles(linear(oscillator(m, c, k)))
    assert [pole.multiplicity for pole in actual] == [count for _, count, _ in expected]
    for pole, (value, _, damping) in zip(actual, expected, strict=True):
        assert pole.value == pytest.approx(value, rel=1e-7)
        assert pole.damping == pytest.approx(damping, rel=2 * EPS)


def test_upright_pendulum_grows_and_falls_at_the_same_rate() -> None:
    linearization = linearized("simple_pendulum", "upright")
    rate = np.sqrt(9.81 / 0.75)
    (mode,) = modes(linearization)
    assert mode.frequency == 0
    assert not mode.rigid
    assert mode.growth == pytest.approx(rate, rel=4 * EPS)
    assert [p.value for p in poles(linearization)] == pytest.approx([-rate, rate], rel=2 * EPS)


@pytest.mark.parametrize(("name", "rest"), RESTS)
def test_modes_satisfy_their_equation(name: str, rest: str) -> None:
    linearization = linearized(name, rest)
    mass, stiffness = linearization.arrays["M"], linearization.arrays["K"]
    for mode in modes(linearization):
        squared = mode.frequency**2 - mode.growth**2
        residual = stiffness @ mode.shape - squared * (mass @ mode.shape)
        # Backward error of dsygvd: some eps of the largest entry, the pencil's condition above 1.
        assert np.max(np.abs(residual)) <= 100 * EPS * max(np.max(np.abs(stiffness)), 1e-300)


@pytest.mark.parametrize(("name", "rest"), RESTS)
def test_complex_shapes_are_eigenvectors(name: str, rest: str) -> None:
    linearization = linearized(name, rest)
    m, c, k = (linearization.arrays[x] for x in "MCK")
    values = {complex(p.value) for p in poles(linearization) if p.value.imag > 0}
    shapes = damped_shapes(linearization)
    assert len(shapes) == len(values)
    for value, shape in shapes:
        assert min(abs(value - other) for other in values) <= 100 * EPS * abs(value)
        residual = (m * value**2 + c * value + k) @ shape
        assert np.max(np.abs(residual)) <= 200 * EPS * np.max(np.abs(k))
        assert np.max(np.abs(shape)) == pytest.approx(1, abs=2 * EPS)


# Transfer functions


@pytest.mark.parametrize(
    ("name", "rest"),
    [pytest.param(*one, marks=pytest.mark.slow) if one[0] == CART.name else one for one in RESTS],
)
def test_transfer_functions_match_the_state_space(name: str, rest: str) -> None:
    linearization = linearized(name, rest)
    a, b, cy, d = (linearization.exact[x] for x in ("A", "B", "Cy", "D"))
    frequencies = np.array([0.3, 2.1, 4.4, 17.0])
    functions = transfer_functions(linearization)
    values = evaluate_transfer(equations_of(name).system, functions, frequencies)
    assert values.shape == (4, cy.rows, b.cols)
    for w, numbers in zip(frequencies, values, strict=True):
        exact = cy * mp.inverse(mp.mpc(0, w) * mp.eye(a.rows) - a) * b + d
        theirs = np.array(exact.tolist(), dtype=complex)
        # Two polynomials of degree 2 n at most, each a few eps; they cancel near a resonance, to
        # a hundredth here.
        assert np.max(np.abs(numbers - theirs)) <= 500 * EPS * np.max(np.abs(theirs))


def test_repeated_poles_have_a_complex_shape_each() -> None:
    (first, a), (second, b) = damped_shapes(linear(pair(20.0, 20.0, 0.0)))
    assert first == second
    assert abs(np.linalg.det(np.column_stack([a, b]))) > 0.5


def test_output_that_sees_a_velocity_brings_an_s() -> None:
    system = pair(20.0, 20.0, 3.0)
    functions = transfer_functions(linear(system))
    m, k1, k2, k3 = (c.symbol for c in system.constants)
    first, second = m * s**2 + k1 + k3, m * s**2 + k2 + k3
    assert sp.simplify(functions[1, 0] - s * k3 / (first * second - k3**2)) == 0


def test_system_without_inputs_is_linearized() -> None:
    linearization = linear(pendulum(0.1, 0.0, 1.0))
    assert linearization.arrays["B"].shape == (2, 0)
    assert transfer_functions(linearization).shape == (1, 0)


# Taylor series (Eq. 3.1)

x, y = sp.symbols("x y", real=True)


@pytest.mark.parametrize("order", [1, 2, 3, 5])
def test_error_of_a_taylor_series_falls_with_the_next_power(order: int) -> None:
    """Check that half the step divides the error by 2^(order + 1), up to the next term."""
    function = sp.exp(x) * sp.cos(y + x) + x * y**2
    point = {x: sp.Rational(1, 3), y: sp.Rational(-1, 5)}
    polynomial = taylor(function, point, order)

    def error(step: sp.Rational) -> sp.Expr:
        place = {x: point[x] + step, y: point[y] + step * 3 / 4}
        return abs(sp.N((function - polynomial).subs(place), 40))

    observed = sp.log(error(sp.Rational(1, 1000)) / error(sp.Rational(1, 2000)), 2)
    # The next term but one is a thousandth of the next, times the ratio of two derivatives.
    assert abs(observed - (order + 1)) < 0.01


def errors_of(name: str) -> tuple[LinearityError, ...]:
    equations = equations_of(name)
    return linearity(equations, linearize(equations, equations.system.equilibria[0]))


def test_error_of_the_linear_pendulum_matches_elliptic_functions() -> None:
    (table,) = errors_of("simple_pendulum")
    w = mp.sqrt(mp.mpf(9.81) / mp.mpf(0.75))
    assert table.period == pytest.approx(float(2 * mp.pi / w), rel=1e-15)
    for amplitude, error in zip(table.amplitudes, table.errors, strict=True):
        k = mp.sin(mp.mpf(amplitude) / 2)
        quarter = mp.ellipk(k**2)
        exact = max(
            abs(
                amplitude * mp.cos(phase)
                - 2 * mp.asin(k * mp.ellipfun("sn", phase + quarter, m=k**2))
            )
            for phase in (mp.mpf(2) * mp.pi * i / 100 for i in range(101))
        )
        # Integrated to 1e-10 of the amplitude a step, and an error is relative to the amplitude.
        assert error == pytest.approx(float(exact) / amplitude, rel=1e-5, abs=1e-8)


@pytest.mark.parametrize("name", ["simple_pendulum", "drum_pendulum"])
def test_error_falls_with_the_square_of_the_amplitude(name: str) -> None:
    for table in errors_of(name):
        small = [(a, e) for a, e in zip(table.amplitudes, table.errors, strict=True) if a <= 0.05]
        slope = np.diff(np.log([e for _, e in small])) / np.diff(np.log([a for a, _ in small]))
        # The next order adds about a^2 of the error, at most 0.0025.
        assert np.all(np.abs(slope - 2) < 0.01)


@pytest.mark.parametrize("name", sorted(LINEAR))
def test_linear_equations_have_no_such_error(name: str) -> None:
    assert errors_of(name) == ()


@pytest.mark.parametrize("name", ["simple_pendulum", "drum_pendulum"])
def test_unstable_equilibrium_has_no_such_table(name: str) -> None:
    equations = equations_of(name)
    (upright,) = (e for e in built_in(name).equilibria if e.name == "upright")
    assert linearity(equations, linearize(equations, upright)) == ()


def test_each_mode_of_the_drum_has_a_table() -> None:
    first, second = errors_of("drum_pendulum")
    assert (first.mode, second.mode) == (0, 1)
    assert first.amplitudes == (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 1.5, 2.0, 2.5)
    assert second.period < first.period
