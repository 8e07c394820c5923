"""Example 2.5: a drum on a spring rolls without slipping; a rod swings from its centre."""

from sympy import Heaviside, Symbol, cos, expand, integrate, pi, sin

from physics_crosscheck import (
    Constant, Coordinate, Equilibrium, Input, Output, Pose,
    PublishedEquation, Quantity, Scenario, System, rotation, t,
)  # fmt: skip
from physics_crosscheck.sketch import Angle, Body, Link

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

# What the source finds step by step, here from the bodies themselves: the rings of the drum, which
# move with its centre and turn; the points of the rod, each s from the drum's centre.
rho, s = Symbol("rho", positive=True), Symbol("s", positive=True)
ring_energy = 2 * M * rho / r**2 * (x.v**2 + (rho * x.v / r) ** 2) / 2
drum_energy = integrate(expand(ring_energy), (rho, 0, r))
point_x, point_y = x.q + s * sin(theta.q), -s * cos(theta.q)


def along_rod(expression):
    return integrate(expand(expression / l), (s, 0, l))


def rate(place):
    return place.diff(x.q) * x.v + place.diff(theta.q) * theta.v


rod_energy = along_rod(m * (rate(point_x) ** 2 + rate(point_y) ** 2) / 2)

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
    published=(
        PublishedEquation("2.2", "d/dt(dL/dq') ± dL/dq = Q, L = T ± V",
                          "motion", of="", driven=True, note="of every coordinate q; Q is F, tau"),
        PublishedEquation("2.34", "T_M = M*v^2/2 + J_M*omega^2/2, v = x', omega = v/r,"
                          " J_M = M*r^2/2", "value", of="", driven=False, note=""),
        PublishedEquation("2.35", "T_M = M*x'^2/2 + (1/2)*(M*r^2/2)*(x'/r)^2 = 3*M*x'^2/4",
                          "value", of="", driven=False, note=""),
        PublishedEquation("2.36", "x_G = x + (l/2)*sin(theta)",
                          "value", of="", driven=False, note=""),
        PublishedEquation("2.37", "y_G = ± (l/2)*cos(theta)",
                          "value", of="", driven=False, note=""),
        PublishedEquation("2.38", "v_x = x' + (l/2)*theta'*cos(theta)",
                          "value", of="", driven=False, note=""),
        PublishedEquation("2.39", "v_y = (l/2)*theta'*sin(theta)",
                          "value", of="", driven=False, note=""),
        PublishedEquation("2.40", "T_m = m*v_m^2/2 + J_m*theta'^2/2, v_m^2 = v_x^2 + v_y^2,"
                          " J_m = m*l^2/12", "value", of="", driven=False, note=""),
        PublishedEquation("2.41", "T_m = m*x'^2/2 + m*x'*l*theta'*cos(theta)/2 + m*l^2*theta'^2/6",
                          "value", of="", driven=False, note=""),
        PublishedEquation("2.42", "T = 3*M*x'^2/4 + m*x'^2/2 + m*x'*l*theta'*cos(theta)/2"
                          " + m*l^2*theta'^2/6", "value", of="", driven=False, note=""),
        PublishedEquation("2.43", "V = k*x^2/2 + m*g*(± l/2)*cos(theta)",
                          "value", of="", driven=False, note=""),
        PublishedEquation("2.44", "L = 3*M*x'^2/4 + m*x'^2/2 + m*x'*l*theta'*cos(theta)/2"
                          " + m*l^2*theta'^2/6 ± k*x^2/2 + m*g*l*cos(theta)/2",
                          "value", of="", driven=False, note=""),
        PublishedEquation("2.45", "d/dt(dL/dx') ± dL/dx = 0",
                          "motion", of="x", driven=False, note=""),
        PublishedEquation("2.46", "d/dt(dL/dtheta') ± dL/dtheta = 0",
                          "motion", of="theta", driven=False, note=""),
        PublishedEquation("2.47", "(3/2)*M*x'' + m*x'' ± (m*l/2)*sin(theta)*theta'^2"
                          " + (m*l/2)*cos(theta)*theta'' + k*x = 0",
                          "motion", of="x", driven=False, note=""),
        PublishedEquation("2.48", "(m*l/2)*x''*cos(theta) + (m*l^2/3)*theta''"
                          " + (m*g*l/2)*sin(theta) = 0",
                          "motion", of="theta", driven=False, note=""),
        PublishedEquation("3.13", "(3*M/2 + m)*x'' + (m*l/2)*theta'' + k*x = 0",
                          "linear", of="hanging", driven=False, note=""),
        PublishedEquation("3.14", "x'' + (2/3)*l*theta'' + g*theta = 0",
                          "linear", of="hanging", driven=False, note=""),
    ),
    quantities=(
        Quantity("T_M", drum_energy, "J", "kinetic energy of the drum, over its rings"),
        Quantity("x_G", along_rod(point_x), "m", "the rod's centre, over its points"),
        Quantity("y_G", along_rod(point_y), "m", "height of the rod's centre, over its points"),
        Quantity("v_x", rate(along_rod(point_x)), "m/s", "velocity of the rod's centre along x"),
        Quantity("v_y", rate(along_rod(point_y)), "m/s", "velocity of the rod's centre upward"),
        Quantity("T_m", rod_energy, "J", "kinetic energy of the rod, over its points"),
    ),
    # The world: x along the track, z up, the origin where the drum rests.
    frames=(
        Pose("drum", (x.q, 0, 0), "centre of the drum"),
        Pose("rod", (x.q + l / 2 * sin(theta.q), 0, -l / 2 * cos(theta.q)), "the rod's centre",
             rotation((0, -1, 0), theta.q)),
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
