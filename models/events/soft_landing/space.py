"""A ball that drops on a floor, and stays there."""

import pymunk

MASS = 0.35  # kg
RADIUS = 0.1  # m
GRAVITY = 9.81  # m/s^2


def build():
    """Build the space, seen from the side; the ball at rest is at the origin."""
    space = pymunk.Space()
    space.gravity = (0, -GRAVITY)

    # The floor is 1e-14 m higher, so that rounding never parts it from a ball at rest; Chipmunk
    # leaves an overlap below `collision_slop`, 0.1 m, as it is.
    height = -RADIUS + 1e-14
    floor = pymunk.Segment(space.static_body, (-50, height), (50, height), 0)

    ball = pymunk.Body(MASS, pymunk.moment_for_circle(MASS, 0, RADIUS))
    space.add(floor, ball, pymunk.Circle(ball, RADIUS))
    return space, {"ball": ball}
