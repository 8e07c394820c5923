"""A cart that rolls against a buffer: a spring behind a gap."""

import pymunk

MASS = 2.0  # kg
STIFFNESS = 800.0  # N/m
GAP = 0.5  # m

LENGTH = 10.0  # m, from the anchor to the undeformed buffer


def push(spring, distance):
    """Push the cart back, and never pull it."""
    return max(0.0, STIFFNESS * (LENGTH - distance))


def build():
    """Build the space, seen from the side, without gravity."""
    space = pymunk.Space()
    cart = pymunk.Body(MASS, float("inf"))
    buffer = pymunk.DampedSpring(
        space.static_body, cart, (GAP + LENGTH, 0), (0, 0), LENGTH, STIFFNESS, 0.0
    )
    buffer.force_func = push
    space.add(cart, buffer)
    return space, {"cart": cart}
