"""Example 2.5: a drum on a spring rolls without slipping; a rod swings from its centre."""

from sympy import Heaviside, cos, pi, sin

from reference import (
    Angle, Body, Constant, Coordinate, Equilibrium, Input, Link, Output,
    PublishedEquation, Scenario, System, t,
)  # fmt: skip

x = Coordinate("x", "m", "displacement of the drum's centre from the spring's equilibrium")
theta = Coordinate("theta", "rad", "angle of the rod from the vertical, positive toward +x")

CHOSEN = "chosen: both modes slower than a cycle a second and close together, so that they couple"
M = Constant("M", 2.4, "kg", "mass of the drum, a uniform cylinder", CHOSEN)
r = Constant(
    "r", 0.18, "m", "radius of the drum; it cancels from the equations (x = r phi)", CHOSEN
)
m = Constant("m", 0.8, "kg", "mass of the rod", CHOSEN)
l = Constant("l", 0.6, "m", "length of the uniform rod", CHOSEN)  # noqa: E741  # the source's name
k = Constant("k", 65.0, "N/m", "spring stiffness", CHOSEN)
g = Constant("g", 9.81, "m/s^2", "gravity", "rounded from the standard 9.80665 m/s^2")

F = Input("F", "N", "force on the drum's centre (Q of Eq. 2.2)", on={x: 1})
tau = Input("tau", "N*m", "torque on the rod, reacted by the ground (Q of Eq. 2.2)", on={theta: 1})

rolling = M * x.v**2 / 2 + (M * r**2 / 2) * (x.v / r) ** 2 / 2
rod = m * x.v**2 / 2 + m * l * x.v * theta.v * cos(theta.q) / 2 + m * l**2 * theta.v**2 / 6

system = System(
    name="drum_pendulum",
    title="Drum with pendulum",
    source="Example 2.5, Eq. 2.34-2.48; linearized 3.13-3.14",
    coordinates=(x, theta),
    constants=(M, r, m, l, k, g),
    inputs=(F, tau),
    outputs=(
        Output("x", x.q, "m", "displacement of the drum"),
        Output("theta", theta.q, "rad", "angle of the rod"),
    ),
    T=rolling + rod,
    V=k * x.q**2 / 2 - m * g * (l / 2) * cos(theta.q),
    D=0,
    equilibria=(
        Equilibrium("hanging", at={x: 0, theta: 0}, search=False, description="rod down"),
        Equilibrium("upright", at={x: 0.01, theta: 3.1}, search=True, description="rod up"),
    ),
    scenarios=(
        Scenario("free", "the rod released at 1 rad, the drum off its rest",
                 q={x: 0.1, theta: 1.0}, v={x: 0, theta: 0}, inputs={F: 0, tau: 0}, duration=18.0),
        Scenario("driven", "a step of force on the drum and a harmonic torque on the rod",
                 q={x: 0, theta: 0}, v={x: 0, theta: 0},
                 inputs={F: 7 * Heaviside(t - 1), tau: 0.5 * sin(4.2 * t)}, duration=18.0),
        Scenario("large", "the rod released at 2.9 rad", q={x: 0.05, theta: 2.9},
                 v={x: 0, theta: 0}, inputs={F: 0, tau: 0}, duration=18.0),
    ),
    printed=(
        PublishedEquation("2.34-2.48",
                "3*M*x'^2/4 + m*x'^2/2 + m*l*x'*theta'*cos(theta)/2 + m*l^2*theta'^2/6",
                "T", "", False,
                "number within the range not told"),
        PublishedEquation("2.34-2.48", "k*x^2/2 ± m*g*(l/2)*cos(theta)", "V", "", False,
                "number within the range not told; sign lost in the transcript"),
        PublishedEquation("2.34-2.48",
                "(3*M/2 + m)*x'' ± (m*l/2)*sin(theta)*theta'^2 + (m*l/2)*cos(theta)*theta''"
                " + k*x = 0", "motion", "x", False,
                "number within the range not told; sign lost in the transcript"),
        PublishedEquation("2.34-2.48",
                "(m*l/2)*cos(theta)*x'' + (m*l^2/3)*theta'' + (m*g*l/2)*sin(theta) = 0",
                "motion", "theta", False, "number within the range not told"),
        PublishedEquation("3.13", "(3*M/2 + m)*x'' + (m*l/2)*theta'' + k*x = 0", "linear",
                "hanging", False, ""),
        PublishedEquation("3.14", "x'' + (2*l/3)*theta'' + g*theta = 0", "linear",
                "hanging", False, ""),
    ),
    sketch=(
        Link("wall", (-0.8, -r), (0.8, -r)),
        Link("wall", (-0.8, r), (-0.8, -r)),
        Link("spring", (-0.8, 0), (x.q, 0), "k"),
        Body("disc", (x.q, 0), 2 * r, 2 * r, pi / 2 - x.q / r, "M"),
        Link("rod", (x.q, 0), (x.q + l * sin(theta.q), -l * cos(theta.q)), "m"),
        Link("line", (x.q, 0), (x.q, -l)),
        Angle((x.q, 0), l / 2, -pi / 2, theta.q - pi / 2, "theta"),
        Link("line", (0, r), (0, 2 * r)),
        Link("measure", (0, r * 1.6), (x.q, r * 1.6), "x"),
    ),
)  # fmt: skip
