"""A ball on an incline; the space is turned so that the slope lies along x."""

from math import cos, sin

import pymunk

MASS = 1.0  # kg
RADIUS = 0.1  # m
GRAVITY = 9.81  # m/s^2
ANGLE = 0.5  # rad
FRICTION = 0.3


def build():
    """Build the space, seen from the side."""
    space = pymunk.Space()
    space.gravity = (GRAVITY * sin(ANGLE), -GRAVITY * cos(ANGLE))

    # The floor is 1 mm thick on both sides, so that rounding never parts them; Chipmunk leaves an
    # overlap below `collision_slop`, 0.1 m, as it is. Friction acts at the middle of the overlap.
    floor = pymunk.Segment(space.static_body, (-50, 0), (50, 0), 0.001)
    floor.friction = 1.0  # the product of both surfaces counts

    # A ball in space, not a disc: 2/5 m r^2.
    ball = pymunk.Body(MASS, 2 / 5 * MASS * RADIUS**2)
    ball.position = (0, RADIUS)
    shape = pymunk.Circle(ball, RADIUS)
    shape.friction = FRICTION
    space.add(floor, ball, shape)
    return space, {"ball": ball}
