"""Example 2.4: two masses, each on a spring of its own to a wall, joined by a damper."""

import pymunk

MASS_1 = 1.6  # kg
MASS_2 = 0.9  # kg
STIFFNESS_1 = 55.0  # N/m
STIFFNESS_2 = 70.0  # N/m
DAMPING = 1.1  # N*s/m
DISTANCE = 1.2  # m, between the centres where the springs are relaxed
REST_LENGTH = 0.75  # m, from each wall to the face of its mass there

# Shapes are for the eye alone: they collide with nothing, and weigh nothing.
NOTHING = pymunk.ShapeFilter(mask=0)


def build():
    """Build the space, seen from the side; the floor bears the weight."""
    space = pymunk.Space()
    space.gravity = (0, 0)

    # An infinite moment of inertia keeps a mass from turning.
    first = pymunk.Body(MASS_1, float("inf"))
    second = pymunk.Body(MASS_2, float("inf"))
    second.position = (DISTANCE, 0)
    first_box = pymunk.Poly.create_box(first, (0.3, 0.3))
    first_box.color = (41, 107, 173, 255)
    second_box = pymunk.Poly.create_box(second, (0.3, 0.3))
    second_box.color = (51, 140, 102, 255)

    ground = space.static_body
    floor = pymunk.Segment(ground, (-0.95, -0.16), (2.15, -0.16), 0.01)
    left_wall = pymunk.Segment(ground, (-0.92, -0.16), (-0.92, 0.3), 0.02)
    right_wall = pymunk.Segment(ground, (2.12, -0.16), (2.12, 0.3), 0.02)
    floor.color = left_wall.color = right_wall.color = (115, 120, 128, 255)
    shapes = (first_box, second_box, floor, left_wall, right_wall)
    for shape in shapes:
        shape.filter = NOTHING

    # Springs and damper are on one line through both centres, so that they pull along x alone.
    left_spring = pymunk.DampedSpring(
        ground, first, (-0.9, 0), (-0.15, 0), REST_LENGTH, STIFFNESS_1, damping=0
    )
    right_spring = pymunk.DampedSpring(
        second, ground, (0.15, 0), (2.1, 0), REST_LENGTH, STIFFNESS_2, damping=0
    )
    # Without stiffness, the rest length has no effect.
    damper = pymunk.DampedSpring(
        first, second, (0.15, 0), (-0.15, 0), rest_length=0.9, stiffness=0, damping=DAMPING
    )
    space.add(first, second, *shapes, left_spring, right_spring, damper)
    return space, {"first": first, "second": second}
