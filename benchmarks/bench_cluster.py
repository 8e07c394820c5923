"""What a cluster costs beside processes of this machine, with a real scheduler on loopback.

`python -m benchmarks.bench_cluster [--tasks 100000] [--workers 2] [--in-flight 400]`: bytes of each
kind of task; the way there and back of one task; then that many tasks that do nothing: how many a
second, and of the scheduler, the workers and the client the processor time a task, and memory.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from physics_crosscheck.harness.checks.prepare import PreparedSystem, prepare_system
from physics_crosscheck.harness.jobs import payload
from physics_crosscheck.harness.jobs.chosen import executor
from physics_crosscheck.harness.jobs.executor import Executor
from physics_crosscheck.harness.jobs.graph import Job, Task, run_jobs
from physics_crosscheck.harness.jobs.workers import processor_seconds
from physics_crosscheck.harness.modelfiles.folders import builtin
from physics_crosscheck.harness.planning.options import Options
from physics_crosscheck.harness.planning.plan import Plan
from physics_crosscheck.harness.planning.result_builder import ResultBuilder
from tests.schedule.clusters import Loopback, below

FOLDER = builtin() / "drum_pendulum"


def size(folder: Path) -> dict[str, tuple[int, int]]:
    """Of each kind of task: how many, and bytes of the largest as it is sent."""
    prepared = prepare_system(folder)
    assert isinstance(prepared, PreparedSystem)
    (first,) = Plan(Options(), None, ResultBuilder(lambda *_: None)).target(folder)
    found: dict[str, tuple[int, int]] = {}
    for job in first.done(prepared):
        task = (job.task.function, job.task.argument)
        count, most = found.get(job.task.function.__name__, (0, 0))
        sent = len(payload.serialize(task, places=frozenset([str(folder)])))
        found[job.task.function.__name__] = count + 1, max(most, sent)
    return found


def there_and_back(pool: Executor, data: bytes, times: int) -> float:
    """Seconds of one task after the other."""
    began = time.perf_counter()
    for _ in range(times):
        assert pool.outcome(pool.submit(len, data)) == len(data)
    return (time.perf_counter() - began) / times


def many(pool: Executor, count: int, data: bytes = b"") -> float:
    """Seconds of planned jobs that do nothing."""
    seen: Counter[int] = Counter()

    def done(value: int) -> Iterable[Job[Any]]:
        seen[value] += 1
        return ()

    def failed(failure: object) -> Iterable[Job[Any]]:
        raise AssertionError(failure)

    began = time.perf_counter()
    run_jobs((Job(task=Task(len, data), done=done, failed=failed) for _ in range(count)), pool)
    assert seen == {len(data): count}
    return time.perf_counter() - began


def used(pids: Iterable[int]) -> float:
    return sum(processor_seconds(pid) for pid in pids)


def memory(pid: int) -> float:
    """MiB that a process holds."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tasks", type=int, default=100_000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--in-flight", type=int, default=400, help="as for a hundred workers")
    options = parser.parse_args()
    for name, (tasks, sent) in size(FOLDER).items():
        print(f"{name:20} {tasks:3} tasks of {sent / 1e3:.0f} kB")
    with tempfile.TemporaryDirectory() as place:
        cluster = Loopback(Path(place))
        try:
            cluster.start()
            for number in range(options.workers):
                cluster.worker(f"{number}")
            measure(cluster, options.tasks, options.in_flight)
        finally:
            cluster.close()


def measure(cluster: Loopback, count: int, most: int) -> None:
    case = os.urandom(290_000)  # a case as it is sent
    with executor(jobs=1) as local:
        there_and_back(local, b"", 5)
        for data in (b"", case):
            told = 1e3 * there_and_back(local, data, 200)
            print(f"there and back with {len(data)} bytes: {told:.2f} ms here")
    began = time.perf_counter()
    with executor(scheduler=cluster.address) as pool:
        print(f"opened in {time.perf_counter() - began:.2f} s")
        many(pool, 50)
        for data in (b"", case):
            told = 1e3 * there_and_back(pool, data, 200)
            print(f"there and back with {len(data)} bytes: {told:.2f} ms on the cluster")
    with executor(jobs=most, scheduler=cluster.address) as pool:
        many(pool, 50)
        for times, data in ((count, b""), (max(1, count // 50), case)):
            print(f"{times} tasks with {len(data)} bytes, {most} in flight:")
            tell(cluster, pool, times, data)


def tell(cluster: Loopback, pool: Executor, count: int, data: bytes) -> None:
    """Do tasks, and print what that costs."""
    parts = {
        "scheduler": [cluster.scheduler],
        "workers": [pid for one in cluster.workers.values() for pid in below(one.pid)],
        "client": [os.getpid()],
    }
    before = {name: used(pids) for name, pids in parts.items()}
    held = {name: memory(parts[name][0]) for name in ("scheduler", "client")}
    seconds = many(pool, count, data)
    print(f"  {seconds:.0f} s, {count / seconds:.0f} a second")
    for name, pids in parts.items():
        each = 1e3 * (used(pids) - before[name]) / count
        print(f"  {name}: {each:.2f} ms of processor a task")
    for name, was in held.items():
        print(f"  {name}: {was:.0f} MiB before, {memory(parts[name][0]):.0f} after")


if __name__ == "__main__":
    main()
