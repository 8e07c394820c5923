"""A weight on a rod that nothing brakes, as one would write it first."""

import pymunk


def build():
    """Build the space."""
    space = pymunk.Space()
    space.gravity = (0, -9.81)
    weight = pymunk.Body(1, float("inf"))
    weight.position = (0, -3)
    space.add(weight, pymunk.PinJoint(space.static_body, weight))
    return space, {"weight": weight}
