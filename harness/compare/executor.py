"""Asking engines: in worker processes, which may crash, or at once, which tests like better."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from harness.compare.candidate import CompareError
from harness.schedule.workers import Failure, Workers


def in_workers(workers: Workers) -> Callable[[str, Callable[[Any], Any], list[Any]], list[Any]]:
    """Each argument goes to a worker process; one that dies costs its own value alone."""

    def ask(who: str, function: Callable[[Any], Any], arguments: list[Any]) -> list[Any]:
        futures = [workers.submit(_Guarded(function), argument) for argument in arguments]
        values = [workers.outcome(future) for future in futures]
        return [
            Failure(_named(who, value.reason), value.stdout)
            if isinstance(value, Failure)
            else value
            for value in values
        ]

    return ask


def _named(who: str, reason: str) -> str:
    """A reason that names the file already needs no other name for it."""
    return reason if who.rpartition(" [")[0] in reason else f"{who}: {reason}"


class _Guarded:
    """A function whose wrong usage comes back as what it is."""

    def __init__(self, function: Callable[[Any], Any]) -> None:
        self.function = function

    def __call__(self, argument: Any) -> Any:
        try:
            return self.function(argument)
        except CompareError as error:
            return Failure(str(error), "", True)


def at_once(who: str, function: Callable[[Any], Any], arguments: list[Any]) -> list[Any]:
    """The same in this process."""
    values: list[Any] = []
    for argument in arguments:
        try:
            values.append(_Guarded(function)(argument))
        except (RuntimeError, ValueError) as error:
            values.append(Failure(_named(who, str(error)), ""))
    return values
