"""Two uniform rods, one hung from the other, with friction in both pins."""

from sympy import cos, pi, sin

from physics_crosscheck import (
    Constant, Coordinate, Equilibrium, Input, Output, Scenario, System, t,
)  # fmt: skip

alpha = Coordinate("alpha", "rad", "upper rod from hanging, positive toward +x")
beta = Coordinate("beta", "rad", "lower rod from the line of the upper")

SHOP = "cut to measure in the workshop"
m1 = Constant("m1", 0.9, "kg", "mass of the upper rod", SHOP)
m2 = Constant("m2", 0.5, "kg", "mass of the lower rod", SHOP)
l1 = Constant("l1", 0.6, "m", "length of the upper rod", SHOP)
l2 = Constant("l2", 0.48, "m", "length of the lower rod", SHOP)
b1 = Constant("b1", 0.03, "N*m*s/rad", "friction of the upper pin", SHOP)
b2 = Constant("b2", 0.01, "N*m*s/rad", "friction of the lower pin", SHOP)
g = Constant("g", 9.81, "m/s^2", "gravity", "rounded from the standard 9.80665 m/s^2")

tau = Input("tau", "N*m", "torque of the motor in the upper pin", on={alpha: 1})

# The lower rod's angle from hanging, and its speed.
angle, spin = alpha.q + beta.q, alpha.v + beta.v
upper = m1 * l1**2 / 3 * alpha.v**2 / 2
moving = l1**2 * alpha.v**2 + l1 * l2 * cos(beta.q) * alpha.v * spin + l2**2 * spin**2 / 3
lower = m2 * moving / 2

system = System(
    name="double_pendulum",
    title="Double pendulum",
    source="Landau and Lifshitz, Mechanics, section 5, problem 1, with rods for the points",
    coordinates=(alpha, beta),
    constants=(m1, m2, l1, l2, b1, b2, g),
    inputs=(tau,),
    outputs=(Output("tip", l1 * sin(alpha.q) + l2 * sin(angle), "m", "how far out the end is"),),
    T=upper + lower,
    V=-m1 * g * (l1 / 2) * cos(alpha.q) - m2 * g * (l1 * cos(alpha.q) + (l2 / 2) * cos(angle)),
    D=b1 * alpha.v**2 / 2 + b2 * beta.v**2 / 2,
    equilibria=(
        Equilibrium("hanging", at={alpha: 0, beta: 0}, search=False, description="both down"),
        Equilibrium("folded", at={alpha: 0, beta: pi}, search=False, description="lower one up"),
    ),
    scenarios=(
        Scenario("wild", "let go from nearly upright", q={alpha: 2.8, beta: 0.4},
                 v={alpha: 0, beta: 0}, inputs={tau: 0}, duration=6.0),
        Scenario("motor", "a harmonic torque", q={alpha: 0.2, beta: -0.3},
                 v={alpha: 0, beta: 0}, inputs={tau: 1.5 * sin(2.7 * t)}, duration=6.0),
    ),
    published=(),
)  # fmt: skip
