"""A mass on a spring with dry friction."""

import pymunk

MASS = 1.2  # kg
STIFFNESS = 100.0  # N/m
FRICTION = 2.0  # N


def build():
    """Build the space, seen from the side; the floor bears a weight of 1 N."""
    space = pymunk.Space()
    space.gravity = (0, -1 / MASS)

    # The floor is 1 mm above the lowest point of the mass, so that rounding never parts them;
    # Chipmunk leaves an overlap below `collision_slop`, 0.1 m, as it is.
    floor = pymunk.Segment(space.static_body, (-50, 0.001), (50, 0.001), 0)
    floor.friction = 1.0  # the product of both surfaces counts

    # A disc that cannot turn touches at one point, as a block that does not tip.
    mass = pymunk.Body(MASS, float("inf"))
    mass.position = (0, 0.05)
    shape = pymunk.Circle(mass, 0.05)
    shape.friction = FRICTION  # under a weight of 1 N
    spring = pymunk.DampedSpring(space.static_body, mass, (-20, 0.05), (0, 0), 20.0, STIFFNESS, 0.0)
    space.add(floor, mass, shape, spring)
    return space, {"mass": mass}
