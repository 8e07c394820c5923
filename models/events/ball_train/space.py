"""Three balls on a rail that collide one after the other."""

import pymunk

MASS_1 = 0.3  # kg
MASS_2 = 0.2  # kg
MASS_3 = 0.25  # kg
DIAMETER = 0.1  # m
RESTITUTION = 0.9


def build():
    """Build the space, seen from above, without gravity."""
    space = pymunk.Space()
    balls = {}
    for i, (mass, x) in enumerate([(MASS_1, 0), (MASS_2, 0.3), (MASS_3, 0.5)]):
        ball = pymunk.Body(mass, float("inf"))
        ball.position = (x, 0)
        shape = pymunk.Circle(ball, DIAMETER / 2)
        shape.elasticity = RESTITUTION**0.5  # the product of both surfaces counts
        space.add(ball, shape)
        balls[f"ball{i + 1}"] = ball
    return space, balls
