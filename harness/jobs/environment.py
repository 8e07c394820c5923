"""Surroundings of worker processes: environment variables for threads and memory, no `__main__`.

Matrices are small here, and each core has a worker. BLAS starts a thread for each core when it is
imported, and these spin between calls. They took a tenth of a run's processor time, and a third of
an unchanged gate's. dask.distributed sets the first three of these variables for its workers.

An engine may allocate 12 MB with each model that it compiles. When larger blocks are freed, glibc
raises the size from which it maps memory. It then puts such blocks on its heap, and reserves 12 MB
more each time: 24 GB for the 1299 models of one count, of which 0.4 GB are used. With a constant
size, it reserves 0.4 GB.
"""

import contextlib
import os
import sys
import types
from collections.abc import Iterator

from physics_crosscheck.harness.engines.environment import VARIABLES

COUNTS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""Environment variables that numpy and scipy read on import."""

MAPPED_FROM = "MALLOC_MMAP_THRESHOLD_"
"""Environment variable that glibc reads when a process starts."""

DEFAULTS = {**dict.fromkeys(COUNTS, "1"), MAPPED_FROM: str(2**20), **VARIABLES}
"""Values for worker processes, unless the user sets others."""


def claim_defaults() -> None:
    """Set the default values for this process and its child processes; values of the user stay.

    The memory setting only affects the child processes.
    """
    for name, value in DEFAULTS.items():
        os.environ.setdefault(name, value)


@contextlib.contextmanager
def workers_defaults() -> Iterator[None]:
    """Set the default values while starting processes; values of the user stay."""
    ours = [name for name in DEFAULTS if name not in os.environ]
    claim_defaults()
    try:
        yield
    finally:
        for name in ours:
            os.environ.pop(name, None)


@contextlib.contextmanager
def without_main() -> Iterator[None]:
    """Hide `__main__` from processes that start meanwhile.

    multiprocessing would import it in each process. That wastes time for pytest, runs a script
    again that has no `if __name__ == "__main__"` guard, and fails for a script from stdin.
    """
    main = sys.modules["__main__"]
    sys.modules["__main__"] = types.ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main
