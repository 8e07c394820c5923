"""A ball on an incline, which rolls or slides; x is along the slope, z normal to it."""

from sympy import cos, sin

from physics_crosscheck import Constant, Contact, Coordinate, Output, Scenario, System

x = Coordinate("x", "m", "position along the slope, positive downhill")
z = Coordinate("z", "m", "distance of the ball from the slope")
theta = Coordinate("theta", "rad", "rotation about y")

CHOSEN = "chosen"
m = Constant("m", 1.0, "kg", "mass", CHOSEN)
R = Constant("R", 0.1, "m", "radius", CHOSEN)
g = Constant("g", 9.81, "m/s^2", "gravity", "rounded from the standard 9.80665 m/s^2")
th = Constant("th", 0.5, "rad", "angle of the slope", CHOSEN)
mu = Constant("mu", 0.3, "1", "friction coefficient", CHOSEN)

system = System(
    name="slope_ball",
    title="Ball on a slope",
    source="2/5 m R^2 for a solid ball; Coulomb's law of friction",
    coordinates=(x, z, theta),
    constants=(m, R, g, th, mu),
    inputs=(),
    outputs=(Output("x", x.q, "m", "position"),),
    T=m * (x.v**2 + z.v**2) / 2 + m * R**2 * theta.v**2 / 5,
    V=m * g * (z.q * cos(th) - x.q * sin(th)),
    D=0,
    equilibria=(),
    scenarios=(
        Scenario("roll", "released at rest; it rolls", q={x: 0, z: 0, theta: 0},
                 v={x: 0, z: 0, theta: 0}, inputs={}, duration=1.0),
        Scenario("uphill", "thrown uphill without rotation", q={x: 0, z: 0, theta: 0},
                 v={x: -2.0, z: 0, theta: 0}, inputs={}, duration=1.0),
    ),
    published=(),
    # A soft contact acts halfway between the surfaces; z is zero in a rigid one.
    interactions=(Contact("slope", gap=z.q, slip=x.v - (R + z.q / 2) * theta.v, mu=mu, e=0),),
)  # fmt: skip
