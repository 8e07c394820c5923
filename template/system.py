"""The physics of my_model: a rod that swings from a pin, with friction in the pin.

This file says what the mechanism is. The model files beside it say what engines make of it, and
`crosscheck run` tells whether they are the same, to nine digits. Change both to what you have.
"""

# sympy's functions, not those of math: the energies are formulas, and are differentiated.
from sympy import cos, pi, sin

from physics_crosscheck import (
    Constant, Coordinate, Equilibrium, Input, Output, Pose, Scenario, System, rotation, t,
)  # fmt: skip

# How the mechanism is placed: as many coordinates as it has freedoms. `theta.q` is the position in
# formulas, `theta.v` the velocity. Joints in model files that have the same name need no more said.
theta = Coordinate("theta", "rad", "angle from the vertical, positive toward +x")

# Every number of the mechanism once, with its unit and where it comes from. None has a default, and
# a unit that can't be right is refused. These are free to choose; yours come from a drawing.
CHOSEN = "chosen: a rod for a table top"
m = Constant("m", 0.8, "kg", "mass of the uniform rod", CHOSEN)
l = Constant("l", 0.6, "m", "length of the rod", CHOSEN)  # noqa: E741  # the usual name
b = Constant("b", 0.05, "N*m*s/rad", "viscous friction of the pin", CHOSEN)
g = Constant("g", 9.81, "m/s^2", "gravity", "rounded from the standard 9.80665 m/s^2")

# A known force, and how it acts: 1 N*m of tau is 1 N*m on theta. A free motion can't tell twice the
# mass with twice the spring from the model meant; a force can.
tau = Input("tau", "N*m", "torque about the pin", on={theta: 1})

system = System(
    name="my_model",
    title="A rod that swings",
    source="a uniform rod about its end: any textbook of mechanics",
    coordinates=(theta,),
    constants=(m, l, b, g),
    inputs=(tau,),
    outputs=(Output("theta", theta.q, "rad", "angle"),),
    # The kinetic energy. A uniform rod has m*l^2/3 about its end.
    T=(m * l**2 / 3) * theta.v**2 / 2,
    # The potential energy: the rod's centre is l/2 below the pin where theta is zero.
    V=-m * g * (l / 2) * cos(theta.q),
    # Rayleigh's dissipation function: half of the power that friction takes. 0 where there is none.
    D=b * theta.v**2 / 2,
    # Where it can rest. The engines' own linearizations are compared with the equations' there.
    # search=False: it is exactly there; search=True: find it near there.
    equilibria=(
        Equilibrium("hanging", at={theta: 0}, search=False, description="rod down"),
        Equilibrium("upright", at={theta: pi}, search=False, description="rod up"),
    ),
    # Motions to compare: ten periods or more, at an amplitude where nothing is small, and at least
    # one with a force.
    scenarios=(
        Scenario("free", "released at 1 rad", q={theta: 1.0}, v={theta: 0}, inputs={tau: 0},
                 duration=15.0),
        Scenario("large", "released at 2.9 rad", q={theta: 2.9}, v={theta: 0}, inputs={tau: 0},
                 duration=15.0),
        Scenario("driven", "a harmonic torque on top of a steady one", q={theta: 0.2},
                 v={theta: 0}, inputs={tau: 0.4 + 0.6 * sin(2.1 * t)}, duration=15.0),
    ),
    # Where bodies and points are in the world, here with z up and the pin at the origin. Joints may
    # agree and the robot be another one, its base elsewhere or an axis flipped; this tells. What
    # each is in a model file is said in its sidecar, under [frames].
    frames=(
        Pose("rod", (l / 2 * sin(theta.q), 0, -l / 2 * cos(theta.q)), "the rod's centre",
             rotation((0, -1, 0), theta.q)),
    ),
    # Equations as your source has them may be listed here, and are checked as well: see
    # models/*/system.py of physics-crosscheck.
    published=(),
)  # fmt: skip
