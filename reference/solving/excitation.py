"""Which states tell a mechanism's numbers apart: few of many, so that slopes are well conditioned.

The states of a robot that identify its numbers best are those whose information has the largest
determinant (Armstrong 1989, Int. J. Robotics Research 8(6); Swevers et al. 1997, IEEE Trans.
Robotics and Automation 13(5)). That choice is the same in whichever numbers the slopes are told, as
long as these span the same changes: so a tree's own stand for those of any file that says it. The
states are taken one after the other, as in the first half of Fedorov's exchange (1972).
"""

from __future__ import annotations

import numpy as np

from physics_crosscheck.reference.mechanism.numeric import Array

INDEPENDENT = 1e-9
"""Of the largest singular value of the slopes, its columns of length one: less is that of numbers
that no motion tells apart."""

PRIOR = 1e-6
"""Information that is there from the start, of each direction in all states: so that the first
states, which are less than the numbers, have a determinant."""


def telling(rows: Array, count: int) -> list[int]:
    """The states that tell numbers best apart, the most telling first.

    Args:
        rows: what each of K states shows of p numbers, in units of what is uncertain, (K, m, p).
        count: how many states, at most K.
    """
    white = _whitened(rows)
    states, m, r = white.shape
    flat, eye = white.reshape(-1, r), np.eye(m)
    known = np.eye(r) / PRIOR
    shown = eye + white @ np.swapaxes(white, 1, 2) / PRIOR
    left, found = np.ones(states, dtype=bool), list[int]()
    for _ in range(count):
        gain = np.where(left, np.linalg.slogdet(shown)[1], -np.inf)
        best = int(np.argmax(gain))
        left[best] = False
        found.append(best)
        # The inverse of the information loses what the state shows (Woodbury).
        by = np.linalg.solve(np.linalg.cholesky(shown[best]), white[best] @ known)
        known = known - by.T @ by
        both = (flat @ by.T).reshape(states, m, m)
        shown = shown - both @ np.swapaxes(both, 1, 2)
    return found


def _whitened(rows: Array) -> Array:
    """In directions that can be told apart, each of length one in all states, (K, m, r)."""
    states, m, _ = rows.shape
    flat = rows.reshape(states * m, -1)
    length = np.sqrt((flat * flat).sum(axis=0))
    flat = flat[:, length > 0] / length[length > 0]
    across, triangle = np.linalg.qr(flat)
    turn, sizes, _ = np.linalg.svd(triangle)
    found: Array = across @ turn[:, : len(sizes)][:, sizes > INDEPENDENT * sizes[0]]
    return found.reshape(states, m, -1)
