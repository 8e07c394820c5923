"""Choice of the executor: this machine or a cluster."""

import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from .executor import Executor
from .limits import Limits
from .workers import Workers


def executor(
    *,
    jobs: int = 0,
    limits: Limits | None = None,
    scheduler: str = "",
    files: Callable[[], Iterable[Path]] = tuple,
    engines: Sequence[str] = (),
    prestart: bool = False,
    derives: bool = True,
) -> Executor:
    """Return the executor of tasks, which is a context manager.

    Args:
        jobs: number of parallel tasks; 0: one for each processor, here or of the cluster.
        limits: limits of each task.
        scheduler: address of a dask cluster's scheduler; empty: processes of this machine.
        files: returns the files that tasks read; called for a cluster, which must share them.
        engines: engines whose versions must be the same on the cluster; empty: all installed here.
        prestart: whether tasks are certain, so that slow preparations start at once.
        derives: whether tasks derive equations from energies.

    Raises:
        ClusterError: for a cluster that cannot be used; gives the remedy.
    """
    if not scheduler:
        workers = Workers(jobs or os.cpu_count() or 1, limits, derives=derives)
        if prestart:
            workers.begin()
        return workers
    # Import late: dask is an extra, and takes a second.
    from .cluster import Cluster

    return Cluster(scheduler, jobs=jobs, limits=limits, files=tuple(files()), engines=engines)
