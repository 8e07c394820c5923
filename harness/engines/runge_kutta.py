"""The classical rule of order four on an engine's accelerations, and of Munthe-Kaas on a free root.

Munthe-Kaas (1999), Appl. Numer. Math. 29, 115-127: what is summed are moves from the step's start.
The rotation of a root is a quaternion here, its velocity along the world's axes at its origin, and
angular about its own axes (`harness.engines.attitude` has the coordinates that the harness sees).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from harness.engines.attitude import (
    angular_velocity,
    coordinates,
    exponential,
    product,
    quaternion,
    rate,
)
from harness.engines.one_by_one import Stepper
from harness.engines.protocol import Array

Accelerations = Callable[[Array, Array, Array], Array]
"""dm/dt of positions x, velocities m and forces; of a free root x begins with its place and its
quaternion, real part first, m and forces with three numbers each along the world's axes and three
about its own."""


WEIGHTS = np.array([1, 2, 2, 1]) / 6
"""Of the four stages."""


class RungeKutta(Stepper):
    """A model whose engine tells accelerations.

    Args:
        accelerations: of the engine.
        floats: whether the first six coordinates are those of a free root.
    """

    def __init__(self, accelerations: Accelerations, floats: bool) -> None:
        self._accelerations, self._floats = accelerations, floats
        self._x = self._m = np.zeros(0)

    def reset(self, q: Array, v: Array) -> None:
        """Put it into a state."""
        self._x, self._m = to_state(q, v) if self._floats else (q, v)

    def position(self) -> Array:
        """Its coordinates; of a rotation's two, those that go on from the start."""
        return place(self._x) if self._floats else self._x

    def state(self) -> tuple[Array, Array]:
        """Positions and velocities."""
        z = self.position()
        return (z, rates(z, self._m)) if self._floats else (z, self._m)

    def step(self, h: float, force: Array | None) -> None:
        """By four accelerations."""
        x, m, n = self._x, self._m, len(self._m)
        f = np.zeros(n) if force is None else force
        if not self._floats:
            self._x, self._m = self._straight(x, m, f, h)
            return
        speeds, gains = np.empty((4, n)), np.empty((4, n))
        speeds[0], gains[0] = m, self._accelerations(x, m, f)
        for stage, share in enumerate((0.5 * h, 0.5 * h, h), start=1):
            moved = share * speeds[stage - 1]
            now = m + share * gains[stage - 1]
            speeds[stage] = unturned(moved, now)
            gains[stage] = self._accelerations(advanced(x, moved), now, f)
        self._x = advanced(x, h * (WEIGHTS @ speeds))
        self._m = m + h * (WEIGHTS @ gains)

    def _straight(self, x: Array, m: Array, f: Array, h: float) -> tuple[Array, Array]:
        """The same where nothing turns: of few numbers, arrays of stages would cost as much."""
        at, half = self._accelerations, 0.5 * h
        a1 = at(x, m, f)
        m2 = m + half * a1
        a2 = at(x + half * m, m2, f)
        m3 = m + half * a2
        a3 = at(x + half * m2, m3, f)
        m4 = m + h * a3
        a4 = at(x + h * m3, m4, f)
        sixth = h / 6
        return (
            x + sixth * (m + m4 + 2 * (m2 + m3)),
            m + sixth * (a1 + a4 + 2 * (a2 + a3)),
        )


def to_state(q: Array, v: Array) -> tuple[Array, Array]:
    """Positions x and velocities m of coordinates and their rates."""
    x = np.concatenate([q[:3], quaternion(q[3:6]), q[6:]])
    return x, np.concatenate([v[:3], angular_velocity(q[3:6], v[3:6]), v[6:]])


def place(x: Array) -> Array:
    """Coordinates of positions x: of a rotation's two those nearer to its quaternion."""
    return np.concatenate([x[:3], coordinates(x[3:7], x[3:7]), x[7:]])


def rates(z: Array, m: Array) -> Array:
    """Of coordinates z, by velocities m."""
    return np.concatenate([m[:3], rate(z[3:6], m[3:6]), m[6:]])


def advanced(x: Array, moved: Array) -> Array:
    """Positions after a move: the root turns on about one of its axes."""
    turned = product(x[3:7], exponential(moved[3:6]))
    return np.concatenate([x[:3] + moved[:3], turned, x[7:] + moved[6:]])


def unturned(moved: Array, m: Array) -> Array:
    """Velocities m as the rate of the move: the inverse of the exponential's differential."""
    by, spin = moved[3:6], m[3:6]
    square = float(by @ by)
    half = np.sqrt(square) / 2
    # 1/12 + square/720 is the series, whose next term is below the last digit there.
    share = 1 / 12 + square / 720 if square < 1e-4 else (1 - half / np.tan(half)) / square
    once = np.cross(by, spin)
    turned = spin + once / 2 + share * np.cross(by, once)
    return np.concatenate([m[:3], turned, m[6:]])
