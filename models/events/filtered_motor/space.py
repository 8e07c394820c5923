"""A mass that a motor pushes; its rotor lags behind its torque, and its force is limited."""

import pymunk

MASS = 1.0  # kg
FRICTION = 1.5  # N*s/m
MOMENT = 0.002  # kg*m^2
DRAG = 0.02  # N*m*s/rad
TORQUE = 0.3  # N*m
GAIN = 1.0  # N*s/rad
LIMIT = 10.0  # N


def drive(spring, angle):
    """Return the torque on the rotor."""
    return TORQUE - DRAG * spring.b.angular_velocity


def build():
    """Build the space, seen from above; the motor pushes from an anchor at -20 m."""
    space = pymunk.Space()
    mass = pymunk.Body(MASS, float("inf"))
    rotor = pymunk.Body(1.0, MOMENT)
    rotor.position = (-20, 0)

    def push(spring, distance):
        """Return the force on the mass, away from the anchor."""
        force = GAIN * rotor.angular_velocity
        return max(-LIMIT, min(LIMIT, force)) - FRICTION * mass.velocity.x

    motor = pymunk.DampedSpring(space.static_body, mass, (-20, 0), (0, 0), 20.0, 0.0, 0.0)
    motor.force_func = push
    torque = pymunk.DampedRotarySpring(space.static_body, rotor, 0.0, 0.0, 0.0)
    torque.torque_func = drive
    space.add(mass, rotor, motor, torque)
    return space, {"mass": mass, "rotor": rotor}
