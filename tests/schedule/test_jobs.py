"""The job graph, its interruption, and the environment of its workers."""

import ctypes
import os
import signal
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from physics_crosscheck.harness.jobs.environment import DEFAULTS, MAPPED_FROM, without_main
from physics_crosscheck.harness.jobs.graph import Job, Task, run_jobs
from physics_crosscheck.harness.jobs.stop import SIGNALS, Stopped, asking, raising
from physics_crosscheck.harness.jobs.workers import Failure, Limits, Workers


@pytest.fixture(scope="module")
def workers() -> Iterator[Workers]:
    with without_main(), Workers(1, Limits(seconds=30.0)) as pool:
        yield pool


def _root(value: float) -> float:
    if value < 0:
        raise ValueError(f"{value:g} has no root")
    return float(value**0.5)


def _dies(code: int) -> float:
    os._exit(code)


def _unexpected(failure: Failure) -> Iterable[Job[float]]:
    raise AssertionError(failure.reason)


def test_jobs_add_further_jobs(workers: Workers) -> None:
    roots: list[float] = []

    def job(value: float) -> Job[float]:
        return Job(task=Task(_root, value), done=done, failed=_unexpected)

    def done(value: float) -> Iterable[Job[float]]:
        roots.append(value)
        return [job(value)] if value > 2 else []

    run_jobs([job(256.0), job(1.0), job(0.25)], workers)
    # New jobs precede waiting ones, of which one may already have been handed out.
    assert sorted(roots) == [0.5, 1.0, 2.0, 4.0, 16.0]
    assert roots.index(2.0) < roots.index(0.5)


@pytest.mark.parametrize(
    ("task", "message"),
    [(Task(_root, -4.0), "ValueError: -4 has no root"), (Task(_dies, 3), "exit code 3")],
)
def test_failed_task_is_reported_and_other_tasks_run(
    workers: Workers, task: Task[float, float], message: str
) -> None:
    failures: list[str] = []
    roots: list[float] = []

    def failed(failure: Failure) -> Iterable[Job[float]]:
        failures.append(failure.reason)
        return [Job(task=Task(_root, 9.0), done=done, failed=_unexpected)]

    def done(value: float) -> Iterable[Job[float]]:
        roots.append(value)
        return ()

    run_jobs(
        [
            Job(task=task, done=done, failed=failed),
            Job(task=Task(_root, 4.0), done=done, failed=_unexpected),
        ],
        workers,
    )
    assert message in failures[0]
    assert len(failures) == 1
    assert sorted(roots) == [2.0, 3.0]


def test_error_of_a_plan_is_raised(workers: Workers) -> None:
    def done(value: float) -> Iterable[Job[float]]:
        raise KeyError("a mistake of the plan")

    with pytest.raises(KeyError, match="a mistake of the plan"):
        run_jobs([Job(task=Task(_root, 4.0), done=done, failed=_unexpected)], workers)


@pytest.mark.parametrize("number", SIGNALS)
def test_first_signal_requests_a_stop_and_second_ends(number: signal.Signals) -> None:
    was = signal.signal(number, signal.SIG_DFL)  # under nohup SIGHUP is ignored
    try:
        with raising(), asking() as stop:
            before = [stop.requested]
            os.kill(os.getpid(), number)
            assert [*before, stop.requested] == [False, True]
            assert stop.name == number.name
            with pytest.raises(Stopped) as stopped:
                os.kill(os.getpid(), number)
            assert stopped.value.number == number
        assert signal.getsignal(number) is signal.SIG_DFL
    finally:
        signal.signal(number, was)


def test_ignored_signal_stays_ignored(monkeypatch: pytest.MonkeyPatch) -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup does
    try:
        with asking() as stop:
            os.kill(os.getpid(), signal.SIGHUP)
            assert not stop.requested
    finally:
        signal.signal(signal.SIGHUP, before)


ROOT = Path(__file__).resolve().parents[2]

PROGRAM = """
import sys
from physics_crosscheck.harness.interfaces.cli.main import program
early = "numpy" in sys.modules
sys.argv = ["crosscheck", "engines"]
program()
from tests.schedule.test_jobs import environment_summary
print(early, environment_summary(None))
"""

LIBRARY = """
from physics_crosscheck.harness.jobs import workers as jobs
from tests.schedule.test_jobs import environment_summary, is_mapped, set_here

jobs.PRELOADED = jobs.PRELOADED_TO_DERIVE = ()
with jobs.Workers(1) as workers:
    before = set_here()
    mapped = workers.outcome(workers.submit(is_mapped, 12_000_000))
    print(workers.outcome(workers.submit(environment_summary, None)), set_here() == before, mapped)
"""

IS_MMAPPED = 2
"""Flag of a chunk in glibc's malloc/malloc.c."""


def is_mapped(size: int) -> bool | None:
    """Return whether freed memory is mapped again instead of taken from the heap.

    Return None if the C library is not glibc.
    """
    if sys.platform != "linux":
        return None
    libc = ctypes.CDLL(None)
    libc.malloc.restype, libc.malloc.argtypes = ctypes.c_void_p, [ctypes.c_size_t]
    libc.free.argtypes = [ctypes.c_void_p]
    libc.free(libc.malloc(size))  # glibc raises its threshold here, unless one is set
    place = libc.malloc(size)
    size_and_flags = ctypes.c_size_t.from_address(place - ctypes.sizeof(ctypes.c_size_t)).value
    libc.free(place)
    return bool(size_and_flags & IS_MMAPPED)


def set_here() -> list[str]:
    return [os.environ.get(name, "unset") for name in DEFAULTS]


def environment_summary(_: object) -> str:
    """Return the variables and the number of threads that a large matrix product starts."""
    import numpy as np

    before = len(os.listdir("/proc/self/task"))
    matrix = np.ones((600, 600))
    matrix @ matrix
    return f"{','.join(set_here())} {len(os.listdir('/proc/self/task')) - before}"


def last_line(program: str, **given: str) -> str:
    clean = {name: value for name, value in os.environ.items() if name not in DEFAULTS}
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={**clean, "PYTHONPATH": str(ROOT), **given},
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.splitlines()[-1]


def test_program_sets_the_defaults_before_importing_numpy() -> None:
    assert last_line(PROGRAM) == "False 1,1,1,1,1048576,disable,cpu,false 0"


def test_library_sets_the_defaults_in_its_workers_only() -> None:
    printed, _, mapped = last_line(LIBRARY).rpartition(" ")
    assert printed == "1,1,1,1,1048576,disable,cpu,false 0 True"
    assert mapped == ("True" if sys.platform == "linux" else "None")


@pytest.mark.parametrize(("program", "rest"), [(PROGRAM, "False "), (LIBRARY, "")])
def test_user_settings_are_kept(program: str, rest: str) -> None:
    given = {"OPENBLAS_NUM_THREADS": "2", MAPPED_FROM: str(2**25), "JAX_PLATFORMS": "cuda"}
    printed = last_line(program, **given)
    assert printed.startswith(f"{rest}2,1,1,1,{2**25},disable,cuda,false ")
    assert program is PROGRAM or printed.endswith(" False" if sys.platform == "linux" else " None")


def own_process(_: object) -> int:
    return os.getpid()


def test_tasks_of_one_subject_run_in_one_process() -> None:
    subjects = "abababba"
    with Workers(2) as pool:
        pending = [pool.submit(own_process, 0, subject=name) for name in subjects]
        for task in pending:
            pool.outcome(task)
    assert len({(task.subject, task.value) for task in pending}) == 2
