"""The classical Runge-Kutta method of order 4 on an engine's accelerations, Munthe-Kaas's for a
free root.

Munthe-Kaas (1999), Appl. Numer. Math. 29, 115-127: the stages add displacements from the step's
start. A root's rotation is a quaternion here. Its velocity is along the world's axes at its origin,
and angular about its own axes (`reference.mechanism.rotations` defines the coordinates).

All states of a batch step together, because for few numbers a call of Python and numpy takes longer
than an engine's accelerations.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.engines.protocol import Array, Force, StateForce
from physics_crosscheck.reference.mechanism.rotations import (
    angular_velocity,
    coordinate_rate,
    exponential,
    exponential_rate,
    minimal_coordinates,
    quaternion_product,
    unit_quaternion,
)

Accelerations = Callable[[Array, Array, Array], Array]
"""dm/dt, (B, n), of positions x, velocities m and forces of B states.

For a free root, x begins with its position and its quaternion, real part first; m and the forces
begin with three numbers along the world's axes and three about its own. The rows are independent.
"""

SingleAccelerations = Callable[[Array, Array, Array], Array]
"""The same for one state: x, m, f and dm/dt are (n,) each, bitwise equal to a batch's row."""


def each_alone(accelerations: SingleAccelerations) -> Accelerations:
    """Return a function of all states, from a function of one whose x, m and f are (n,) each."""

    def of_all(x: Array, m: Array, f: Array) -> Array:
        return np.array([accelerations(*row) for row in zip(x, m, f, strict=True)])

    return of_all


