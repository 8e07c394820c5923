"""A weight on a rod that nothing brakes."""

from sympy import cos

from physics_crosscheck import Constant, Coordinate, Equilibrium, Input, Output, Scenario, System

theta = Coordinate("theta", "rad", "angle from the vertical")
m = Constant("m", 1, "kg", "the weight", "chosen")
r = Constant("r", 3, "m", "the rod's length", "chosen")
g = Constant("g", 9.81, "m/s^2", "gravity", "chosen")
tau = Input("tau", "N*m", "torque about the pin", on={theta: 1})
start = Scenario("swing", "let go of", q={theta: 1.5}, v={theta: 0}, inputs={tau: 0}, duration=60.0)
system = System(
    name="rod",
    title="A weight on a rod",
    source="a pendulum",
    coordinates=(theta,),
    constants=(m, r, g),
    inputs=(tau,),
    outputs=(Output("theta", theta.q, "rad", "angle"),),
    T=m * r**2 * theta.v**2 / 2,
    V=-m * g * r * cos(theta.q),
    D=0,
    equilibria=(Equilibrium("hanging", at={theta: 0}, search=False, description="at rest"),),
    scenarios=(start,),
    published=(),
)
