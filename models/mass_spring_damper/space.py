"""Example 2.1: a mass on a spring and a damper. x is zero where the spring is relaxed."""

import pymunk

MASS = 1.3  # kg
STIFFNESS = 47.0  # N/m
DAMPING = 0.9  # N*s/m
REST_LENGTH = 0.75  # m, from the wall to the face of the mass

# Shapes are for the eye alone: they collide with nothing, and weigh nothing.
NOTHING = pymunk.ShapeFilter(mask=0)


def build():
    """Build the space, seen from the side; the floor bears the weight."""
    space = pymunk.Space()
    space.gravity = (0, 0)

    # An infinite moment of inertia keeps the mass from turning.
    mass = pymunk.Body(MASS, float("inf"))
    box = pymunk.Poly.create_box(mass, (0.3, 0.3))
    box.color = (41, 107, 173, 255)

    ground = space.static_body
    floor = pymunk.Segment(ground, (-0.95, -0.16), (0.6, -0.16), 0.01)
    wall = pymunk.Segment(ground, (-0.92, -0.16), (-0.92, 0.3), 0.02)
    floor.color = wall.color = (115, 120, 128, 255)
    box.filter = floor.filter = wall.filter = NOTHING

    # Its line runs through the mass's centre, so that it pulls along x alone.
    spring = pymunk.DampedSpring(
        ground, mass, (-0.9, 0), (-0.15, 0), REST_LENGTH, STIFFNESS, DAMPING
    )
    space.add(mass, box, floor, wall, spring)
    return space, {"mass": mass}
