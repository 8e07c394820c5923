"""A pendulum that swings against a stop."""

from math import cos, sin

import pymunk

MASS = 0.45  # kg
LENGTH = 0.75  # m
GRAVITY = 9.81  # m/s^2
LIMIT = 0.4  # rad
RESTITUTION = 0.6

RADIUS = 0.05  # m, of the bob


def build():
    """Build the space, seen from the side, with the pivot at the origin."""
    space = pymunk.Space()
    space.gravity = (0, -GRAVITY)

    # A point mass does not turn; a pin joint holds its distance.
    bob = pymunk.Body(MASS, float("inf"))
    bob.position = (0, -LENGTH)
    ball = pymunk.Circle(bob, RADIUS)
    ball.elasticity = RESTITUTION
    rod = pymunk.PinJoint(space.static_body, bob, (0, 0), (0, 0))
    rod.distance = LENGTH
    rod.error_bias = 1e-10

    # The stop is a wall across the path of the bob. A joint limit of pymunk has no restitution.
    ends = [
        (r * sin(LIMIT) + RADIUS * cos(LIMIT), -r * cos(LIMIT) + RADIUS * sin(LIMIT))
        for r in (LENGTH / 2, 2 * LENGTH)
    ]
    wall = pymunk.Segment(space.static_body, *ends, 0)
    wall.elasticity = 1.0  # the product of both surfaces counts
    space.add(bob, ball, rod, wall)
    return space, {"bob": bob}
