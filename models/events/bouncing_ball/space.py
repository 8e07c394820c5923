"""A ball that drops on a floor, with restitution."""

import pymunk

MASS = 0.35  # kg
RADIUS = 0.1  # m
GRAVITY = 9.81  # m/s^2
RESTITUTION = 0.8


def build():
    """Build the space, seen from the side, with the floor at zero."""
    space = pymunk.Space()
    space.gravity = (0, -GRAVITY)

    floor = pymunk.Segment(space.static_body, (-50, 0), (50, 0), 0)
    floor.elasticity = 1.0  # the product of both surfaces counts

    ball = pymunk.Body(MASS, pymunk.moment_for_circle(MASS, 0, RADIUS))
    ball.position = (0, RADIUS)
    shape = pymunk.Circle(ball, RADIUS)
    shape.elasticity = RESTITUTION
    space.add(floor, ball, shape)
    return space, {"ball": ball}
