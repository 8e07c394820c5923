"""Tasks of a model in an executor; a crash only loses its own value."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

from physics_crosscheck.harness.jobs.executor import Executor
from physics_crosscheck.harness.jobs.failure import Failure
from .candidate import Candidate, CompareError

T = TypeVar("T")
V = TypeVar("V")


class FailureError(RuntimeError):
    """A comparison that could not run."""

    def __init__(self, failure: Failure) -> None:
        super().__init__(failure.reason)
        self.failure = failure


def ask(executor: Executor, candidate: Candidate, function: Callable[[T], V], argument: T) -> V:
    """Run a function of a model.

    Raises:
        CompareError: for wrong usage.
        FailureError: if an engine fails, with its output.
    """
    (value,) = ask_each(executor, candidate, function, [argument])
    if isinstance(value, Failure):
        raise CompareError(value.reason) if value.usage else FailureError(value)
    return value


def ask_each(
    executor: Executor, candidate: Candidate, function: Callable[[T], V], arguments: Sequence[T]
) -> list[V | Failure]:
    """Run a function on each argument; failures have the model's name."""
    tasks = [executor.submit(function, argument) for argument in arguments]
    values: list[V | Failure] = []
    for task in tasks:
        value = executor.outcome(task)
        values.append(_named(candidate, value) if isinstance(value, Failure) else value)
    return values


def _named(candidate: Candidate, failure: Failure) -> Failure:
    """Prefix a failure with the model's name, unless the reason already names its file."""
    if failure.usage or str(candidate.sidecar.model) in failure.reason:
        return failure
    return replace(failure, reason=f"{candidate.name}: {failure.reason}")
