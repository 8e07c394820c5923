"""Example 2.5: a drum on a spring rolls without slipping; a rod swings from its centre."""

import pymunk

# What the rolling adds to the inertia along x, M/2, is folded into the drum's mass: 3/2 of 2.4 kg.
# Right because the drum moves on a level line: gravity does no work on it.
DRUM_MASS = 3.6  # kg
DRUM_RADIUS = 0.18  # m, to draw it
ROD_MASS = 0.8  # kg
ROD_LENGTH = 0.6  # m
ROD_INERTIA = 0.024  # kg*m^2, m*l^2/12, about its centre
STIFFNESS = 65.0  # N/m
REST_LENGTH = 1.1  # m, from the wall to the drum's centre
GRAVITY = 9.81  # m/s^2

# Shapes are for the eye alone: they collide with nothing, and weigh nothing.
NOTHING = pymunk.ShapeFilter(mask=0)


def build():
    """Build the space, seen from the side, the drum's centre on the line y = 0."""
    space = pymunk.Space()
    space.gravity = (0, -GRAVITY)
    # The joints share a body, so that each disturbs the other; these many rounds settle them.
    space.iterations = 20

    # The rolling is in the mass already: an infinite moment of inertia keeps the drum from turning.
    drum = pymunk.Body(DRUM_MASS, float("inf"))
    wheel = pymunk.Circle(drum, DRUM_RADIUS)
    wheel.color = (41, 107, 173, 255)
    rod = pymunk.Body(ROD_MASS, ROD_INERTIA)
    rod.position = (0, -ROD_LENGTH / 2)
    bar = pymunk.Segment(rod, (0, ROD_LENGTH / 2), (0, -ROD_LENGTH / 2), 0.015)
    bar.color = (179, 51, 51, 255)

    ground = space.static_body
    track = pymunk.Segment(ground, (-1.2, -0.19), (1.2, -0.19), 0.01)
    wall = pymunk.Segment(ground, (-1.12, -0.19), (-1.12, 0.2), 0.02)
    track.color = wall.color = (115, 120, 128, 255)
    shapes = (wheel, bar, track, wall)
    for shape in shapes:
        shape.filter = NOTHING

    # Its line runs along the drum's own, so that its length is linear in x.
    spring = pymunk.DampedSpring(ground, drum, (-1.1, 0), (0, 0), REST_LENGTH, STIFFNESS, damping=0)
    level = pymunk.GrooveJoint(ground, drum, (-5, 0), (5, 0), (0, 0))
    hinge = pymunk.PivotJoint(drum, rod, (0, 0), (0, ROD_LENGTH / 2))
    # What is left of a joint's error after a second. The default, 0.9**60, lets more of it stand
    # and takes more energy out of the swing; 0 takes none, but corrects so abruptly that the motion
    # settles only at small steps.
    level.error_bias = hinge.error_bias = 1e-10
    space.add(drum, rod, *shapes, spring, level, hinge)
    return space, {"drum": drum, "rod": rod}
