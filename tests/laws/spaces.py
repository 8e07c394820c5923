"""Spaces of pymunk in which every kind of joint acts, or shapes touch."""

HEAD = """import pymunk

def build():
    space = pymunk.Space()
    space.gravity = (0, -9.81)
    ground = space.static_body
    bodies = {}

    def body(name, mass, moment, place, center=(0, 0)):
        bodies[name] = one = pymunk.Body(mass, moment)
        one.position, one.center_of_gravity = place, center
        space.add(one)
        return one

"""

TAIL = """
    return space, bodies
"""

BALL = (
    HEAD
    + """    space.collision_slop = 0.001
    floor = pymunk.Segment(ground, (-3, 0), (3, 0.2), 0.02)
    floor.friction, floor.elasticity = 0.1, 0.5
    ball = pymunk.Circle(body("ball", 1.2, 0.01, (0, 0.4)), 0.15)
    ball.friction, ball.elasticity = 0.9, 0.6
    space.add(floor, ball)
"""
    + TAIL
)

STACK = (
    HEAD
    + """    space.collision_bias = 0.001
    space.iterations = 12
    floor = pymunk.Segment(ground, (-3, 0), (3, 0), 0.02)
    floor.friction, floor.surface_velocity = 0.7, (0.3, 0)
    space.add(floor)
    for k in range(2):
        box = pymunk.Poly.create_box(body(f"box{k}", 1 + k, 0.02, (0.05 * k, 0.15 + 0.25 * k)),
                                     (0.4, 0.2), 0.01)
        box.friction, box.elasticity = 0.5, 0.2 * k
        space.add(box)
"""
    + TAIL
)

JOINTS = (
    HEAD
    + """    space.damping = 0.9
    a = body("a", 1.2, 0.01, (0, 0.4))
    b = body("b", 0.8, 0.02, (0.1, 0.8), (0.02, 0.01))
    c = body("c", 0.5, 0.01, (1, 0.8))
    d = body("d", 0.3, 0.004, (1, 0.5))
    limit = pymunk.RotaryLimitJoint(a, b, -0.3, 0.4)
    limit.max_force = 4
    motor = pymunk.SimpleMotor(ground, b, 2.0)
    motor.max_force = 0.4
    pivot = pymunk.PivotJoint(c, d, (1, 0.65))
    pivot.max_force, pivot.max_bias = 30, 0.05
    gear = pymunk.GearJoint(c, d, 0.2, 2.5)
    gear.max_force = 3
    pin = pymunk.PinJoint(b, d, (0.1, 0), (0, 0.05))
    pin.max_bias, pin.error_bias = 2, 0.01
    space.add(
        limit, motor, pivot, gear, pin,
        pymunk.SlideJoint(ground, a, (0, 1), (0.05, 0), 0.1, 0.9),
        pymunk.DampedSpring(a, b, (0, 0.1), (0.1, 0), 0.3, 20, 0.5),
        pymunk.DampedRotarySpring(a, b, 0.1, 2, 0.05),
        pymunk.GrooveJoint(ground, c, (0.9, 0.8), (1.1, 0.85), (0, 0.05)),
    )
"""
    + TAIL
)
