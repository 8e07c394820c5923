"""A mass that a position servo with limited force moves to a target."""

import pymunk

MASS = 1.0  # kg
POSITION_GAIN = 60.0  # N/m
VELOCITY_GAIN = 6.0  # N*s/m
LIMIT = 10.0  # N
TARGET = 0.6  # m


def servo(spring, distance):
    """Return the force on the mass, away from the anchor."""
    mass = spring.b
    force = POSITION_GAIN * (TARGET - mass.position.x) - VELOCITY_GAIN * mass.velocity.x
    return max(-LIMIT, min(LIMIT, force))


def build():
    """Build the space, seen from above; the servo pushes from an anchor at -20 m."""
    space = pymunk.Space()
    mass = pymunk.Body(MASS, float("inf"))
    drive = pymunk.DampedSpring(space.static_body, mass, (-20, 0), (0, 0), 20.0, 0.0, 0.0)
    drive.force_func = servo
    space.add(mass, drive)
    return space, {"mass": mass}
