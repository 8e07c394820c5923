"""Quantities that the numbers of a file act as: textbook numbers of its laws, without a motion.

One row of a constraint with inverse inertia A gives the acceleration (1 - s) a0 + s aref with s = A
/ (A + R): a spring and a damper. Source: MuJoCo's documentation, Computation, Solver parameters.
"""

from dataclasses import dataclass

import numpy as np

from physics_crosscheck.reference.mechanism.laws import ContactParameters, Laws, Softness
from .soft import gains, impedance

SLOPE = np.radians(10.0)
"""Slope on which the creep of a contact is stated."""

_HALVINGS = 200


@dataclass(frozen=True, kw_only=True)
class Oscillator:
    """A mass on a spring and a damper: x'' = -w^2 x - 2 z w x'.

    Attributes:
        rate: w, 1/s.
        damping: z.
    """

    rate: float
    damping: float

    @property
    def rebound(self) -> float:
        """Speed after the spring has been pressed, relative to the speed before.

        The contact ends where the force of spring and damper together is zero.
        """
        z = self.damping
        if np.isinf(z):  # no spring
            return 0.0
        if np.isclose(z, 1.0, rtol=1e-9):
            return float(np.exp(-2.0))
        s = np.sqrt(abs(1 - z**2))
        if z < 1:
            return float(np.exp(-z / s * np.arctan2(2 * z * s, 2 * z**2 - 1)))
        return float(np.exp(-z / s * np.arctanh(2 * z * s / (2 * z**2 - 1))))


def pressed(softness: Softness, laws: Laws) -> Oscillator:
    """Return the motion into a constraint, beyond the full depth of its impedance.

    Args:
        softness: of the constraint.
        laws: with the step.
    """
    d, full = impedance(softness, np.inf)
    k, b = gains(softness.reference, full, laws.step, safe=laws.safe)
    s = 1 / (1 + (1 - d) / d)
    rate = float(np.sqrt(s * d * k))
    return Oscillator(rate=rate, damping=s * b / (2 * rate) if rate else np.inf)


def rest_on(
    contact: ContactParameters, laws: Laws, weight: float, force: float
) -> tuple[float, float]:
    """Return how a body rests on one contact: its depth, m, and its creep.

    The creep is its speed along a slope of `SLOPE` degrees on which it sticks, m/s; infinite
    undamped.

    Args:
        contact: its numbers.
        laws: with the cone and the step.
        weight: inverse inertia that scales the contact's softness, 1/kg.
        force: that presses the body, N.
    """
    depth = _depth(contact.softness, laws, _normal_share(contact, laws) * weight * force)
    d, full = impedance(contact.softness, depth)
    sliding = contact.sliding if laws.elliptic and any(contact.sliding) else None
    _, b = gains(sliding or contact.softness.reference, full, laws.step, safe=laws.safe)
    friction = contact.friction[0]
    slope = 1.0 if laws.elliptic else 1 + friction**2
    along = force * np.sin(SLOPE) * weight / laws.friction_ratio
    creep = (1 - d) / (d * b) * slope * along if b else np.inf
    return depth, float(creep)


def _normal_share(contact: ContactParameters, laws: Laws) -> float:
    """Return R along the normal, relative to that of one row: all edges of a pyramid share it."""
    if contact.dimension == 1 or laws.elliptic:
        return 1.0
    slope, edges = contact.friction[0] ** 2, 2 * (contact.dimension - 1)
    return 2 * slope * (1 + slope) / laws.friction_ratio / edges


def _depth(softness: Softness, laws: Laws, acceleration: float) -> float:
    """Return the depth r at which d^2 k r = (1 - d) times the acceleration, by bisection."""

    def unbalanced(r: float) -> float:
        d, full = impedance(softness, r)
        k, _ = gains(softness.reference, full, laws.step, safe=laws.safe)
        return d**2 * k * r - (1 - d) * acceleration

    low, high = 0.0, 1.0
    while unbalanced(high) < 0 and high < 1e9:
        high *= 2
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if unbalanced(middle) > 0 else (middle, high)
    return high


@dataclass(frozen=True, kw_only=True)
class Servo:
    """A driven joint, with all others held.

    Attributes:
        inertia: kg or kg m^2, with armature.
        stiffness: of drives and springs, N/m or N m/rad.
        damping: that the step evaluates at its start, N s/m or N m s/rad.
        implicit_damping: that it evaluates at its end.
        load: force at rest, with the drives at zero error, N or N m.
        step: s.
    """

    inertia: float
    stiffness: float
    damping: float
    implicit_damping: float
    load: float
    step: float

    @property
    def motion(self) -> Oscillator:
        """The motion about the setpoint."""
        rate = float(np.sqrt(self.stiffness / self.inertia))
        damping = self.damping + self.implicit_damping
        return Oscillator(rate=rate, damping=damping / (2 * self.inertia * rate))

    @property
    def sag(self) -> float:
        """Displacement by the load, m or rad."""
        return self.load / self.stiffness

    @property
    def unstable_stiffness(self) -> float:
        """Stiffness above which the semi-implicit step grows; 0 if damping alone makes it grow.

        The step's matrix has the determinant p = (I - h c) / (I + h c') and the trace 1 + p - h^2 k
        / (I + h c'); it is stable for |p| < 1 and |trace| < 1 + p.
        """
        h, difference = self.step, self.implicit_damping - self.damping
        return max(0.0, (4 * self.inertia + 2 * h * difference) / h**2)


def recovery_time(share: float, step: float) -> float:
    """Return the time constant of an error of which each step removes a share, s."""
    return float(-step / np.log1p(-share)) if share < 1 else 0.0
