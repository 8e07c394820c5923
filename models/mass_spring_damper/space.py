import pymunk

MASS = 1.3
STIFFNESS = 47.0
DAMPING = 0.9


def build():
    space = pymunk.Space()
    space.gravity = (0, 0)
    mass = pymunk.Body(MASS, float("inf"))
    mass.position = (0, 0)
    space.add(mass)
    wall = space.static_body
    space.add(pymunk.DampedSpring(wall, mass, (-1.0, 0), (0, 0), 1.0, STIFFNESS, DAMPING))
    return space, {"mass": mass}
