"""A ball that skids until it rolls."""

from physics_crosscheck import Constant, Contact, Coordinate, Output, Scenario, System

x = Coordinate("x", "m", "position of the centre")
z = Coordinate("z", "m", "height of the lowest point")
theta = Coordinate("theta", "rad", "rotation about y")

CHOSEN = "chosen: a bowling ball in small"
m = Constant("m", 1.0, "kg", "mass", CHOSEN)
R = Constant("R", 0.1, "m", "radius", CHOSEN)
g = Constant("g", 9.81, "m/s^2", "gravity", "rounded from the standard 9.80665 m/s^2")
mu = Constant("mu", 0.2, "1", "friction coefficient", CHOSEN)

system = System(
    name="skidding_ball",
    title="Ball that skids, then rolls",
    source="2/5 m R^2 for a solid ball; Coulomb's law of friction",
    coordinates=(x, z, theta),
    constants=(m, R, g, mu),
    inputs=(),
    outputs=(Output("x", x.q, "m", "position"),),
    T=m * (x.v**2 + z.v**2) / 2 + m * R**2 * theta.v**2 / 5,
    V=m * g * z.q,
    D=0,
    equilibria=(),
    scenarios=(
        Scenario("skid", "thrown without rotation", q={x: 0, z: 0, theta: 0},
                 v={x: 1.0, z: 0, theta: 0}, inputs={}, duration=0.4),
        Scenario("back spin", "thrown with back-spin", q={x: 0, z: 0, theta: 0},
                 v={x: 1.0, z: 0, theta: -30.0}, inputs={}, duration=0.8),
    ),
    published=(),
    # A soft contact acts halfway between the surfaces; z is zero in a rigid one.
    interactions=(Contact("floor", gap=z.q, slip=x.v - (R + z.q / 2) * theta.v, mu=mu, e=0),),
)  # fmt: skip
