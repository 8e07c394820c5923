"""A pendulum whose joint has a limit."""

from sympy import cos

from physics_crosscheck import Constant, Coordinate, Limit, Output, Scenario, System

theta = Coordinate("theta", "rad", "angle from the vertical, positive toward +x")

CHOSEN = "chosen: a pendulum for a table top"
m = Constant("m", 0.45, "kg", "point mass", CHOSEN)
l = Constant("l", 0.75, "m", "length of the massless rod", CHOSEN)  # noqa: E741
g = Constant("g", 9.81, "m/s^2", "gravity", "rounded from the standard 9.80665 m/s^2")
limit = Constant("limit", 0.4, "rad", "largest angle", CHOSEN)
e = Constant("e", 0.6, "1", "restitution at the limit", CHOSEN)

system = System(
    name="pendulum_stop",
    title="Pendulum against a joint limit",
    source="Newton's restitution; time by the elliptic integral",
    coordinates=(theta,),
    constants=(m, l, g, limit, e),
    inputs=(),
    outputs=(Output("theta", theta.q, "rad", "angle"),),
    T=m * l**2 * theta.v**2 / 2,
    V=-m * g * l * cos(theta.q),
    D=0,
    equilibria=(),
    scenarios=(
        Scenario("swing", "released at -1.1 rad", q={theta: -1.1}, v={theta: 0}, inputs={},
                 duration=4.0),
    ),
    published=(),
    interactions=(Limit("limit", on=theta, lower=None, upper=limit, e=e),),
)  # fmt: skip
