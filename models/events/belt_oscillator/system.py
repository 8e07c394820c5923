"""A block on a spring that a moving belt drags: it sticks and slips."""

from physics_crosscheck import Constant, Contact, Coordinate, Output, Scenario, System

x = Coordinate("x", "m", "displacement from the spring's equilibrium")
z = Coordinate("z", "m", "height above the belt")

CHOSEN = "chosen"
m = Constant("m", 1.0, "kg", "mass", CHOSEN)
k = Constant("k", 80.0, "N/m", "stiffness", CHOSEN)
g = Constant("g", 9.81, "m/s^2", "gravity", "rounded from the standard 9.80665 m/s^2")
mu = Constant("mu", 0.3, "1", "friction coefficient", CHOSEN)
V_belt = Constant("V_belt", 0.2, "m/s", "speed of the belt", CHOSEN)

system = System(
    name="belt_oscillator",
    title="Oscillator on a belt",
    source="Den Hartog, Mechanical Vibrations, section 7.3",
    coordinates=(x, z),
    constants=(m, k, g, mu, V_belt),
    inputs=(),
    outputs=(Output("x", x.q, "m", "displacement"),),
    T=m * (x.v**2 + z.v**2) / 2,
    V=k * x.q**2 / 2 + m * g * z.q,
    D=0,
    equilibria=(),
    scenarios=(
        # Later, the largest speed of each cycle touches that of the belt.
        Scenario("drag", "released at the equilibrium", q={x: 0, z: 0}, v={x: 0, z: 0}, inputs={},
                 duration=0.6),
    ),
    published=(),
    interactions=(Contact("belt", gap=z.q, slip=x.v - V_belt, mu=mu, e=0),),
)  # fmt: skip
