"""A block on an incline; the space is turned so that the slope lies along x."""

from math import cos, sin

import pymunk

MASS = 1.0  # kg
GRAVITY = 9.81  # m/s^2
ANGLE = 0.45  # rad
FRICTION = 0.3


def build():
    """Build the space, seen from the side, with the slope along x."""
    space = pymunk.Space()
    space.gravity = (GRAVITY * sin(ANGLE), -GRAVITY * cos(ANGLE))

    # The slope is 1 mm above the block's lowest point, so that rounding never parts them; Chipmunk
    # leaves an overlap below `collision_slop`, 0.1 m, as it is.
    slope = pymunk.Segment(space.static_body, (-50, 0.001), (50, 0.001), 0)
    slope.friction = 1.0  # the product of both surfaces counts

    # A disc that cannot turn touches at one point, as a block that does not tip.
    block = pymunk.Body(MASS, float("inf"))
    block.position = (0, 0.05)
    shape = pymunk.Circle(block, 0.05)
    shape.friction = FRICTION
    space.add(slope, block, shape)
    return space, {"block": block}
