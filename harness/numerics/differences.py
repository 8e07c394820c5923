"""Derivatives of ends by starts and inputs: extrapolated central differences."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from physics_crosscheck.reference.mechanism.numeric import Array
from .accelerations import Estimate
from .ladder import weights

SIZES = (1.0, 0.5, 0.25)
"""Perturbations in units of the largest; extrapolation removes their even powers."""


MAX_PERTURBATION = 0.02
"""Perturbations as a share of the motions' sizes."""


@dataclass(frozen=True, kw_only=True)
class OperatingPoint:
    """An equilibrium, and the equations' linearization there.

    Attributes:
        name: of the equilibrium.
        position: (n,).
        hold: inputs that hold it, (inputs,).
        matrices: A, B, Cy, D, M, C and K; of declared energies also F.
        amplitude: size of the system's motions, per component, (2n,).
        push: size of its inputs, (inputs,).
    """

    name: str
    position: Array
    hold: Array
    matrices: Mapping[str, Array]
    amplitude: Array
    push: Array

    @cached_property
    def deltas(self) -> Array:
        """Perturbations of the state and the inputs, (2n + inputs,)."""
        sizes = np.concatenate([np.minimum(self.amplitude, 1.0), self.push])
        perturbations: Array = MAX_PERTURBATION * sizes
        return perturbations

    @cached_property
    def perturbed(self) -> tuple[Array, Array]:
        """States and inputs of all perturbations, (6 c, 2n) and (6 c, inputs); c = len(deltas)."""
        size, by = len(self.amplitude), moved(self.deltas)
        origin = np.concatenate([self.position, np.zeros(size - len(self.position))])
        return origin + by[:, :size], self.hold + by[:, size:]


def moved(deltas: Array) -> Array:
    """Return perturbations of each column alone, by all sizes and both signs, (6 c, c).

    Columns are consecutive, so that a subset of rows represents all columns.
    """
    unit = np.eye(len(deltas))[:, None, None] * np.array([1.0, -1.0])[:, None]
    result: Array = (np.array(SIZES)[:, None, None] * unit).reshape(-1, len(deltas)) * deltas
    return result


def slopes(ends: Array, error: Array, deltas: Array) -> Estimate:
    """Return the derivatives of ends (6 c, m) by the `moved` columns, (m, c), with uncertainty.

    Args:
        ends, error: ends of each row, and their uncertainty, (6 c, m) each.
        deltas: perturbations of the columns, (c,).
    """
    columns = len(deltas)
    shape = columns, len(SIZES), 2, ends.shape[1]
    value, doubt = ends.reshape(shape), error.reshape(shape)
    steps = 2 * np.array(SIZES)[:, None] * deltas[:, None, None]
    each = ((value[:, :, 0] - value[:, :, 1]) / steps).swapaxes(0, 1)
    each_error = ((doubt[:, :, 0] + doubt[:, :, 1]) / steps).swapaxes(0, 1)
    even = [weights(tuple(int(1 / s) for s in SIZES[:m]), (2, 2)) for m in (1, 2, 3)]
    first, second, third = (np.tensordot(w, each[: len(w)], axes=1) for w in even)
    # Remainder of the extrapolation: the last change, times its reduction from the one before.
    before, last = np.abs(second - first), np.abs(third - second)
    remainder = 2.5 * last * np.sqrt(np.minimum(1.0, last / np.maximum(before, 1e-300)))
    rounded = np.tensordot(np.abs(even[-1]), each_error, axes=1)
    return Estimate(value=third.T, uncertainty=(rounded + remainder).T)
