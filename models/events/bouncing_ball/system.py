"""A ball that drops on a floor, with restitution."""

from physics_crosscheck import Constant, Contact, Coordinate, Output, Scenario, System

z = Coordinate("z", "m", "height of the lowest point of the ball")

CHOSEN = "chosen: a ball that one can hold"
m = Constant("m", 0.35, "kg", "mass", CHOSEN)
g = Constant("g", 9.81, "m/s^2", "gravity", "rounded from the standard 9.80665 m/s^2")
e = Constant("e", 0.8, "1", "restitution", CHOSEN)

system = System(
    name="bouncing_ball",
    title="Bouncing ball",
    source="Newton's restitution",
    coordinates=(z,),
    constants=(m, g, e),
    inputs=(),
    outputs=(Output("z", z.q, "m", "height"),),
    T=m * z.v**2 / 2,
    V=m * g * z.q,
    D=0,
    equilibria=(),
    scenarios=(
        Scenario("drop", "released at half a metre", q={z: 0.5}, v={z: 0}, inputs={},
                 duration=1.5),
        Scenario("thrown", "thrown down", q={z: 0.3}, v={z: -1.5}, inputs={}, duration=1.2),
    ),
    published=(),
    interactions=(Contact("floor", gap=z.q, slip=0, mu=0, e=e),),
)  # fmt: skip
