"""A few of many, spread evenly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def evenly(count: int, most: int) -> NDArray[np.intp]:
    """Indices of at most so many of `count` in a row, the first and the last among them."""
    return np.unique(np.linspace(0, count - 1, most).astype(np.intp))
