"""Where tasks are done, by what was asked for: on this machine, or on a cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from physics_crosscheck.harness.jobs.executor import Executor
from physics_crosscheck.harness.jobs.limits import Limits
from physics_crosscheck.harness.jobs.workers import Workers


def executor(
    *,
    jobs: int = 0,
    limits: Limits | None = None,
    scheduler: str = "",
    files: Callable[[], Iterable[Path]] = tuple,
    engines: Sequence[str] = (),
    sure: bool = False,
) -> Executor:
    """Who does the tasks; to be used as a context manager.

    Args:
        jobs: how many at once; 0: one a processor, here or of the cluster.
        limits: of each task.
        scheduler: address of a dask cluster's; empty: processes of this machine.
        files: what tasks read, as it is named here; asked for where a cluster gets copies of it.
        engines: whose versions must be the same there; none: those of all that are installed here.
        sure: whether tasks are sure to come: what takes its time is begun at once.

    Raises:
        ClusterError: for a cluster that can't be worked with; says what to do.
    """
    if not scheduler:
        workers = Workers(jobs or os.cpu_count() or 1, limits)
        if sure:
            workers.begin()
        return workers
    # Imported where it is asked for alone: it is an extra, and takes a second.
    from physics_crosscheck.harness.jobs.cluster import Cluster

    return Cluster(scheduler, jobs=jobs, limits=limits, files=tuple(files()), engines=engines)
