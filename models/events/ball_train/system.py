"""Three balls on a rail that collide one after the other."""

from physics_crosscheck import Constant, Contact, Coordinate, Output, Scenario, System

x1 = Coordinate("x1", "m", "position of the first ball")
x2 = Coordinate("x2", "m", "position of the second ball")
x3 = Coordinate("x3", "m", "position of the third ball")

CHOSEN = "chosen"
m1 = Constant("m1", 0.3, "kg", "mass of the first ball", CHOSEN)
m2 = Constant("m2", 0.2, "kg", "mass of the second ball", CHOSEN)
m3 = Constant("m3", 0.25, "kg", "mass of the third ball", CHOSEN)
d = Constant("d", 0.1, "m", "diameter of each ball", CHOSEN)
e = Constant("e", 0.9, "1", "restitution", CHOSEN)

system = System(
    name="ball_train",
    title="Train of balls",
    source="Newton's restitution, pair by pair",
    coordinates=(x1, x2, x3),
    constants=(m1, m2, m3, d, e),
    inputs=(),
    outputs=(Output("x3", x3.q, "m", "position of the last ball"),),
    T=(m1 * x1.v**2 + m2 * x2.v**2 + m3 * x3.v**2) / 2,
    V=0,
    D=0,
    equilibria=(),
    scenarios=(
        Scenario("hit", "the first ball hits the second, that the third",
                 q={x1: 0, x2: 0.3, x3: 0.5}, v={x1: 1.0, x2: 0, x3: 0}, inputs={}, duration=0.6),
    ),
    published=(),
    interactions=(
        Contact("first pair", gap=x2.q - x1.q - d, slip=0, mu=0, e=e),
        Contact("second pair", gap=x3.q - x2.q - d, slip=0, mu=0, e=e),
    ),
)  # fmt: skip
