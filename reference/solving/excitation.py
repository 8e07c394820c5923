"""Choice of states that identify a mechanism's parameters best (D-optimal design).

The best states have the information matrix with the largest determinant (Armstrong 1989, Int. J.
Robotics Research 8(6); Swevers et al. 1997, IEEE Trans. Robotics and Automation 13(5)). The choice
does not depend on the parametrization, as long as it spans the same changes. A tree's own
parameters can therefore replace those of any file. States are chosen one by one, as in the first
half of Fedorov's exchange (1972).
"""

from __future__ import annotations

import numpy as np

from physics_crosscheck.reference.mechanism.numeric import Array

MIN_SINGULAR_VALUE = 1e-9
"""Threshold of singular values, relative to the largest, with columns of the slopes normalized.
Smaller ones belong to parameters that no motion can distinguish."""

PRIOR_INFORMATION = 1e-6
"""Initial information in each direction, relative to that of all states. It makes the determinant
nonzero while there are fewer states than parameters."""


def select_d_optimal(rows: Array, count: int) -> list[int]:
    """Select the states that identify the parameters best, the most informative first.

    Args:
        rows: sensitivity of each of K states to p parameters, in units of its uncertainty, (K, m,
            p).
        count: number of states, at most K.
    """
    white = _whitened(rows)
    states, m, r = white.shape
    flat, eye = white.reshape(-1, r), np.eye(m)
    covariance = np.eye(r) / PRIOR_INFORMATION
    shown = eye + white @ np.swapaxes(white, 1, 2) / PRIOR_INFORMATION
    available, chosen = np.ones(states, dtype=bool), list[int]()
    for _ in range(count):
        gain = np.where(available, np.linalg.slogdet(shown)[1], -np.inf)
        best = int(np.argmax(gain))
        available[best] = False
        chosen.append(best)
        # The inverse information decreases by the state's information (Woodbury).
        by = np.linalg.solve(np.linalg.cholesky(shown[best]), white[best] @ covariance)
        covariance = covariance - by.T @ by
        both = (flat @ by.T).reshape(states, m, m)
        shown = shown - both @ np.swapaxes(both, 1, 2)
    return chosen


def _whitened(rows: Array) -> Array:
    """Return the sensitivities in identifiable directions, each of unit length, (K, m, r)."""
    states, m, _ = rows.shape
    flat = rows.reshape(states * m, -1)
    length = np.sqrt((flat * flat).sum(axis=0))
    flat = flat[:, length > 0] / length[length > 0]
    across, triangle = np.linalg.qr(flat)
    turn, sizes, _ = np.linalg.svd(triangle)
    result: Array = across @ turn[:, : len(sizes)][:, sizes > MIN_SINGULAR_VALUE * sizes[0]]
    return result.reshape(states, m, -1)
