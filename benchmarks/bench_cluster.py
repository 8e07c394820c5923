"""Cost of a cluster on loopback, compared with processes of this machine.

`python -m benchmarks.bench_cluster [--tasks 100000] [--workers 2] [--in-flight 400]` prints the
bytes of each kind of task and the round trip of one. Then it runs empty tasks, and prints their
rate, and the processor time and memory of scheduler, workers and client.
"""

from __future__ import annotations

import argparse
import os
import pickle
import tempfile
import time
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from physics_crosscheck.harness.checks.prepare import PreparedSystem, prepare_system
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
    """Return the number of tasks of each kind, and the bytes of the largest as it is sent."""
    prepared = prepare_system(folder)
    assert isinstance(prepared, PreparedSystem)
    (first,) = Plan(Options(), None, ResultBuilder(lambda *_: None)).target(folder)
    sizes: dict[str, tuple[int, int]] = {}
    for job in first.done(prepared):
        task = (job.task.function, job.task.argument)
        count, largest = sizes.get(job.task.function.__name__, (0, 0))
        sent = len(pickle.dumps(task, protocol=pickle.HIGHEST_PROTOCOL))
        sizes[job.task.function.__name__] = count + 1, max(largest, sent)
    return sizes


def round_trip(pool: Executor, data: bytes, times: int) -> float:
    """Return the mean seconds of tasks that run one after the other."""
    began = time.perf_counter()
    for _ in range(times):
        assert pool.outcome(pool.submit(len, data)) == len(data)
    return (time.perf_counter() - began) / times


def run_empty(pool: Executor, count: int, data: bytes = b"") -> float:
    """Return the seconds of planned jobs that do nothing."""
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
    """Return the resident memory of a process, MiB."""
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


def measure(cluster: Loopback, count: int, in_flight: int) -> None:
    case = os.urandom(290_000)  # a case as it is sent
    with executor(jobs=1) as local:
        round_trip(local, b"", 5)
        for data in (b"", case):
            milliseconds = 1e3 * round_trip(local, data, 200)
            print(f"round trip with {len(data)} bytes: {milliseconds:.2f} ms here")
    began = time.perf_counter()
    with executor(scheduler=cluster.address) as pool:
        print(f"opened in {time.perf_counter() - began:.2f} s")
        run_empty(pool, 50)
        for data in (b"", case):
            milliseconds = 1e3 * round_trip(pool, data, 200)
            print(f"round trip with {len(data)} bytes: {milliseconds:.2f} ms on the cluster")
    with executor(jobs=in_flight, scheduler=cluster.address) as pool:
        run_empty(pool, 50)
        for times, data in ((count, b""), (max(1, count // 50), case)):
            print(f"{times} tasks with {len(data)} bytes, {in_flight} in flight:")
            print_costs(cluster, pool, times, data)


def print_costs(cluster: Loopback, pool: Executor, count: int, data: bytes) -> None:
    """Run empty tasks, and print their cost."""
    parts = {
        "scheduler": [cluster.scheduler],
        "workers": [pid for one in cluster.workers.values() for pid in below(one.pid)],
        "client": [os.getpid()],
    }
    before = {name: used(pids) for name, pids in parts.items()}
    held = {name: memory(parts[name][0]) for name in ("scheduler", "client")}
    seconds = run_empty(pool, count, data)
    print(f"  {seconds:.0f} s, {count / seconds:.0f} a second")
    for name, pids in parts.items():
        each = 1e3 * (used(pids) - before[name]) / count
        print(f"  {name}: {each:.2f} ms of processor a task")
    for name, was in held.items():
        print(f"  {name}: {was:.0f} MiB before, {memory(parts[name][0]):.0f} after")


if __name__ == "__main__":
    main()
