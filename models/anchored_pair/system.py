"""Example 2.4: two masses, each on a spring of its own, joined by a damper."""

from sympy import Heaviside, Rational, eye, sin

from physics_crosscheck import (
    Constant, Coordinate, Equilibrium, Input, Output, Pose,
    PublishedEquation, Scenario, System, t,
)  # fmt: skip
from physics_crosscheck.sketch import Body, Link

x1 = Coordinate("x1", "m", "displacement of the first mass from its spring's equilibrium")
x2 = Coordinate("x2", "m", "displacement of the second mass from its spring's equilibrium")

CHOSEN = "chosen: modes within a factor of two, damping not proportional"
m1 = Constant("m1", 1.6, "kg", "mass on the first spring", CHOSEN)
m2 = Constant("m2", 0.9, "kg", "mass on the second spring", CHOSEN)
c = Constant("c", 1.1, "N*s/m", "viscous damping between the masses", CHOSEN)
k1 = Constant("k1", 55.0, "N/m", "stiffness of the first spring", CHOSEN)
k2 = Constant("k2", 70.0, "N/m", "stiffness of the second spring", CHOSEN)

f = Input("f", "N", "force on the second mass", on={x2: 1})

system = System(
    name="anchored_pair",
    title="Anchored pair of masses",
    source="Example 2.4, Eq. 2.26-2.33",
    coordinates=(x1, x2),
    constants=(m1, m2, c, k1, k2),
    inputs=(f,),
    outputs=(
        Output("x1", x1.q, "m", "displacement of the first mass"),
        Output("x2", x2.q, "m", "displacement of the second mass"),
    ),
    T=m1 * x1.v**2 / 2 + m2 * x2.v**2 / 2,
    V=k1 * x1.q**2 / 2 + k2 * x2.q**2 / 2,
    D=c * (x1.v - x2.v) ** 2 / 2,
    equilibria=(
        Equilibrium("rest", at={x1: 0, x2: 0}, search=False, description="both springs relaxed"),
    ),
    scenarios=(
        Scenario("free", "both masses pulled apart", q={x1: 0.15, x2: -0.2}, v={x1: 0.5, x2: 0},
                 inputs={f: 0}, duration=15.0),
        Scenario("step", "a force of 8 N from 0.9 s on", q={x1: 0, x2: 0}, v={x1: 0, x2: 0},
                 inputs={f: 8 * Heaviside(t - Rational(9, 10))}, duration=16.0),
        Scenario("near_mode", "driven near the second mode, on a slow ramp", q={x1: 0, x2: 0.05},
                 v={x1: 0, x2: 0}, inputs={f: 2 * sin(8.6 * t) + t / 2}, duration=15.0),
    ),
    published=(
        PublishedEquation("2.26", "T = m1*x1'^2/2 + m2*x2'^2/2",
                          "value", of="", driven=False, note=""),
        PublishedEquation("2.27", "V = k1*x1^2/2 + k2*x2^2/2",
                          "value", of="", driven=False, note=""),
        PublishedEquation("2.28", "L = m1*x1'^2/2 + m2*x2'^2/2 ± k1*x1^2/2 ± k2*x2^2/2",
                          "value", of="", driven=False, note=""),
        PublishedEquation("2.29", "D = c*(x1' ± x2')^2/2", "value", of="", driven=False, note=""),
        PublishedEquation("2.30", "d/dt(dL/dx1') ± dL/dx1 + dD/dx1' = Q_1, Q_1 = 0",
                          "motion", of="x1", driven=False, note=""),
        PublishedEquation("2.31", "d/dt(dL/dx2') ± dL/dx2 + dD/dx2' = Q_2, Q_2 = f",
                          "motion", of="x2", driven=True, note=""),
        PublishedEquation("2.32", "m1*x1'' + c*x1' + k1*x1 ± c*x2' = 0",
                          "motion", of="x1", driven=False, note=""),
        PublishedEquation("2.33", "m2*x2'' + c*x2' + k2*x2 ± c*x1' = f",
                          "motion", of="x2", driven=True, note=""),
    ),
    # The world: x along the motion, z up, the origin where the first mass rests.
    frames=(
        Pose("first", (x1.q, 0, 0), "the first mass", eye(3)),
        Pose("second", (x2.q + Rational(6, 5), 0, 0), "the second mass, 1.2 m on", eye(3)),
    ),
    sketch=(
        Link("wall", (-0.9, 0.25), (-0.9, -0.25)),
        Link("spring", (-0.9, 0), (x1.q - 0.15, 0), "k1"),
        Body("block", (x1.q, 0), 0.3, 0.3, label="m1"),
        Link("damper", (x1.q + 0.15, 0), (x2.q + 0.85, 0), "c"),
        Body("block", (x2.q + 1, 0), 0.3, 0.3, label="m2"),
        Link("spring", (x2.q + 1.15, 0), (1.9, 0), "k2"),
        Link("wall", (1.9, -0.25), (1.9, 0.25)),
        Link("line", (0, 0.15), (0, 0.33)),
        Link("measure", (0, 0.28), (x1.q, 0.28), "x1"),
        Link("line", (1, 0.15), (1, 0.33)),
        Link("measure", (1, 0.28), (x2.q + 1, 0.28), "x2"),
    ),
)  # fmt: skip
