"""A mass that a position servo with limited force moves to a target."""

from physics_crosscheck import Constant, Coordinate, Drive, Output, Scenario, System

x = Coordinate("x", "m", "position")

CHOSEN = "chosen"
m = Constant("m", 1.0, "kg", "mass", CHOSEN)
kp = Constant("kp", 60.0, "N/m", "gain of the position", CHOSEN)
kd = Constant("kd", 6.0, "N*s/m", "gain of the velocity", CHOSEN)
F = Constant("F", 10.0, "N", "largest force", CHOSEN)
target = Constant("target", 0.6, "m", "target position", CHOSEN)

system = System(
    name="saturated_servo",
    title="Servo with limited force",
    source="a parabola, then a damped oscillation",
    coordinates=(x,),
    constants=(m, kp, kd, F, target),
    inputs=(),
    outputs=(Output("x", x.q, "m", "position"),),
    T=m * x.v**2 / 2,
    V=0,
    D=0,
    equilibria=(),
    scenarios=(
        Scenario("move", "from rest to the target", q={x: 0}, v={x: 0}, inputs={}, duration=1.5),
    ),
    published=(),
    interactions=(
        Drive("servo", on={x: 1}, force=kp * (target - x.q) - kd * x.v, limit=F),
    ),
)  # fmt: skip
