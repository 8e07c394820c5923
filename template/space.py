"""The same rod in pymunk. `build` makes the space and names the bodies that move."""

import pymunk

# The numbers at the top, each once: space.py.toml says what they stand for.
MASS = 0.8  # kg
LENGTH = 0.6  # m
INERTIA = 0.024  # kg*m^2, m*l^2/12, about the centre
FRICTION = 0.05  # N*m*s/rad
GRAVITY = 9.81  # m/s^2

# Shapes are for the eye alone: they collide with nothing, and weigh nothing.
NOTHING = pymunk.ShapeFilter(mask=0)


def build():
    """Build the space, seen from the side, with the pin at the origin."""
    space = pymunk.Space()
    space.gravity = (0, -GRAVITY)
    # Pin and friction share the rod, so that each disturbs the other; so many rounds settle them.
    space.iterations = 20

    rod = pymunk.Body(MASS, INERTIA)
    rod.position = (0, -LENGTH / 2)
    bar = pymunk.Segment(rod, (0, LENGTH / 2), (0, -LENGTH / 2), 0.015)
    bar.filter = NOTHING

    ground = space.static_body
    pin = pymunk.PivotJoint(ground, rod, (0, 0), (0, LENGTH / 2))
    # What is left of a joint's error after a second. The default, 0.9**60, takes energy out of the
    # swing at ordinary steps.
    pin.error_bias = 1e-10
    friction = pymunk.DampedRotarySpring(ground, rod, 0, stiffness=0, damping=FRICTION)
    space.add(rod, bar, pin, friction)
    return space, {"rod": rod}
