"""Variables of the environment that worker processes start with: threads and memory.

Matrices are small here, and there is a worker a core. BLAS starts a thread for each core as it is
imported, and they spin between calls: that took a tenth of a run's processor time, and a third of
an unchanged gate's. dask.distributed sets the first three of these for its workers.

An engine may allocate 12 MB with each model that it compiles. glibc raises the size from which it
maps memory as larger blocks are freed, puts such blocks on its heap then, and reserves 12 MB more
each time: 24 GB for the 1299 models of one count, of which 0.4 GB are used. With a size that stays,
0.4 GB are reserved.
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

MAPPED_FROM = "MALLOC_MMAP_THRESHOLD_"
"""A variable of the environment that glibc reads as a process starts."""

DEFAULTS = {**dict.fromkeys(COUNTS, "1"), MAPPED_FROM: str(2**20)}
"""What workers start with where a user has set nothing else."""


def claim_defaults() -> None:
    """Set the defaults for this process and what it starts; what a user has set stands.

    Of memory they hold for what it starts alone.
    """
    for name, value in DEFAULTS.items():
        os.environ.setdefault(name, value)


@contextlib.contextmanager
def workers_defaults() -> Iterator[None]:
    """Start processes with the defaults meanwhile; what a user has set stands."""
    ours = [name for name in DEFAULTS if name not in os.environ]
    claim_defaults()
    try:
        yield
    finally:
        for name in ours:
            os.environ.pop(name, None)
