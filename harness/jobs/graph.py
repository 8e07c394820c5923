"""One job graph: jobs for the workers, each of which brings the jobs that follow from it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Generic

from physics_crosscheck.harness.jobs.executor import Argument, Executor, Pending, Value
from physics_crosscheck.harness.jobs.failure import Failure
from physics_crosscheck.harness.jobs.stop import Stop


@dataclass(frozen=True)
class Task(Generic[Argument, Value]):
    """A function of a module, and what it is called with, in a worker process."""

    function: Callable[[Argument], Value]
    argument: Argument


@dataclass(frozen=True, kw_only=True)
class Job(Generic[Value]):
    """A task, and what follows from it.

    Attributes:
        task: what a worker does.
        done: called with its value, in this process; returns the jobs that follow.
        failed: called with why there is none; returns the jobs that follow.
    """

    task: Task[Any, Value]
    done: Callable[[Value], Iterable[Job[Any]]]
    failed: Callable[[Failure], Iterable[Job[Any]]]


def work(jobs: Iterable[Job[Any]], workers: Executor, stop: Stop | None = None) -> None:
    """Do all jobs, and those that they bring; returns when none is left, or when asked to stop.

    What a job brings is done before the jobs that wait: so that there is something to show from the
    first one on, and what it found need not be kept until all are begun.
    `done` and `failed` are called one at a time. What they raise is a mistake of the plan, not of a
    task: it ends the work.
    """
    waiting: dict[Pending[Any], Job[Any]] = {}

    def start(some: Iterable[Job[Any]], *, first: bool) -> None:
        for job in reversed(list(some)) if first else some:
            asked = workers.submit(job.task.function, job.task.argument, first=first)
            waiting[asked] = job

    start(jobs, first=False)
    while waiting and not (stop and stop.asked):
        for pending in workers.turn():
            job, value = waiting.pop(pending), workers.outcome(pending)
            brought = job.failed(value) if isinstance(value, Failure) else job.done(value)
            start(brought, first=True)
