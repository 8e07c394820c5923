"""Executors: in worker processes, which may crash, or in this process, for tests."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Generic, Protocol, TypeVar

from physics_crosscheck.harness.compare.candidate import Candidate, CompareError
from physics_crosscheck.harness.jobs.workers import Failure, Workers

T = TypeVar("T")
V = TypeVar("V")


class Execute(Protocol):
    """A function that runs another on each argument, elsewhere."""

    def __call__(
        self, who: str, function: Callable[[T], V], arguments: Sequence[T]
    ) -> list[V | Failure]:
        """Return values in the order of the arguments, and a `Failure` for each that fails.

        Args:
            who: name of the model in messages.
        """


class FailureError(RuntimeError):
    """A comparison that could not run."""

    def __init__(self, failure: Failure) -> None:
        super().__init__(failure.reason)
        self.failure = failure


def ask(execute: Execute, candidate: Candidate, function: Callable[[T], V], argument: T) -> V:
    """Run a function of a model.

    Raises:
        CompareError: for wrong usage.
        FailureError: if an engine fails, with its output.
    """
    (value,) = execute(candidate.name, function, [argument])
    if isinstance(value, Failure):
        raise CompareError(value.reason) if value.usage else FailureError(value)
    return value


def in_workers(workers: Workers) -> Execute:
    """Run each argument in a worker process; a crash only loses its own value."""

    def execute(who: str, function: Callable[[T], V], arguments: Sequence[T]) -> list[V | Failure]:
        tasks = [workers.submit(_Guarded(function), argument) for argument in arguments]
        return [_name_failure(who, workers.outcome(task)) for task in tasks]

    return execute


def at_once(who: str, function: Callable[[T], V], arguments: Sequence[T]) -> list[V | Failure]:
    """Run each argument in this process."""
    values: list[V | Failure] = []
    for argument in arguments:
        try:
            values.append(_Guarded(function)(argument))
        except (RuntimeError, ValueError) as error:
            values.append(_name_failure(who, Failure(str(error), "")))
    return values


def _name_failure(who: str, value: V | Failure) -> V | Failure:
    """Prefix a failure with the model's name, unless the reason already names its file."""
    if not isinstance(value, Failure) or value.usage or who.rpartition(" [")[0] in value.reason:
        return value
    return replace(value, reason=f"{who}: {value.reason}")


class _Guarded(Generic[T, V]):
    """A function that returns wrong usage as a `Failure`."""

    def __init__(self, function: Callable[[T], V]) -> None:
        self.function = function

    def __call__(self, argument: T) -> V | Failure:
        try:
            return self.function(argument)
        except CompareError as error:
            return Failure(str(error), "", usage=True)
