"""A mass that a motor pushes; its rotor lags behind its torque, and its force is limited."""

from physics_crosscheck import Constant, Coordinate, Drive, Output, Scenario, System

x = Coordinate("x", "m", "position")
turn = Coordinate("turn", "rad", "angle of the rotor; the force follows its rate")

CHOSEN = "chosen"
m = Constant("m", 1.0, "kg", "mass", CHOSEN)
c = Constant("c", 1.5, "N*s/m", "viscous friction of the mass", CHOSEN)
J = Constant("J", 0.002, "kg*m^2", "moment of inertia of the rotor", CHOSEN)
d = Constant("d", 0.02, "N*m*s/rad", "drag of the rotor", CHOSEN)
M = Constant("M", 0.3, "N*m", "torque on the rotor", CHOSEN)
k = Constant("k", 1.0, "N*s/rad", "force of the motor over the rate of its rotor", CHOSEN)
F = Constant("F", 10.0, "N", "largest force", CHOSEN)

system = System(
    name="filtered_motor",
    title="Motor with a filter and limited force",
    source="rate of the rotor M/d + C e^(-t d/J); position by partial fractions",
    coordinates=(x, turn),
    constants=(m, c, J, d, M, k, F),
    inputs=(),
    outputs=(Output("x", x.q, "m", "position"),),
    T=m * x.v**2 / 2 + J * turn.v**2 / 2,
    V=-M * turn.q,
    D=c * x.v**2 / 2 + d * turn.v**2 / 2,
    equilibria=(),
    scenarios=(
        Scenario("push", "from rest until the force is at its limit", q={x: 0, turn: 0},
                 v={x: 0, turn: 0}, inputs={}, duration=0.6),
        Scenario("turn back", "the rotor turns backward first", q={x: 0, turn: 0},
                 v={x: 0.5, turn: -40.0}, inputs={}, duration=0.6),
    ),
    published=(),
    interactions=(Drive("motor", on={x: 1}, force=k * turn.v, limit=F),),
)  # fmt: skip
