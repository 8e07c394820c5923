"""Systems that the tests of the reference share: the built-in ones, and small ones."""

from functools import cache
from pathlib import Path
from typing import Any

import sympy as sp
from sympy import cos

from physics_crosscheck import Constant, Coordinate, Equilibrium, Input, Output, Scenario, System
from physics_crosscheck.reference.dynamics.derive import Equations, derive
from physics_crosscheck.reference.load import load_system
from physics_crosscheck.reference.solving.segments import Motion
from physics_crosscheck.reference.solving.solve import solve

MODELS = Path(__file__).parents[2] / "models"
NAMES = sorted(path.parent.name for path in MODELS.glob("*/system.py"))
LINEAR = {"anchored_pair", "free_pair", "mass_spring_damper", "torsional_disc"}
"""Listed, not derived, to keep collection fast; test_integration.py checks the list."""
EPS = 2.0**-52


@cache
def built_in(name: str) -> System:
    """Return the built-in system of that name, loaded once."""
    return load_system(MODELS / name)


SCENARIOS = [(name, scenario.name) for name in NAMES for scenario in built_in(name).scenarios]


@cache
def equations_of(name: str) -> Equations:
    """Return a system's equations, derived once; the cart with double pendulum is included."""
    return derive(CART if name == CART.name else built_in(name))


@cache
def motion_of(name: str, scenario: str) -> Motion:
    """Return a motion, solved once."""
    equations = equations_of(name)
    return solve(equations, equations.system.scenario(scenario))


def constant(name: str, value: float, unit: str) -> Constant:
    return Constant(name, value, unit, f"{name} of a test", "chosen for the test")


X = Coordinate("x", "m", "displacement")
M = constant("m", 1.3, "kg")
K = constant("k", 47.0, "N/m")
C = constant("c", 0.9, "N*s/m")
F = Input("f", "N", "force", on={X: 1})


def declared(**changed: Any) -> dict[str, Any]:
    """Return the fields of a small, valid system, with some of them replaced."""
    fields: dict[str, Any] = {
        "name": "oscillator",
        "title": "Mass, spring and damper",
        "source": "a test",
        "coordinates": (X,),
        "constants": (M, C, K),
        "inputs": (F,),
        "outputs": (Output("x", X.q, "m", "displacement"),),
        "T": M * X.v**2 / 2,
        "V": K * X.q**2 / 2,
        "D": C * X.v**2 / 2,
        "equilibria": (Equilibrium("rest", {X: 0}, False, "relaxed"),),
        "scenarios": (
            Scenario("free", "released", q={X: 0.1}, v={X: 0}, inputs={F: 0}, duration=10.0),
        ),
        "published": (),
    }
    return fields | changed


def oscillator(
    m: float,
    c: float,
    k: float,
    force: sp.Expr | float = 0,
    x: float = 0.3,
    v: float = -0.2,
    duration: float = 6.0,
) -> System:
    """Declare m x'' + c x' + k x = force(t), with one scenario."""
    constants = (constant("m", m, "kg"), constant("c", c, "N*s/m"), constant("k", k, "N/m"))
    mass, damping, stiffness = constants
    return System(
        **declared(
            constants=constants,
            T=mass * X.v**2 / 2,
            V=stiffness * X.q**2 / 2,
            D=damping * X.v**2 / 2,
            scenarios=(
                Scenario(
                    "only", "of a test", q={X: x}, v={X: v}, inputs={F: force}, duration=duration
                ),
            ),
        )
    )


def pendulum(
    angle: sp.Expr | float,
    speed: float,
    duration: float,
    g: float = 9.81,
    l: float = 1.0,  # noqa: E741
) -> System:
    """Declare a free simple pendulum of 1 kg, with one scenario."""
    theta = Coordinate("theta", "rad", "angle from the vertical")
    m = constant("m", 1.0, "kg")
    length, gravity = constant("l", l, "m"), constant("g", g, "m/s^2")
    return System(
        name="pendulum",
        title="Simple pendulum",
        source="a test",
        coordinates=(theta,),
        constants=(m, length, gravity),
        inputs=(),
        outputs=(Output("theta", theta.q, "rad", "angle"),),
        T=m * length**2 * theta.v**2 / 2,
        V=-m * gravity * length * cos(theta.q),
        D=0,
        equilibria=(Equilibrium("hanging", {theta: 0}, False, "down"),),
        scenarios=(
            Scenario(
                "only",
                "of a test",
                q={theta: angle},
                v={theta: speed},
                inputs={},
                duration=duration,
            ),
        ),
        published=(),
    )


def cart_with_double_pendulum() -> System:
    """Declare three coordinates, a full mass matrix, and a damper in every joint."""
    x = Coordinate("x", "m", "displacement of the cart")
    a = Coordinate("alpha", "rad", "angle of the first rod from the vertical")
    b = Coordinate("beta", "rad", "angle of the second rod from the vertical")
    m0, m1, m2 = (constant(f"m{i}", v, "kg") for i, v in enumerate((1.7, 0.6, 0.4)))
    l1, l2 = constant("l1", 0.5, "m"), constant("l2", 0.35, "m")
    g, k = constant("g", 9.81, "m/s^2"), constant("k", 21.0, "N/m")
    c0 = constant("c0", 0.8, "N*s/m")
    c1, c2 = constant("c1", 0.05, "N*m*s/rad"), constant("c2", 0.03, "N*m*s/rad")
    force = Input("F", "N", "force on the cart", on={x: 1})
    torque = Input("tau", "N*m", "torque between the rods", on={a: -1, b: 1})
    first = x.v**2 + 2 * l1 * x.v * a.v * cos(a.q) + l1**2 * a.v**2
    second = (
        first
        + l2**2 * b.v**2
        + 2 * l2 * x.v * b.v * cos(b.q)
        + 2 * l1 * l2 * a.v * b.v * cos(a.q - b.q)
    )
    every = (x, a, b)
    return System(
        name="cart_with_double_pendulum",
        title="Cart with double pendulum",
        source="a test",
        coordinates=every,
        constants=(m0, m1, m2, l1, l2, g, k, c0, c1, c2),
        inputs=(force, torque),
        outputs=tuple(Output(c.name, c.q, c.unit, c.description) for c in every),
        T=m0 * x.v**2 / 2 + m1 * first / 2 + m2 * second / 2,
        V=k * x.q**2 / 2 - (m1 + m2) * g * l1 * cos(a.q) - m2 * g * l2 * cos(b.q),
        D=c0 * x.v**2 / 2 + c1 * a.v**2 / 2 + c2 * (b.v - a.v) ** 2 / 2,
        equilibria=(Equilibrium("hanging", dict.fromkeys(every, 0), False, "both rods down"),),
        scenarios=(
            Scenario(
                "free",
                "released",
                q={x: 0.1, a: 0.4, b: -0.3},
                v=dict.fromkeys(every, 0),
                inputs={force: 0, torque: 0},
                duration=5.0,
            ),
        ),
        published=(),
    )


CART = cart_with_double_pendulum()
