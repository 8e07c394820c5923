"""A mass on a spring that a moving belt drags: it sticks and slips."""

from physics_crosscheck import Constant, Coordinate, DryFriction, Output, Scenario, System

x = Coordinate("x", "m", "displacement from the spring's equilibrium")

CHOSEN = "chosen"
m = Constant("m", 1.0, "kg", "mass", CHOSEN)
k = Constant("k", 80.0, "N/m", "stiffness", CHOSEN)
F = Constant("F", 3.0, "N", "dry friction", CHOSEN)
V_belt = Constant("V_belt", 0.2, "m/s", "speed of the belt", CHOSEN)

system = System(
    name="belt_oscillator",
    title="Oscillator on a belt",
    source="Den Hartog, Mechanical Vibrations, section 7.3",
    coordinates=(x,),
    constants=(m, k, F, V_belt),
    inputs=(),
    outputs=(Output("x", x.q, "m", "displacement"),),
    T=m * x.v**2 / 2,
    V=k * x.q**2 / 2,
    D=0,
    equilibria=(),
    scenarios=(
        Scenario("drag", "released at the equilibrium", q={x: 0}, v={x: 0}, inputs={},
                 duration=2.0),
    ),
    published=(),
    interactions=(DryFriction("belt", slip=x.v - V_belt, force=F),),
)  # fmt: skip
