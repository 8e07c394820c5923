"""Even selection of indices."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def evenly(count: int, most: int) -> NDArray[np.intp]:
    """Return at most `most` evenly spaced indices of `count`, including the first and the last."""
    return np.unique(np.linspace(0, count - 1, most).astype(np.intp))
