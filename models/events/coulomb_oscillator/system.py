"""A mass on a spring with dry friction."""

from physics_crosscheck import Constant, Coordinate, DryFriction, Output, Scenario, System

x = Coordinate("x", "m", "displacement from the spring's equilibrium")

CHOSEN = "chosen: a few oscillations until rest"
m = Constant("m", 1.2, "kg", "mass", CHOSEN)
k = Constant("k", 100.0, "N/m", "stiffness", CHOSEN)
F = Constant("F", 2.0, "N", "dry friction", CHOSEN)

system = System(
    name="coulomb_oscillator",
    title="Oscillator with dry friction",
    source="Den Hartog, Mechanical Vibrations, section 8.2",
    coordinates=(x,),
    constants=(m, k, F),
    inputs=(),
    outputs=(Output("x", x.q, "m", "displacement"),),
    T=m * x.v**2 / 2,
    V=k * x.q**2 / 2,
    D=0,
    equilibria=(),
    scenarios=(
        Scenario("release", "released at 0.115 m", q={x: 0.115}, v={x: 0}, inputs={},
                 duration=1.4),
    ),
    published=(),
    interactions=(DryFriction("friction", slip=x.v, force=F),),
)  # fmt: skip
