"""How functions are run elsewhere, and what is said where that fails."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, TypeVar

from physics_crosscheck.harness.compare.candidate import Candidate, CompareError
from physics_crosscheck.harness.jobs.workers import Failure

T = TypeVar("T")
V = TypeVar("V")


class Execute(Protocol):
    """Runs a function on each argument, elsewhere."""

    def __call__(
        self, who: str, function: Callable[[T], V], arguments: Sequence[T]
    ) -> list[V | Failure]:
        """Values in the order of the arguments; one that fails gives a `Failure`.

        Args:
            who: what messages call the model that is run.
        """


class FailureError(RuntimeError):
    """A comparison that could not be run."""

    def __init__(self, failure: Failure) -> None:
        super().__init__(failure.reason)
        self.failure = failure


def ask(execute: Execute, candidate: Candidate, function: Callable[[T], V], argument: T) -> V:
    """Run a function of a model.

    Raises:
        CompareError: for wrong usage.
        FailureError: where an engine fails, with what it printed.
    """
    (value,) = execute(candidate.name, function, [argument])
    if isinstance(value, Failure):
        raise CompareError(value.reason) if value.usage else FailureError(value)
    return value
