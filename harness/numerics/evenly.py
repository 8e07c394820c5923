"""Even selection of indices."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def even_indices(count: int, limit: int) -> NDArray[np.intp]:
    """Return at most `limit` evenly spaced indices of `count`, including the first and the last."""
    return np.unique(np.linspace(0, count - 1, limit).astype(np.intp))
