"""The job graph: jobs that follow from a job or its failure run too."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator

import pytest

from physics_crosscheck.harness.jobs.environment import without_main
from physics_crosscheck.harness.jobs.graph import Job, Task, run_jobs
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
