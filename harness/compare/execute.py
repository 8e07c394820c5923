"""Interface for running functions elsewhere, and its errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, TypeVar

from physics_crosscheck.harness.compare.candidate import Candidate, CompareError
from physics_crosscheck.harness.jobs.workers import Failure

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
