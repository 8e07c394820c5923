"""A box on a steep incline that tips about its lower edge; the slope lies along x."""

from math import cos, sin

import pymunk

MASS = 1.0  # kg
HALF_WIDTH = 0.05  # m
HALF_HEIGHT = 0.15  # m
GRAVITY = 9.81  # m/s^2
SLOPE = 0.45  # rad
FRICTION = 0.8


def build():
    """Build the space, seen from the side, with the slope along x."""
    space = pymunk.Space()
    space.gravity = (GRAVITY * sin(SLOPE), -GRAVITY * cos(SLOPE))

    # A step along a tangent lifts an edge off by the square of the step. Up to x = 0.5 m the slope
    # is 1 mm higher, so that an edge stays in touch; Chipmunk leaves an overlap below
    # `collision_slop`, 0.1 m, as it is. Beyond, the slope has its height.
    slope = pymunk.Segment(space.static_body, (-50, 0.001), (0.5, 0.001), 0)
    lower = pymunk.Segment(space.static_body, (0.6, 0), (50, 0), 0)
    slope.friction = lower.friction = 1.0  # the product of both surfaces counts

    box = pymunk.Body(MASS, MASS * (HALF_WIDTH**2 + HALF_HEIGHT**2) / 3)
    box.position = (0, HALF_HEIGHT)
    shape = pymunk.Poly.create_box(box, (2 * HALF_WIDTH, 2 * HALF_HEIGHT))
    shape.friction = FRICTION
    space.add(slope, lower, box, shape)
    return space, {"box": box}
