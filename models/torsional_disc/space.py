"""Example 2.2: a disc at the end of a shaft that twists like a spring. Undamped."""

import pymunk

MASS = 4.2  # kg; the disc stays in its place, so that its mass has no effect
INERTIA = 0.021  # kg*m^2, polar, about the shaft
STIFFNESS = 0.85  # N*m/rad

# Shapes are for the eye alone: they collide with nothing, and weigh nothing.
NOTHING = pymunk.ShapeFilter(mask=0)


def build():
    """Build the space, seen along the shaft."""
    space = pymunk.Space()
    space.gravity = (0, 0)

    disc = pymunk.Body(MASS, INERTIA)
    rim = pymunk.Circle(disc, 0.1)
    rim.color = (41, 107, 173, 255)
    spoke = pymunk.Segment(disc, (0, 0), (0.09, 0), 0.006)
    spoke.color = (247, 247, 242, 255)
    rim.filter = spoke.filter = NOTHING

    ground = space.static_body
    # It pulls angle(disc) - angle(ground) to minus the rest angle, which is zero here.
    shaft = pymunk.DampedRotarySpring(ground, disc, 0, STIFFNESS, damping=0)
    bearing = pymunk.PivotJoint(ground, disc, (0, 0))
    space.add(disc, rim, spoke, shaft, bearing)
    return space, {"disc": disc}
