"""The derivation against three independent ones: Newton, Kane and heyoka."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics import mechanics as me

from physics_crosscheck import System
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.mechanism.numeric import Array
from tests.reference.mechanisms import CART, EPS, NAMES, built_in, equations_of, oscillator

EVERY = [*NAMES, CART.name]


def symbols(system: System) -> dict[str, sp.Symbol]:
    """Return the symbols of a system by name: constants, inputs, q, v, a."""
    result = {c.name: c.symbol for c in system.constants} | {
        i.name: i.symbol for i in system.inputs
    }
    for c in system.coordinates:
        result |= {c.name: c.q, f"{c.name}'": c.v, f"{c.name}''": c.a}
    return result


# Newton's second law, where the source gives it (Eq. 2.4, 2.7, 3.5): m a = sum of the forces.

NEWTON = {
    "mass_spring_damper": lambda n: (
        n["m"] * n["x''"] - (n["f"] - n["k"] * n["x"] - n["c"] * n["x'"])
    ),
    "torsional_disc": lambda n: n["J"] * n["theta''"] - (n["T"] - n["k_theta"] * n["theta"]),
    "simple_pendulum": lambda n: (
        n["m"] * n["l"] ** 2 * n["theta''"]
        - (n["tau"] - n["m"] * n["g"] * n["l"] * sp.sin(n["theta"]))
    ),
}


@pytest.mark.parametrize("name", NEWTON)
def test_newtons_second_law_gives_the_same_equation(name: str) -> None:
    system = built_in(name)
    assert sp.simplify(equations_of(name).residual[0] - NEWTON[name](symbols(system))) == 0


# Kane's method, from bodies, points and forces, without energies; heyoka has the other systems.


class Mechanism:
    """A planar mechanism, y up, assembled from bodies and loads."""

    def __init__(self, system: System) -> None:
        self.system = system
        self.value = symbols(system)
        names = [c.name for c in system.coordinates]
        self.q = dict(zip(names, me.dynamicsymbols([f"q_{n}" for n in names]), strict=True))
        self.u = dict(zip(names, me.dynamicsymbols([f"u_{n}" for n in names]), strict=True))
        self.space = me.ReferenceFrame("N")
        self.origin = me.Point("O")
        self.origin.set_vel(self.space, 0)
        self.bodies: list[me.Particle | me.RigidBody] = []
        self.loads: list[tuple[me.Point | me.ReferenceFrame, me.Vector]] = []

    def point(
        self, name: str, start: me.Point, vector: me.Vector, velocity: me.Vector | None = None
    ) -> me.Point:
        point = start.locatenew(name, vector)
        rates = {sp.diff(self.q[n], me.dynamicsymbols._t): self.u[n] for n in self.q}
        speed = point.pos_from(self.origin).dt(self.space).subs(rates)
        point.set_vel(self.space, speed if velocity is None else velocity)
        return point

    def frame(self, name: str, angle: sp.Expr, rate: sp.Expr) -> me.ReferenceFrame:
        """Return a frame turned by an angle about z, counterclockwise."""
        frame = self.space.orientnew(name, "Axis", (angle, self.space.z))
        frame.set_ang_vel(self.space, rate * self.space.z)
        return frame

    def particle(self, point: me.Point, mass: sp.Expr) -> None:
        self.bodies.append(me.Particle(f"P{len(self.bodies)}", point, mass))

    def body(
        self, point: me.Point, frame: me.ReferenceFrame, mass: sp.Expr, inertia: sp.Expr
    ) -> None:
        moment = me.inertia(frame, 0, 0, inertia)
        name = f"B{len(self.bodies)}"
        self.bodies.append(me.RigidBody(name, point, frame, mass, (moment, point)))

    def matrices(self) -> tuple[sp.Matrix, sp.Matrix]:
        """Return M and f of M a = f, in the symbols of the system."""
        time = me.dynamicsymbols._t
        rates = [sp.diff(self.q[n], time) - self.u[n] for n in self.q]
        method = me.KanesMethod(
            self.space, q_ind=list(self.q.values()), u_ind=list(self.u.values()), kd_eqs=rates
        )
        method.kanes_equations(self.bodies, self.loads)
        back = {self.u[c.name]: c.v for c in self.system.coordinates}
        back |= {self.q[c.name]: c.q for c in self.system.coordinates}
        return method.mass_matrix.xreplace(back), method.forcing.xreplace(back)


def kane_drum_pendulum(p: Mechanism) -> None:
    v, x, theta = p.value, p.q["x"], p.q["theta"]
    centre = p.point("C", p.origin, x * p.space.x)
    # Rolling to the right turns the drum clockwise, with the contact point at rest.
    drum = p.frame("D", -x / v["r"], -p.u["x"] / v["r"])
    p.body(centre, drum, v["M"], v["M"] * v["r"] ** 2 / 2)
    rod = p.frame("R", theta, p.u["theta"])
    middle = p.point("G", centre, -v["l"] / 2 * rod.y)
    p.body(middle, rod, v["m"], v["m"] * v["l"] ** 2 / 12)
    p.loads += [
        (centre, (v["F"] - v["k"] * x) * p.space.x),
        (middle, -v["m"] * v["g"] * p.space.y),
        (centre, -v["M"] * v["g"] * p.space.y),
        (rod, v["tau"] * p.space.z),
    ]


def kane_cart(p: Mechanism) -> None:
    v, q, u = p.value, p.q, p.u
    cart = p.point("A", p.origin, q["x"] * p.space.x)
    first = p.frame("R", q["alpha"], u["alpha"])
    second = p.frame("S", q["beta"], u["beta"])
    upper = p.point("B", cart, -v["l1"] * first.y)
    lower = p.point("C", upper, -v["l2"] * second.y)
    for point, mass in ((cart, "m0"), (upper, "m1"), (lower, "m2")):
        p.particle(point, v[mass])
        p.loads.append((point, -v[mass] * v["g"] * p.space.y))
    joint = v["tau"] - v["c2"] * (u["beta"] - u["alpha"])  # on the second rod, back on the first
    p.loads += [
        (cart, (v["F"] - v["k"] * q["x"] - v["c0"] * u["x"]) * p.space.x),
        (first, (-v["c1"] * u["alpha"] - joint) * p.space.z),
        (second, joint * p.space.z),
    ]


KANE = {"drum_pendulum": kane_drum_pendulum, CART.name: kane_cart}


def kane_matches(name: str, assemble: Callable[[Mechanism], None]) -> bool:
    """Return whether M and f of Kane's equations equal the derived ones symbolically."""
    derived = equations_of(name)
    mechanism = Mechanism(derived.system)
    assemble(mechanism)
    mass, force = mechanism.matrices()
    gaps = [*(mass - derived.mass), *(force - derived.force)]
    return all(sp.simplify(sp.expand(gap)) == 0 for gap in gaps)


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow) if n == CART.name else n for n in KANE]
)
def test_kanes_method_gives_the_same_equations(name: str) -> None:
    assert kane_matches(name, KANE[name])


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
