"""Example 2.1: a mass on a spring and a damper, driven by a force."""

from sympy import Heaviside, Rational, eye, sin

from physics_crosscheck import (
    Constant, Coordinate, Equilibrium, Input, Output, Pose,
    PublishedEquation, Quantity, Scenario, System, t,
)  # fmt: skip
from physics_crosscheck.sketch import Body, Link

x = Coordinate("x", "m", "displacement of the mass from the spring's equilibrium")

CHOSEN = "chosen: underdamped, one cycle a second"
m = Constant("m", 1.3, "kg", "mass", CHOSEN)
c = Constant("c", 0.9, "N*s/m", "viscous damping coefficient", CHOSEN)
k = Constant("k", 47.0, "N/m", "spring stiffness", CHOSEN)

f = Input("f", "N", "force on the mass, along x", on={x: 1})

system = System(
    name="mass_spring_damper",
    title="Mass, spring and damper",
    source="Example 2.1, Eq. 2.4-2.6",
    coordinates=(x,),
    constants=(m, c, k),
    inputs=(f,),
    outputs=(Output("x", x.q, "m", "displacement"),),
    T=m * x.v**2 / 2,
    V=k * x.q**2 / 2,
    D=c * x.v**2 / 2,
    equilibria=(Equilibrium("rest", at={x: 0}, search=False, description="spring relaxed"),),
    scenarios=(
        Scenario("free", "released off rest, moving", q={x: 0.25}, v={x: -0.4}, inputs={f: 0},
                 duration=14.5),
        Scenario("step", "a force of 6 N from 1.3 s on", q={x: 0}, v={x: 0},
                 inputs={f: 6 * Heaviside(t - Rational(13, 10))}, duration=16.0),
        Scenario("resonance", "driven close to its natural frequency", q={x: 0.02}, v={x: 0},
                 inputs={f: 1.5 * sin(5.9 * t)}, duration=14.5),
    ),
    published=(
        PublishedEquation("2.1", "F = m*a",
                          "motion", of="x", driven=True, note="Newton's law, here of this mass"),
        PublishedEquation("2.4", "F = m*a", "motion", of="x", driven=True, note=""),
        PublishedEquation("2.5", "f ± k*x ± c*x' = m*x''", "motion", of="x", driven=True, note=""),
        PublishedEquation("2.6", "m*x'' + c*x' + k*x = f", "motion", of="x", driven=True, note=""),
    ),
    quantities=(
        Quantity("F", f - k * x.q - c * x.v, "N", "all forces on the mass, cut free"),
        Quantity("a", x.a, "m/s^2", "acceleration of the mass"),
    ),
    # The world: x along the motion, z up, the origin where the mass rests.
    frames=(Pose("mass", (x.q, 0, 0), "the mass", eye(3)),),
    sketch=(
        Link("wall", (-0.9, 0.3), (-0.9, -0.3)),
        Link("spring", (-0.9, 0.1), (x.q - 0.2, 0.1), "k"),
        Link("damper", (-0.9, -0.1), (x.q - 0.2, -0.1), "c"),
        Body("block", (x.q, 0), 0.4, 0.4, label="m"),
        Link("line", (0, 0.2), (0, 0.42)),
        Link("measure", (0, 0.36), (x.q, 0.36), "x"),
    ),
)  # fmt: skip
