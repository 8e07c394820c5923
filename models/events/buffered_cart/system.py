"""A cart that rolls against a buffer: a spring behind a gap."""

from physics_crosscheck import Buffer, Constant, Coordinate, Output, Scenario, System

x = Coordinate("x", "m", "position of the cart's front")

CHOSEN = "chosen"
m = Constant("m", 2.0, "kg", "mass", CHOSEN)
k = Constant("k", 800.0, "N/m", "stiffness of the buffer", CHOSEN)
x0 = Constant("x0", 0.5, "m", "position of the buffer", CHOSEN)

system = System(
    name="buffered_cart",
    title="Cart against a buffer",
    source="half an oscillation; the cart returns with its speed",
    coordinates=(x,),
    constants=(m, k, x0),
    inputs=(),
    outputs=(Output("x", x.q, "m", "position"),),
    T=m * x.v**2 / 2,
    V=0,
    D=0,
    equilibria=(),
    scenarios=(
        Scenario("bump", "rolls against the buffer", q={x: 0}, v={x: 1.5}, inputs={},
                 duration=1.0),
    ),
    published=(),
    interactions=(Buffer("buffer", gap=x0 - x.q, stiffness=k, damping=0),),
)  # fmt: skip
