"""Example 2.2: a disc on a torsional spring, driven by a torque."""

from sympy import Heaviside, Rational, exp, sin

from physics_crosscheck import (
    Constant, Coordinate, Equilibrium, Input, Output, Pose,
    PublishedEquation, Quantity, Scenario, System, rotation, t,
)  # fmt: skip
from physics_crosscheck.sketch import Angle, Body, Link

theta = Coordinate("theta", "rad", "rotation of the disc from the shaft's equilibrium")

CHOSEN = "chosen: a steel disc of 0.2 m diameter on a slender shaft, one cycle a second"
J = Constant("J", 0.021, "kg*m^2", "polar mass moment of inertia about the axis", CHOSEN)
k_theta = Constant("k_theta", 0.85, "N*m/rad", "torsional stiffness of the shaft", CHOSEN)

T = Input("T", "N*m", "torque on the disc", on={theta: 1})

system = System(
    name="torsional_disc",
    title="Torsional disc",
    source="Example 2.2, Eq. 2.7-2.9",
    coordinates=(theta,),
    constants=(J, k_theta),
    inputs=(T,),
    outputs=(Output("theta", theta.q, "rad", "rotation"),),
    T=J * theta.v**2 / 2,
    V=k_theta * theta.q**2 / 2,
    D=0,
    equilibria=(Equilibrium("rest", at={theta: 0}, search=False, description="shaft untwisted"),),
    scenarios=(
        Scenario("free", "released at 1.2 rad", q={theta: 1.2}, v={theta: 0.5}, inputs={T: 0},
                 duration=10.5),
        Scenario("pulse", "a torque of 0.6 N m between 0.7 s and 3.2 s, then a fading one",
                 q={theta: 0}, v={theta: 0},
                 inputs={T: 0.6 * (Heaviside(t - Rational(7, 10)) - Heaviside(t - Rational(16, 5)))
                         + 0.3 * exp(-t / 4)},
                 duration=10.5),
        Scenario("beat", "driven near its natural frequency: the amplitude beats past 3 rad",
                 q={theta: 0.1}, v={theta: 0}, inputs={T: 0.2 * sin(5.8 * t)}, duration=12.0),
    ),
    published=(
        PublishedEquation("2.7", "M = J*alpha", "motion", of="theta", driven=True, note=""),
        PublishedEquation("2.8", "T ± k_theta*theta = J*theta''",
                          "motion", of="theta", driven=True, note=""),
        PublishedEquation("2.9", "J*theta'' + k_theta*theta = T",
                          "motion", of="theta", driven=True, note=""),
    ),
    quantities=(
        Quantity("M", T - k_theta * theta.q, "N*m", "all torques on the disc, cut free"),
        Quantity("alpha", theta.a, "rad/s^2", "angular acceleration of the disc"),
    ),
    # The world: z along the shaft, the origin at the disc's centre.
    frames=(
        Pose("disc", (0, 0, 0), "the disc", rotation((0, 0, 1), theta.q)),
    ),
    sketch=(
        Body("disc", (0, 0), 0.2, 0.2, theta.q, label="J"),
        Body("spiral", (0, 0), 0.07, 0.07, label="k_theta"),
        Link("line", (0, 0), (0.13, 0)),
        Angle((0, 0), 0.12, 0, theta.q, "theta"),
    ),
)  # fmt: skip
