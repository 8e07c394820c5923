"""One thread a process for linear algebra.

Matrices are small here, and there is a worker a core. BLAS starts a thread for each core as it is
imported, and they spin between calls: that took a tenth of a run's processor time, and a third of
an unchanged gate's. dask.distributed sets the first three of these for its workers.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator

COUNTS = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)
"""Variables of the environment that are read as numpy and scipy are imported."""


def claim_one_thread() -> None:
    """Have one in this process and what it starts; what a user has set stands."""
    for name in COUNTS:
        os.environ.setdefault(name, "1")


@contextlib.contextmanager
def one_thread_each() -> Iterator[None]:
    """Processes started meanwhile have one; what a user has set stands."""
    ours = [name for name in COUNTS if name not in os.environ]
    claim_one_thread()
    try:
        yield
    finally:
        for name in ours:
            os.environ.pop(name, None)
