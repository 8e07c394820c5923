"""Example 2.3: two masses joined by a spring and a damper, free to drift along a rail."""

import pymunk

MASS_1 = 1.1  # kg
MASS_2 = 0.7  # kg
STIFFNESS = 38.0  # N/m
DAMPING = 0.35  # N*s/m
DISTANCE = 1.5  # m, between the centres where the spring is relaxed
REST_LENGTH = 1.2  # m, between the faces of the two boxes there

# Shapes are for the eye alone: they collide with nothing, and weigh nothing.
NOTHING = pymunk.ShapeFilter(mask=0)


def build():
    """Build the space, seen from the side; the rail bears the weight."""
    space = pymunk.Space()
    space.gravity = (0, 0)

    # An infinite moment of inertia keeps a mass from turning.
    first = pymunk.Body(MASS_1, float("inf"))
    second = pymunk.Body(MASS_2, float("inf"))
    # Far enough apart that they never meet: past each other the spring would pull the other way.
    second.position = (DISTANCE, 0)
    first_box = pymunk.Poly.create_box(first, (0.3, 0.3))
    first_box.color = (41, 107, 173, 255)
    second_box = pymunk.Poly.create_box(second, (0.3, 0.3))
    second_box.color = (51, 140, 102, 255)

    rail = pymunk.Segment(space.static_body, (-4, -0.17), (12, -0.17), 0.02)
    rail.color = (115, 120, 128, 255)
    first_box.filter = second_box.filter = rail.filter = NOTHING

    # Its line runs through both centres, so that it pulls along x alone.
    spring = pymunk.DampedSpring(
        first, second, (0.15, 0), (-0.15, 0), REST_LENGTH, STIFFNESS, DAMPING
    )
    space.add(first, second, first_box, second_box, rail, spring)
    return space, {"first": first, "second": second}
