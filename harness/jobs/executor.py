"""Executors of tasks: worker processes of this machine, or those of a cluster.

`harness.jobs.chosen` starts the requested one; plans of jobs do not depend on the choice.
"""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Generic, Self, TypeVar, cast

from .failure import Failure, failure_of

MOMENT = 0.2
"""Interval between two checks of the clock, seconds."""

Argument = TypeVar("Argument")
Value = TypeVar("Value")


class ClusterError(ValueError):
    """A cluster that cannot be used; the message gives the reason and the remedy."""


@dataclass(eq=False)
class Pending(Generic[Value]):
    """A task that was submitted.

    Attributes:
        function, argument: the task.
        subject: what it is about; a process keeps parts of it for the next task. Empty: of none.
        value: its result, once it has `ended`.
    """

    function: Callable[[Any], Value]
    argument: object
    subject: str = ""
    value: Value | Failure | None = None
    ended: bool = False

    def end(self, value: Value | Failure) -> None:
        """Set the value, or the failure."""
        self.value, self.ended = value, True


class Executor(ABC):
    """Executor of tasks, each isolated from the others and within limits; use it as a context
    manager.
    """

    def __init__(self) -> None:
        self._waiting: deque[Pending[Any]] = deque()

    def submit(
        self,
        function: Callable[[Argument], Value],
        argument: Argument,
        *,
        first: bool = False,
        subject: str = "",
    ) -> Pending[Value]:
        """Submit a task, which starts when there is room, during calls of `turn` or `outcome`.

        A task with `first` starts before all waiting ones. Tasks with one subject run one after the
        other, in one process if possible.
        """
        pending: Pending[Value] = Pending(function, argument, subject)
        if first:
            self._waiting.appendleft(pending)
        else:
            self._waiting.append(pending)
        return pending

    @abstractmethod
    def turn(self) -> list[Pending[Any]]:
        """Start tasks, wait briefly for an event, and return the tasks that ended."""

    def outcome(self, pending: Pending[Value]) -> Value | Failure:
        """Wait for a task, and return its value or its `Failure`."""
        while not pending.ended:
            self.turn()
        return cast(Value | Failure, pending.value)  # None is a valid value too

    def outcomes(
        self, function: Callable[[Argument], Value], arguments: Iterable[Argument]
    ) -> list[Value | Failure]:
        """Run a function on each argument, and return their values or failures in order."""
        values: list[Value | Failure] = []
        for pending in [self.submit(function, argument) for argument in arguments]:
            value = self.outcome(pending)
            values.append(value)
        return values

    @abstractmethod
    def close(self) -> None:
        """End all tasks, including the running ones."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


class InThisProcess(Executor):
    """Runs tasks one after the other in this process, without isolation and limits."""

    def turn(self) -> list[Pending[Any]]:
        """Run the next task; a `RuntimeError` or `ValueError` is its failure."""
        pending = self._waiting.popleft()
        try:
            pending.end(pending.function(pending.argument))
        except (RuntimeError, ValueError) as error:
            pending.end(failure_of(error))
        return [pending]

    def close(self) -> None:
        """Drop the tasks that wait."""
        self._waiting.clear()
