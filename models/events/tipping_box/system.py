"""A box on a steep incline that tips about its lower edge.

x is along the slope and z normal to it, both of the centre; theta tips the box downhill.
"""

from sympy import cos, sin

from physics_crosscheck import Constant, Contact, Coordinate, Output, Scenario, System

x = Coordinate("x", "m", "position of the centre along the slope, positive downhill")
z = Coordinate("z", "m", "distance of the centre from the slope")
theta = Coordinate("theta", "rad", "rotation about y, positive downhill")

CHOSEN = "chosen: a box that is higher than it is wide"
m = Constant("m", 1.0, "kg", "mass", CHOSEN)
b = Constant("b", 0.05, "m", "half of the width", CHOSEN)
h = Constant("h", 0.15, "m", "half of the height", CHOSEN)
g = Constant("g", 9.81, "m/s^2", "gravity", "rounded from the standard 9.80665 m/s^2")
slope = Constant("slope", 0.45, "rad", "angle of the slope", CHOSEN)
mu = Constant("mu", 0.8, "1", "friction coefficient", CHOSEN)
TILT = 0.1  # rad


def edge(side):
    """Return the contact of an edge of the bottom: 1 downhill, -1 uphill."""
    depth = side * b * sin(theta.q) + h * cos(theta.q)  # of the edge below the centre
    name, gap = "downhill edge" if side > 0 else "uphill edge", z.q - depth
    # A soft contact acts halfway between the surfaces; the gap of a rigid one is zero.
    return Contact(name, gap=gap, slip=x.v - (depth + gap / 2) * theta.v, mu=mu, e=0)


def tilted(side, place):
    """Return the position of the box on an edge, with its centre over a place of the slope."""
    return {x: place, z: b * sin(TILT) + h * cos(TILT), theta: side * TILT}


system = System(
    name="tipping_box",
    title="Box that tips and rocks",
    source="Housner (1963): the speed after an impact is 1 - 3/2 sin(a)^2 of that before",
    coordinates=(x, z, theta),
    constants=(m, b, h, g, slope, mu),
    inputs=(),
    outputs=(Output("theta", theta.q, "rad", "rotation"),),
    T=m * (x.v**2 + z.v**2) / 2 + m * (b**2 + h**2) * theta.v**2 / 6,
    V=m * g * (z.q * cos(slope) - x.q * sin(slope)),
    D=0,
    equilibria=(),
    scenarios=(
        Scenario("tip", "released beyond the lower edge, about which it turns",
                 q=tilted(1, 0), v={x: 0, z: 0, theta: 0}, inputs={}, duration=0.2),
        Scenario("rock", "released on its upper edge; it lands on the lower one and tips on",
                 q=tilted(-1, 1), v={x: 0, z: 0, theta: 0}, inputs={}, duration=0.25),
    ),
    published=(),
    interactions=(edge(-1), edge(1)),
)  # fmt: skip
