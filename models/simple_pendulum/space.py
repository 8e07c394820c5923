"""Example 3.1: a point mass on a massless rod. theta is zero where it hangs."""

import pymunk

MASS = 0.45  # kg
LENGTH = 0.75  # m
GRAVITY = 9.81  # m/s^2

# Shapes are for the eye alone: they collide with nothing, and weigh nothing.
NOTHING = pymunk.ShapeFilter(mask=0)


def build():
    """Build the space, seen from the side, with the pivot at the origin."""
    space = pymunk.Space()
    space.gravity = (0, -GRAVITY)

    # A point mass does not turn, so its body has an infinite moment of inertia, and the rod is a
    # pin joint, which holds a distance. A body that turns with the rod would need a tiny moment,
    # and a joint that holds a point, which is far less exact.
    bob = pymunk.Body(MASS, float("inf"))
    bob.position = (0, -LENGTH)
    ball = pymunk.Circle(bob, 0.05)
    ball.color = (179, 51, 51, 255)

    ground = space.static_body
    beam = pymunk.Segment(ground, (-0.2, 0), (0.2, 0), 0.015)
    beam.color = (115, 120, 128, 255)
    ball.filter = beam.filter = NOTHING

    rod = pymunk.PinJoint(ground, bob, (0, 0), (0, 0))
    rod.distance = LENGTH
    # What is left of an error in the rod's length after a second. The default, 0.9**60, lets more
    # of it stand and takes more energy out of the swing; 0 takes none, but corrects so abruptly
    # that the motion settles only at small steps.
    rod.error_bias = 1e-10
    space.add(bob, ball, beam, rod)
    return space, {"bob": bob}
