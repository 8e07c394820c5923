"""Job graph: jobs for the workers, each of which returns its follow-up jobs."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Generic

from .executor import Argument, Executor, Pending, Value
from .failure import Failure
from .stop import Stop


@dataclass(frozen=True)
class Task(Generic[Argument, Value]):
    """A function and its argument, for a worker process, and the subject, as in `Pending`."""

    function: Callable[[Argument], Value]
    argument: Argument
    subject: str = ""


@dataclass(frozen=True, kw_only=True)
class Job(Generic[Value]):
    """A task with its follow-up jobs.

    Attributes:
        task: the task for a worker.
        done: called with its value in this process; returns the follow-up jobs.
        failed: called with its failure; returns the follow-up jobs.
    """

    task: Task[Any, Value]
    done: Callable[[Value], Iterable[Job[Any]]]
    failed: Callable[[Failure], Iterable[Job[Any]]]


def run_jobs(jobs: Iterable[Job[Any]], workers: Executor, stop: Stop | None = None) -> None:
    """Run all jobs and their follow-up jobs; return when all are done, or after a request to stop.

    Follow-up jobs run before the waiting jobs. So results appear early, and intermediate results
    need not be kept until all jobs have started. `done` and `failed` are called one at a time.
    Their exceptions are errors of the plan, not of a task, and end the run.
    """
    waiting: dict[Pending[Any], Job[Any]] = {}

    def start(some: Iterable[Job[Any]], *, first: bool) -> None:
        for job in reversed(list(some)) if first else some:
            task = job.task
            submitted = workers.submit(
                task.function, task.argument, first=first, subject=task.subject
            )
            waiting[submitted] = job

    start(jobs, first=False)
    while waiting and not (stop and stop.requested):
        for pending in workers.turn():
            job, value = waiting.pop(pending), workers.outcome(pending)
            brought = job.failed(value) if isinstance(value, Failure) else job.done(value)
            start(brought, first=True)
