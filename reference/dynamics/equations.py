"""The numeric interface of equations of motion, for solvers."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from physics_crosscheck.reference.mechanism.declaration import Declaration, Scenario
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.signal import SignalPiece, pieces


class VectorFunction(Protocol):
    """A vector-valued function of vectors.

    Call it with one array per argument group, each (..., group size). The arrays broadcast against
    each other in all but their last axis. It returns (..., size).
    """

    def __call__(self, *arguments: Array) -> Array:
        """Evaluate."""

    @property
    def scalar(self) -> Callable[..., Sequence[float]]:
        """The same function of plain numbers, one per column."""


class EquationsOfMotion(ABC):
    """M(q) a = f(q, v, u, t) of n coordinates.

    Arguments are positions and velocities, (..., n), inputs, (..., inputs), and time, (..., 1).
    """

    system: Declaration

    @property
    @abstractmethod
    def linear(self) -> bool:
        """True if M is constant and f linear in q, v, u, homogeneous and time-invariant."""

    @property
    @abstractmethod
    def numeric_acceleration(self) -> VectorFunction:
        """a(q, v, u, (t,)), (..., n)."""

    @property
    @abstractmethod
    def numeric_power(self) -> VectorFunction:
        """(energy, power supplied, power dissipated) of (q, v, u, (t,)), (..., 3)."""

    @property
    @abstractmethod
    def numeric_mass(self) -> VectorFunction:
        """M of (q, v, u, (t,)), in row-major order, (..., n * n)."""

    @abstractmethod
    def acceleration_error(
        self,
        states: Array,
        inputs: Array,
        times: Array,
        *,
        off: Array,
        time_error: Array,
        rounded: bool,
    ) -> Array:
        """Return a bound of the error of the accelerations, (..., n).

        Args:
            states, inputs: (..., 2n), (..., inputs).
            times: (...).
            off: error of the inputs, (..., inputs).
            time_error: error of the times, (...).
            rounded: whether to include rounding of the operations, besides errors of inputs and
                times.
        """

    def signals(self, scenario: Scenario) -> tuple[SignalPiece, ...]:
        """Return the inputs of a scenario, split at their breaks.

        Raises:
            DeclarationError: as `pieces`.
        """
        return pieces(self.system, scenario)

    def slopes(self, states: Array, inputs: Array, times: Array) -> Array:
        """Return derivatives of the accelerations by q and v, (B, n, 2n), at B states.

        They are central differences, since the caller needs only a few digits.
        """

        def acceleration(q: Array, v: Array) -> Array:
            return self.numeric_acceleration(q, v, inputs, times[:, None])

        return slopes_of(acceleration, states)


def slopes_of(acceleration: Callable[[Array, Array], Array], states: Array) -> Array:
    """Return derivatives by q and v, (B, n, 2n), of a function of both, each (B, n)."""
    n = states.shape[1] // 2
    step = 1e-6 * np.maximum(np.max(np.abs(states), axis=0), 1e-3)
    columns = []
    for i, h in enumerate(step):
        moved = (states + h * np.eye(2 * n)[i], states - h * np.eye(2 * n)[i])
        up, down = (acceleration(s[:, :n], s[:, n:]) for s in moved)
        columns.append((up - down) / (2 * h))
    return np.stack(columns, axis=2)
