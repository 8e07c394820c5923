"""A cart on a rail, with friction, carries a pole that swings from a pin."""

from sympy import cos, pi, sin

from physics_crosscheck import (
    Constant, Coordinate, Equilibrium, Input, Output, Scenario, System, t,
)  # fmt: skip

x = Coordinate("x", "m", "cart along the rail")
theta = Coordinate("theta", "rad", "pole from hanging, positive toward +x")

BENCH = "the bench in the laboratory, measured"
M = Constant("M", 1.6, "kg", "mass of the cart", BENCH)
m = Constant("m", 0.25, "kg", "mass of the pole", BENCH)
l = Constant("l", 0.8, "m", "length of the uniform pole", BENCH)  # noqa: E741  # the usual name
c = Constant("c", 0.9, "N*s/m", "friction of the rail", BENCH)
b = Constant("b", 0.004, "N*m*s/rad", "friction of the pin", BENCH)
g = Constant("g", 9.81, "m/s^2", "gravity", "rounded from the standard 9.80665 m/s^2")

F = Input("F", "N", "force on the cart", on={x: 1})

system = System(
    name="cart_pole",
    title="Cart with a pole",
    source="Barto, Sutton and Anderson 1983, with a uniform pole",
    coordinates=(x, theta),
    constants=(M, m, l, c, b, g),
    inputs=(F,),
    outputs=(Output("theta", theta.q, "rad", "angle of the pole"),),
    T=(M + m) * x.v**2 / 2 + m * l * cos(theta.q) * x.v * theta.v / 2 + m * l**2 * theta.v**2 / 6,
    V=-m * g * (l / 2) * cos(theta.q),
    D=c * x.v**2 / 2 + b * theta.v**2 / 2,
    equilibria=(
        Equilibrium("hanging", at={x: 0, theta: 0}, search=False, description="pole down"),
        Equilibrium("upright", at={x: 0, theta: pi}, search=False, description="pole up"),
    ),
    scenarios=(
        Scenario("falling", "the pole let go near the top", q={x: 0, theta: 2.9},
                 v={x: 0.1, theta: 0}, inputs={F: 0}, duration=6.0),
        Scenario("pushed", "a harmonic force on the cart", q={x: 0, theta: 0.3},
                 v={x: 0, theta: 0}, inputs={F: 4 * sin(3.1 * t)}, duration=6.0),
    ),
    published=(),
)  # fmt: skip
