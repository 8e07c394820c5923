"""A ball that drops on a floor that gives way, and stays there."""

from physics_crosscheck import Constant, Contact, Coordinate, Output, Scenario, System

z = Coordinate("z", "m", "height of the lowest point of the ball")

CHOSEN = "chosen: a ball that one can hold"
m = Constant("m", 0.35, "kg", "mass", CHOSEN)
g = Constant("g", 9.81, "m/s^2", "gravity", "rounded from the standard 9.80665 m/s^2")

system = System(
    name="soft_landing",
    title="Soft landing",
    source="damped oscillation about the rest depth; the rigid ball stops at once",
    coordinates=(z,),
    constants=(m, g),
    inputs=(),
    outputs=(Output("z", z.q, "m", "height"),),
    T=m * z.v**2 / 2,
    V=m * g * z.q,
    D=0,
    equilibria=(),
    scenarios=(
        Scenario("land", "released at 0.2 m", q={z: 0.2}, v={z: 0}, inputs={}, duration=0.5),
    ),
    published=(),
    interactions=(Contact("floor", gap=z.q, slip=0, mu=0, e=0),),
)  # fmt: skip
