"""A block on a spring that a moving belt drags."""

import pymunk

MASS = 1.0  # kg
STIFFNESS = 80.0  # N/m
GRAVITY = 9.81  # m/s^2
FRICTION = 0.3
BELT_SPEED = 0.2  # m/s


def build():
    """Build the space, seen from the side."""
    space = pymunk.Space()
    space.gravity = (0, -GRAVITY)

    # The belt is 1 mm above the block's lowest point, so that rounding never parts them; Chipmunk
    # leaves an overlap below `collision_slop`, 0.1 m, as it is.
    belt = pymunk.Segment(space.static_body, (-50, 0.001), (50, 0.001), 0)
    belt.friction = 1.0  # the product of both surfaces counts
    belt.surface_velocity = (BELT_SPEED, 0)

    # A disc that cannot turn touches at one point, as a block that does not tip.
    block = pymunk.Body(MASS, float("inf"))
    block.position = (0, 0.05)
    shape = pymunk.Circle(block, 0.05)
    shape.friction = FRICTION
    # The spring's far end is level with the block, which keeps its height.
    spring = pymunk.DampedSpring(
        space.static_body, block, (-20, 0.05), (0, 0), 20.0, STIFFNESS, 0.0
    )
    space.add(belt, block, shape, spring)
    return space, {"block": block}
