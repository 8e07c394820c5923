"""Derivatives of ends by starts and inputs: extrapolated central differences."""

from __future__ import annotations

import numpy as np

from physics_crosscheck.harness.numerics.accelerations import Estimate
from physics_crosscheck.harness.numerics.ladder import weights
from physics_crosscheck.reference.mechanism.numeric import Array

SIZES = (1.0, 0.5, 0.25)
"""Perturbations in units of the largest; extrapolation removes their even powers."""


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
