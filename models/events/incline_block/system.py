"""A block on an incline with friction; x is along the slope, z normal to it."""

from sympy import cos, sin

from physics_crosscheck import Constant, Contact, Coordinate, Output, Scenario, System

x = Coordinate("x", "m", "position along the slope, positive downhill")
z = Coordinate("z", "m", "distance from the slope")

CHOSEN = "chosen"
m = Constant("m", 1.0, "kg", "mass", CHOSEN)
g = Constant("g", 9.81, "m/s^2", "gravity", "rounded from the standard 9.80665 m/s^2")
th = Constant("th", 0.45, "rad", "angle of the slope", CHOSEN)
mu = Constant("mu", 0.3, "1", "friction coefficient", CHOSEN)

system = System(
    name="incline_block",
    title="Block on an incline",
    source="Coulomb's law of friction",
    coordinates=(x, z),
    constants=(m, g, th, mu),
    inputs=(),
    outputs=(Output("x", x.q, "m", "position"),),
    T=m * (x.v**2 + z.v**2) / 2,
    V=m * g * (z.q * cos(th) - x.q * sin(th)),
    D=0,
    equilibria=(),
    scenarios=(
        Scenario("slide", "released at rest; it slides", q={x: 0, z: 0}, v={x: 0, z: 0},
                 inputs={}, duration=1.0),
        Scenario("uphill", "pushed uphill; it stops and slides back", q={x: 0, z: 0},
                 v={x: -2.0, z: 0}, inputs={}, duration=1.0),
    ),
    published=(),
    interactions=(Contact("slope", gap=z.q, slip=x.v, mu=mu, e=0),),
)  # fmt: skip
