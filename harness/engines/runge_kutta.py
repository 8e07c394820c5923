"""The classical Runge-Kutta method of order 4 on an engine's accelerations, Munthe-Kaas's for
rotations.

Munthe-Kaas (1999), Appl. Numer. Math. 29, 115-127: the stages add displacements from the step's
start. The rotation of a free or ball joint is a quaternion here.

All states of a batch step together, because for few numbers a call of Python and numpy takes longer
than an engine's accelerations.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.reference.mechanism.rotations import (
    angular_velocity,
    coordinate_rate,
    exponential,
    exponential_rate,
    minimal_coordinates,
    quaternion_product,
    unit_quaternion,
)
from .protocol import Array, Force, StateForce

FREE, BALL = 6, 3
"""Numbers of coordinates of a free and of a ball joint."""


class JointLayout:
    """Places of the joints among the numbers of a state.

    Positions x are the coordinates z with a quaternion, real part first, for the three coordinates
    of each rotation (`reference.mechanism.rotations` defines them). Velocities m are the rates w
    with angular velocities about the body's axes; a free joint's linear one is along the world's.

    Args:
        sizes: number of coordinates of each joint: `FREE`, `BALL`, 2 for two hinges, or 1.

    Attributes:
        singles, singles_x: indices of slides and hinges in z and in x.
        turns, origins: slices of rotation and place of each other joint in z and in x; a ball's
            place is empty.
    """

    def __init__(self, sizes: Sequence[int]) -> None:
        self.turns: list[tuple[slice, slice]] = []
        self.origins: list[tuple[slice, slice]] = []
        singles, plain, i = list[tuple[int, int]](), list[tuple[int, int]](), 0
        for size in sizes:
            shift, turn = len(self.turns), i + (size - BALL if size >= BALL else size)
            rows = [(k, k + shift) for k in range(i, turn)]
            plain += rows
            if size < BALL:
                singles += rows
            else:
                self.origins.append((slice(i, turn), slice(i + shift, turn + shift)))
                self.turns.append((slice(turn, turn + 3), slice(turn + shift, turn + shift + 4)))
            i += size
        self.singles, self.singles_x = np.array(singles, dtype=int).reshape(-1, 2).T
        self._plain, self._plain_x = np.array(plain, dtype=int).reshape(-1, 2).T

    def to_state(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return positions x and velocities m of coordinates and their rates, (..., nz)."""
        if not self.turns:
            return q, v
        x, m = np.empty((*q.shape[:-1], q.shape[-1] + len(self.turns))), v.copy()
        x[..., self._plain_x] = q[..., self._plain]
        for here, there in self.turns:
            p, rate = q[..., here].T, v[..., here].T
            x[..., there], m[..., here] = unit_quaternion(p).T, angular_velocity(p, rate).T
        return x, m

    def place(self, x: Array) -> Array:
        """Return the coordinates of positions x, near to their quaternions."""
        if not self.turns:
            return x
        z = np.empty((*x.shape[:-1], x.shape[-1] - len(self.turns)))
        z[..., self._plain] = x[..., self._plain_x]
        for here, there in self.turns:
            z[..., here] = minimal_coordinates(x[..., there].T, x[..., there].T).T
        return z

    def rates(self, z: Array, m: Array) -> Array:
        """Return the rates of coordinates z, by velocities m."""
        return self._turned(coordinate_rate, z, m)

    def displaced(self, x: Array, moved: Array) -> Array:
        """Return positions after a displacement; bodies rotate about their own axes."""
        out = x.copy()
        out[..., self._plain_x] += moved[..., self._plain]
        for here, there in self.turns:
            turn = exponential(moved[..., here].T)
            out[..., there] = quaternion_product(x[..., there].T, turn).T
        return out

    def displacement_rate(self, moved: Array, m: Array) -> Array:
        """Return velocities m as rates of the displacement."""
        return self._turned(exponential_rate, moved, m)

    def _turned(self, how: Callable[[Array, Array], Array], z: Array, m: Array) -> Array:
        out = m.copy() if self.turns else m
        for here, _ in self.turns:
            out[..., here] = how(z[..., here].T, m[..., here].T).T
        return out


Accelerations = Callable[[Array, Array, Array], Array]
"""dm/dt, (B, n), of positions x, velocities m and forces of B states.

`JointLayout` defines x and m; forces have the axes of m. The rows are independent.
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
        layout: of the joints.
        single: a faster function for one state; not with rotations.
    """

    def __init__(
        self,
        accelerations: Accelerations,
        layout: JointLayout,
        single: SingleAccelerations | None = None,
    ) -> None:
        self._accelerations, self._layout, self._single_state = accelerations, layout, single

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
        x, m = self._layout.to_state(q[rows], v[rows])
        for row in range(n // every):
            if not len(rows):
                break
            for i in range(row * every, (row + 1) * every):
                x, m = self.stepped(x, m, self._held(force, rows, i, x), h)
            z = self._layout.place(x)
            w = self._layout.rates(z, m)
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
            return np.zeros((len(x), x.shape[1] - len(self._layout.turns)))
        if isinstance(force, StateForce):
            positions = self._layout.place(x).tolist()
            inputs = force.inputs[rows, i].tolist()
            return np.array(
                [force.evaluate(z, u) for z, u in zip(positions, inputs, strict=True)], dtype=float
            )
        held: Array = force[rows, i]
        return held

    def stepped(self, x: Array, m: Array, f: Array, h: float) -> tuple[Array, Array]:
        """Return the next positions and velocities, by four accelerations."""
        acceleration, layout = self._accelerations, self._layout
        if not layout.turns:
            return _step_plain(acceleration, x, m, f, h)
        half, sixth = 0.5 * h, h / 6
        speeds, gains = [m], [acceleration(x, m, f)]
        for share in (half, half, h):
            moved, now = share * speeds[-1], m + share * gains[-1]
            speeds.append(layout.displacement_rate(moved, now))
            gains.append(acceleration(layout.displaced(x, moved), now, f))
        moved = sixth * _weighted_sum(speeds)
        return layout.displaced(x, moved), m + sixth * _weighted_sum(gains)


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
    return (x + sixth * (m + m4 + 2 * (m2 + m3)), m + sixth * (a1 + a4 + 2 * (a2 + a3)))


def _weighted_sum(stages: list[Array]) -> Array:
    first, second, third, fourth = stages
    return first + fourth + 2 * (second + third)
