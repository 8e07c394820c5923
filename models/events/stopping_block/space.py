"""A block that slides on a floor until friction stops it."""

import pymunk

MASS = 1.0  # kg
GRAVITY = 9.81  # m/s^2
FRICTION = 0.3


def build():
    """Build the space, seen from the side."""
    space = pymunk.Space()
    space.gravity = (0, -GRAVITY)

    # The floor is 1 mm above the block's lowest point, so that rounding never parts them; Chipmunk
    # leaves an overlap below `collision_slop`, 0.1 m, as it is.
    floor = pymunk.Segment(space.static_body, (-50, 0.001), (50, 0.001), 0)
    floor.friction = 1.0  # the product of both surfaces counts

    # A disc that cannot turn touches at one point, as a block that does not tip.
    block = pymunk.Body(MASS, float("inf"))
    block.position = (0, 0.05)
    shape = pymunk.Circle(block, 0.05)
    shape.friction = FRICTION
    space.add(floor, block, shape)
    return space, {"block": block}