class RungeKutta:
    """An integrator of a model whose engine provides accelerations.

    Args:
        accelerations: of the engine.
        floats: whether the first six coordinates are those of a free root.
        single: a faster function for one state; not for a free root.
    """

    def __init__(
        self, accelerations: Accelerations, floats: bool, single: SingleAccelerations | None = None
    ) -> None:
        self._accelerations, self._floats, self._single_state = accelerations, floats, single

    @np.errstate(all="ignore")  # a diverging motion is returned as it is
    def rollout(
        self, q: Array, v: Array, h: float, n: int, force: Force, every: int
    ) -> tuple[Array, Array]:
        """Return a rollout as in `Model.rollout`; after a non-finite state the rest is NaN."""
        out_q = np.full((len(q), n // every, q.shape[1]), np.nan)
        out_v = np.full_like(out_q, np.nan)
        rows = np.flatnonzero(np.isfinite(q).all(axis=1) & np.isfinite(v).all(axis=1))
        if len(rows) == 1 and self._single_state is not None and not isinstance(force, StateForce):
            row = int(rows[0])
            pushed = None if force is None else force[row]
            self._single_rollout(q[row], v[row], h, n, pushed, every, out_q[row], out_v[row])
            return out_q, out_v
        x, m = to_state(q[rows], v[rows]) if self._floats else (q[rows], v[rows])
        for row in range(n // every):
            if not len(rows):
                break
            for i in range(row * every, (row + 1) * every):
                x, m = self.stepped(x, m, self._held(force, rows, i, x), h)
            z = place(x) if self._floats else x
            w = rates(z, m) if self._floats else m
            out_q[rows, row], out_v[rows, row] = z, w
            fine = np.isfinite(z).all(axis=1) & np.isfinite(w).all(axis=1)
            if not fine.all():
                rows, x, m = rows[fine], x[fine], m[fine]
        return out_q, out_v

    def _single_rollout(
        self,
        x: Array,
        m: Array,
        h: float,
        n: int,
        force: Array | None,
        every: int,
        out_q: Array,
        out_v: Array,
    ) -> None:
        """Write a single state's motion into (rows, n) arrays."""
        assert self._single_state is not None
        f = np.zeros_like(x)
        for row in range(n // every):
            for i in range(row * every, (row + 1) * every):
                x, m = _step_plain(self._single_state, x, m, f if force is None else force[i], h)
            out_q[row], out_v[row] = x, m
            if not (np.isfinite(x).all() and np.isfinite(m).all()):
                break

    def _held(self, force: Force, rows: NDArray[np.intp], i: int, x: Array) -> Array:
        """Return the forces on states over step i, (B, n)."""
        if force is None:
            return np.zeros((len(x), x.shape[1] - self._floats))
        if isinstance(force, StateForce):
            positions = (place(x) if self._floats else x).tolist()
            inputs = force.inputs[rows, i].tolist()
            return np.array(
                [force.evaluate(z, u) for z, u in zip(positions, inputs, strict=True)], dtype=float
            )
        held: Array = force[rows, i]
        return held

    def stepped(self, x: Array, m: Array, f: Array, h: float) -> tuple[Array, Array]:
        """Return the next positions and velocities, by four accelerations."""
        acceleration = self._accelerations
        if not self._floats:
            return _step_plain(acceleration, x, m, f, h)
        half, sixth = 0.5 * h, h / 6
        speeds, gains = [m], [acceleration(x, m, f)]
        for share in (half, half, h):
            moved, now = share * speeds[-1], m + share * gains[-1]
            speeds.append(displacement_rate(moved, now))
            gains.append(acceleration(displaced(x, moved), now, f))
        return displaced(x, sixth * _weighted_sum(speeds)), m + sixth * _weighted_sum(gains)


def _step_plain(
    acceleration: Accelerations, x: Array, m: Array, f: Array, h: float
) -> tuple[Array, Array]:
    """Step coordinates whose rates are the velocities."""
    half, sixth = 0.5 * h, h / 6
    a1 = acceleration(x, m, f)
    m2 = m + half * a1
    a2 = acceleration(x + half * m, m2, f)
    m3 = m + half * a2
    a3 = acceleration(x + half * m2, m3, f)
    m4 = m + h * a3
    a4 = acceleration(x + h * m3, m4, f)
    return (
        x + sixth * (m + m4 + 2 * (m2 + m3)),
        m + sixth * (a1 + a4 + 2 * (a2 + a3)),
    )


def _weighted_sum(stages: list[Array]) -> Array:
    first, second, third, fourth = stages
    return first + fourth + 2 * (second + third)


def to_state(q: Array, v: Array) -> tuple[Array, Array]:
    """Return positions x and velocities m of coordinates and their rates, (..., nz)."""
    p, rate = q[..., 3:6].T, v[..., 3:6].T
    turn, spin = unit_quaternion(p).T, angular_velocity(p, rate).T
    return _joined(q[..., :3], turn, q[..., 6:]), _joined(v[..., :3], spin, v[..., 6:])


def place(x: Array) -> Array:
    """Return the coordinates of positions x, near to their quaternions."""
    return _joined(x[..., :3], minimal_coordinates(x[..., 3:7].T, x[..., 3:7].T).T, x[..., 7:])


def rates(z: Array, m: Array) -> Array:
    """Return the rates of coordinates z, by velocities m."""
    return _joined(m[..., :3], coordinate_rate(z[..., 3:6].T, m[..., 3:6].T).T, m[..., 6:])


def displaced(x: Array, moved: Array) -> Array:
    """Return positions after a displacement; the root rotates about its own axes."""
    turned = quaternion_product(x[..., 3:7].T, exponential(moved[..., 3:6].T)).T
    return _joined(x[..., :3] + moved[..., :3], turned, x[..., 7:] + moved[..., 6:])


def displacement_rate(moved: Array, m: Array) -> Array:
    """Return velocities m as rates of the displacement."""
    turning = exponential_rate(moved[..., 3:6].T, m[..., 3:6].T).T
    return _joined(m[..., :3], turning, m[..., 6:])


def _joined(*parts: Array) -> Array:
    joined: Array = np.concatenate(parts, axis=-1)
    return joined
