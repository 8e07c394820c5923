"""Example 2.3: two masses joined by a spring and a damper, free to drift."""

from sympy import Heaviside, Rational, cos, eye, sin

from physics_crosscheck import (
    Constant, Coordinate, Equilibrium, Input, Output, Pose,
    PublishedEquation, Scenario, System, t,
)  # fmt: skip
from physics_crosscheck.sketch import Body, Link

x1 = Coordinate("x1", "m", "displacement of the pushed mass")
x2 = Coordinate("x2", "m", "displacement of the other mass, the spring relaxed at x1 = x2")

CHOSEN = "chosen: unequal masses, lightly damped, about 1.5 cycles a second"
m1 = Constant("m1", 1.1, "kg", "mass that the force acts on", CHOSEN)
m2 = Constant("m2", 0.7, "kg", "mass that follows", CHOSEN)
c = Constant("c", 0.35, "N*s/m", "viscous damping between the masses", CHOSEN)
k = Constant("k", 38.0, "N/m", "stiffness of the spring between the masses", CHOSEN)

f = Input("f", "N", "force on the first mass", on={x1: 1})

system = System(
    name="free_pair",
    title="Free pair of masses",
    source="Example 2.3, Eq. 2.10-2.25",
    coordinates=(x1, x2),
    constants=(m1, m2, c, k),
    inputs=(f,),
    outputs=(
        Output("x1", x1.q, "m", "displacement of the first mass"),
        Output("x2", x2.q, "m", "displacement of the second mass"),
    ),
    T=m1 * x1.v**2 / 2 + m2 * x2.v**2 / 2,
    V=k * (x1.q - x2.q) ** 2 / 2,
    D=c * (x1.v - x2.v) ** 2 / 2,
    equilibria=(
        Equilibrium("rest", at={x1: 0, x2: 0}, search=False,
                    description="spring relaxed; one of a line of equilibria"),
    ),
    scenarios=(
        Scenario("free", "the spring stretched, then let go", q={x1: 0.2, x2: -0.1},
                 v={x1: 0, x2: 0.3}, inputs={f: 0}, duration=12.5),
        Scenario("drift", "braked with 1.2 N for 2 s, then turned back: the rigid-body mode drifts",
                 q={x1: 0, x2: 0}, v={x1: -1.0, x2: -1.0}, inputs={f: 1.2 * (1 - Heaviside(t - 2))},
                 duration=10.0),
        Scenario("driven", "driven near the relative mode, about a standing start",
                 q={x1: 0.02, x2: 0}, v={x1: -0.25, x2: 0}, inputs={f: 2 * sin(9 * t) - cos(3 * t)},
                 duration=10.0),
    ),
    published=(
        PublishedEquation("2.3", "d/dt(dL/dq') ± dL/dq + dD/dq' = Q",
                          "motion", of="", driven=True, note="of every coordinate q"),
        PublishedEquation("2.10", "T = m1*x1'^2/2 + m2*x2'^2/2",
                          "value", of="", driven=False, note=""),
        PublishedEquation("2.11", "V = k*(x1 ± x2)^2/2", "value", of="", driven=False, note=""),
        PublishedEquation("2.12", "L = m1*x1'^2/2 + m2*x2'^2/2 ± k*(x1 ± x2)^2/2",
                          "value", of="", driven=False, note=""),
        PublishedEquation("2.13", "D = c*(x1' ± x2')^2/2", "value", of="", driven=False, note=""),
        PublishedEquation("2.14", "d/dt(dL/dx1') ± dL/dx1 + dD/dx1' = Q_1, Q_1 = f",
                          "motion", of="x1", driven=True, note=""),
        PublishedEquation("2.15", "d/dt(dL/dx2') ± dL/dx2 + dD/dx2' = Q_2, Q_2 = 0",
                          "motion", of="x2", driven=False, note=""),
        PublishedEquation("2.16", "dL/dx1' = m1*x1'", "value", of="", driven=False, note=""),
        PublishedEquation("2.17", "dL/dx2' = m2*x2'", "value", of="", driven=False, note=""),
        PublishedEquation("2.18", "d/dt(dL/dx1') = m1*x1''", "value", of="", driven=False, note=""),
        PublishedEquation("2.19", "d/dt(dL/dx2') = m2*x2''", "value", of="", driven=False, note=""),
        PublishedEquation("2.20", "dL/dx1 = ± k*(x1 ± x2)", "value", of="", driven=False, note=""),
        PublishedEquation("2.21", "dL/dx2 = ± k*(x1 ± x2)", "value", of="", driven=False, note=""),
        PublishedEquation("2.22", "dD/dx1' = ± c*(x1' ± x2')",
                          "value", of="", driven=False, note=""),
        PublishedEquation("2.23", "dD/dx2' = ± c*(x1' ± x2')",
                          "value", of="", driven=False, note=""),
        PublishedEquation("2.24", "m1*x1'' + c*x1' + k*x1 ± c*x2' ± k*x2 = f",
                          "motion", of="x1", driven=True, note=""),
        PublishedEquation("2.25", "m2*x2'' + c*x2' + k*x2 ± c*x1' ± k*x2 = 0",
                          "motion", of="x2", driven=False,
                          note="ends in k x2 twice, where k x1 belongs once"),
    ),
    # The world: x along the motion, z up, the origin where the first mass rests.
    frames=(
        Pose("first", (x1.q, 0, 0), "the first mass", eye(3)),
        Pose("second", (x2.q + Rational(3, 2), 0, 0), "the second mass, 1.5 m on", eye(3)),
    ),
    sketch=(
        Link("spring", (x1.q + 0.15, 0.15), (x2.q + 0.85, 0.15), "k"),
        Link("damper", (x1.q + 0.15, 0), (x2.q + 0.85, 0), "c"),
        Body("block", (x1.q, 0), 0.3, 0.5, label="m1"),
        Body("block", (x2.q + 1, 0), 0.3, 0.5, label="m2"),
        Link("line", (0, 0.25), (0, 0.43)),
        Link("measure", (0, 0.38), (x1.q, 0.38), "x1"),
        Link("line", (1, 0.25), (1, 0.43)),
        Link("measure", (1, 0.38), (x2.q + 1, 0.38), "x2"),
        Link("wall", (-0.5, -0.25), (1.5, -0.25)),
    ),
)  # fmt: skip
