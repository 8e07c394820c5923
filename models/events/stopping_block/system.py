"""A block that slides on a floor until friction stops it."""

from physics_crosscheck import Constant, Contact, Coordinate, Output, Scenario, System

x = Coordinate("x", "m", "position")
z = Coordinate("z", "m", "height above the floor")

CHOSEN = "chosen"
m = Constant("m", 1.0, "kg", "mass", CHOSEN)
g = Constant("g", 9.81, "m/s^2", "gravity", "rounded from the standard 9.80665 m/s^2")
mu = Constant("mu", 0.3, "1", "friction coefficient", CHOSEN)

system = System(
    name="stopping_block",
    title="Block that stops",
    source="Coulomb's law of friction",
    coordinates=(x, z),
    constants=(m, g, mu),
    inputs=(),
    outputs=(Output("x", x.q, "m", "position"),),
    T=m * (x.v**2 + z.v**2) / 2,
    V=m * g * z.q,
    D=0,
    equilibria=(),
    scenarios=(
        Scenario("stop", "pushed at 2 m/s", q={x: 0, z: 0}, v={x: 2.0, z: 0}, inputs={},
                 duration=1.0),
    ),
    published=(),
    interactions=(Contact("floor", gap=z.q, slip=x.v, mu=mu, e=0),),
)  # fmt: skip
