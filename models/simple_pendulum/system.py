"""Example 3.1: a point mass on a massless rod."""

from sympy import Matrix, cos, pi, sin

from physics_crosscheck import (
    Constant, Coordinate, Equilibrium, Input, Output, Pose,
    PublishedEquation, Quantity, Scenario, System, t,
)  # fmt: skip
from physics_crosscheck.sketch import Angle, Body, Link

theta = Coordinate("theta", "rad", "angle from the vertical, positive toward +x")

CHOSEN = "chosen: a pendulum for a table top"
m = Constant("m", 0.45, "kg", "point mass", CHOSEN)
l = Constant("l", 0.75, "m", "length of the massless rod", CHOSEN)  # noqa: E741  # the source's name
g = Constant("g", 9.81, "m/s^2", "gravity", "rounded from the standard 9.80665 m/s^2")

tau = Input("tau", "N*m", "torque about the pivot", on={theta: 1})

T = m * l**2 * theta.v**2 / 2
V = -m * g * l * cos(theta.q)

# What the source finds step by step, from the place of the mass, the pivot at the origin.
place = Matrix([l * sin(theta.q), -l * cos(theta.q)])
velocity = place.diff(theta.q) * theta.v
acceleration = velocity.diff(theta.q) * theta.v + velocity.diff(theta.v) * theta.a
tangent = Matrix([cos(theta.q), sin(theta.q)])
normal = Matrix([-sin(theta.q), cos(theta.q)])
weight = Matrix([0, -m * g])

system = System(
    name="simple_pendulum",
    title="Simple pendulum",
    source="Example 3.1, Eq. 3.3-3.12",
    coordinates=(theta,),
    constants=(m, l, g),
    inputs=(tau,),
    outputs=(Output("theta", theta.q, "rad", "angle"),),
    T=T,
    V=V,
    D=0,
    equilibria=(
        Equilibrium("hanging", at={theta: 0}, search=False, description="mass below the pivot"),
        Equilibrium("upright", at={theta: pi}, search=False, description="mass above the pivot"),
    ),
    scenarios=(
        Scenario("free", "released at 1.1 rad", q={theta: 1.1}, v={theta: -0.3}, inputs={tau: 0},
                 duration=18.0),
        Scenario("driven", "a harmonic torque on top of a steady one", q={theta: 0.2},
                 v={theta: 0}, inputs={tau: 0.5 + 0.7 * sin(2.3 * t)}, duration=18.0),
        Scenario("large", "released at 2.9 rad", q={theta: 2.9}, v={theta: 0}, inputs={tau: 0},
                 duration=18.0),
        Scenario("chirp", "a torque whose frequency sweeps across the natural one",
                 q={theta: 0.1}, v={theta: 0}, inputs={tau: 0.6 * sin((2 + 0.15 * t) * t)},
                 duration=18.0),
    ),
    published=(
        PublishedEquation("3.2", "f(x) = f(x0) + f'(x0)*(x ± x0), x = theta, x0 = theta0",
                          "linear part", of="theta", driven=False,
                          note="of any f(x), here of this one"),
        PublishedEquation("3.3", "a_t = l*theta''", "value", of="", driven=False, note=""),
        PublishedEquation("3.4", "a_n = l*theta'^2", "value", of="", driven=False, note=""),
        PublishedEquation("3.5", "F_t = m*a_t", "motion", of="theta", driven=False, note=""),
        PublishedEquation("3.6", "± m*g*sin(theta) = m*l*theta''",
                          "motion", of="theta", driven=False, note=""),
        PublishedEquation("3.7", "theta'' + (g/l)*sin(theta) = 0",
                          "motion", of="theta", driven=False, note="the source has no torque"),
        PublishedEquation("3.8", "f(theta) = f(theta0) + f'(theta0)*(theta ± theta0)",
                          "linear part", of="theta", driven=False, note=""),
        PublishedEquation("3.9", "f(theta) = sin(theta)", "value", of="", driven=False, note=""),
        PublishedEquation("3.10", "f'(theta) = cos(theta)", "value", of="", driven=False, note=""),
        PublishedEquation("3.11", "sin(theta) = sin(theta0) + cos(theta0)*(theta"
                          " ± theta0) = theta, theta0 = 0",
                          "linear part", of="theta", driven=False, note=""),
        PublishedEquation("3.12", "theta'' + (g/l)*theta = 0",
                          "linear", of="hanging", driven=False, note="the source has no torque"),
    ),
    quantities=(
        Quantity("a_t", acceleration.dot(tangent), "m/s^2", "along the path"),
        Quantity("a_n", acceleration.dot(normal), "m/s^2", "toward the pivot"),
        Quantity("F_t", weight.dot(tangent), "N", "all forces along the path"),
        Quantity("f", V.diff(theta.q) / (m * g * l), "1", "the weight's torque over m g l"),
    ),
    # The world: x to the right, z up, the origin at the pivot.
    frames=(
        Pose("mass", (l * sin(theta.q), 0, -l * cos(theta.q)), "the point mass"),
    ),
    sketch=(
        Link("wall", (-0.15, 0), (0.15, 0)),
        Link("rod", (0, 0), (l * sin(theta.q), -l * cos(theta.q)), "l"),
        Body("disc", (l * sin(theta.q), -l * cos(theta.q)), l / 8, l / 8, theta.q, "m"),
        Link("line", (0, 0), (0, -l)),
        Angle((0, 0), l / 2, -pi / 2, theta.q - pi / 2, "theta"),
    ),
)  # fmt: skip
