"""Who does tasks: worker processes of this machine, or those of a cluster.

`harness.jobs.chosen` starts the one that is meant; whoever plans jobs knows no more of it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Generic, Self, TypeVar, cast

from physics_crosscheck.harness.jobs.failure import Failure

MOMENT = 0.2
"""Seconds between two looks at the clock."""

Argument = TypeVar("Argument")
Value = TypeVar("Value")


class ClusterError(ValueError):
    """A cluster that can't be worked with; the message says why, and what to do."""


@dataclass(eq=False)
class Pending(Generic[Value]):
    """A task that was submitted.

    Attributes:
        function, argument: the task.
        value: what came of it, once it has `ended`.
    """

    function: Callable[[Any], Value]
    argument: object
    value: Value | Failure | None = None
    ended: bool = False

    def end(self, value: Value | Failure) -> None:
        """It has a value, or none for a reason."""
        self.value, self.ended = value, True


class Executor(ABC):
    """Does tasks, each apart from all others and within limits; use it as a context manager."""

    def __init__(self) -> None:
        self._waiting: deque[Pending[Any]] = deque()

    def submit(
        self, function: Callable[[Argument], Value], argument: Argument, *, first: bool = False
    ) -> Pending[Value]:
        """Ask for a task; it is begun when there is room, while one of these is asked.

        One that comes `first` is begun before all that wait.
        """
        pending: Pending[Value] = Pending(function, argument)
        if first:
            self._waiting.appendleft(pending)
        else:
            self._waiting.append(pending)
        return pending

    @abstractmethod
    def turn(self) -> list[Pending[Any]]:
        """Hand out tasks, wait a moment for something to happen, and return those that ended."""

    def outcome(self, pending: Pending[Value]) -> Value | Failure:
        """The value of a task, or a `Failure` that says what became of it; waits for it."""
        while not pending.ended:
            self.turn()
        return cast(Value | Failure, pending.value)  # None is a value too, once it ended

    @abstractmethod
    def close(self) -> None:
        """End everything, with what is being done."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
