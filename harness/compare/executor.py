"""Executors: in worker processes, which may crash, or in this process, for tests."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Generic

from physics_crosscheck.harness.compare.candidate import CompareError
from physics_crosscheck.harness.compare.execute import Execute, T, V
from physics_crosscheck.harness.jobs.workers import Failure, Workers


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
