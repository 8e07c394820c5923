"""Progress: a bar at a terminal, plain lines elsewhere."""

from __future__ import annotations

import os
import sys

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.progress import Progress as Bar

from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.text.status import counted
from physics_crosscheck.harness.text.table import case_line
from physics_crosscheck.harness.text.visible import visible

_COUNTED = (Outcome.AGREES, Outcome.ABSENT)
"""Cases without a line of their own: an engine that is absent is one line of the results."""


class Progress:
    """Progress of cases: a bar at a terminal; elsewhere a line a tenth, and one each that is amiss.

    Args:
        every: whether there is a line a case elsewhere, whatever became of it.
    """

    def __init__(self, *, every: bool = False) -> None:
        self._every, self._counter = every, Counter("case")

    def __enter__(self) -> Progress:
        self._bar = _bar("case")
        return self

    def __call__(self, done: int, total: int, case: Case | None) -> None:
        """Tell that a case is done."""
        if self._bar is not None:
            self._bar.update(self._bar.task_ids[0], completed=done, total=total)
            return
        if case is not None and (self._every or case.outcome not in _COUNTED):
            print(visible(case_line(done, total, case)), file=sys.stderr, flush=True)
        if not self._every:
            self._counter(done, total, None)

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()


class Counter:
    """Progress of many small things: a bar at a terminal, a line every tenth elsewhere."""

    def __init__(self, thing: str) -> None:
        self._thing = thing
        self._tenths = 0
        self._bar: Bar | None = None

    def __enter__(self) -> Counter:
        self._bar = _bar(self._thing)
        return self

    def __call__(self, done: int, total: int, _: object) -> None:
        """Tell how many are done; a total of 0 is not known yet."""
        if self._bar is not None:
            self._bar.update(self._bar.task_ids[0], completed=done, total=total or None)
        elif total and 10 * done // total > self._tenths:
            self._tenths = 10 * done // total
            told = f"{done} of {counted(total, self._thing)} ({10 * self._tenths} %)"
            print(told, file=sys.stderr, flush=True)

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()


def _bar(thing: str) -> Bar | None:
    """A running bar, or None where there is no terminal to show it."""
    if not sys.stderr.isatty() or os.environ.get("CI"):
        return None
    bar = Bar(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    )
    bar.add_task(f"{thing}s", total=None)
    bar.start()
    return bar
