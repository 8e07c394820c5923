"""Progress: a bar with the phase in a terminal, plain lines elsewhere."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable

from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar
from rich.theme import Theme

from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.results.status import counted
from physics_crosscheck.harness.results.visible import visible
from .table import case_line

LOG_SECONDS = 5.0
"""Minimum seconds between two lines of a log."""

Clock = Callable[[], float]
"""Returns seconds since any start."""


_THEME = Theme({"progress.elapsed": "dim"})
"""The default, yellow, is not readable on a light background."""


class Progress:
    """Progress of a run: a bar with the phase in a terminal, occasional lines elsewhere.

    Args:
        every: whether a log gets one line per case instead.
        clock: returns seconds since any start.
    """

    def __init__(self, *, every: bool = False, clock: Clock = time.monotonic) -> None:
        self._every = every
        self._counter = Counter("case", doing="running", clock=clock)
        self._differing: dict[str, None] = {}

    def __enter__(self) -> Progress:
        self._counter.begin("deriving")
        return self

    def __call__(self, done: int, total: int, case: Case | None) -> None:
        """Report a finished case; after the last one, name the remaining work.

        Args:
            done: number of finished cases.
            total: number of all cases; 0 while some systems are not derived yet.
            case: the case just finished.
        """
        if case is not None:
            if case.outcome is Outcome.DIFFERS:
                self._differing[case.model] = None
            if self._every and not self._counter.is_shown:
                print(visible(case_line(done, total, case)), file=sys.stderr, flush=True)
        if done < total or not total:
            self._counter.doing = "running" if total else "deriving and running"
            self._counter(done, total, None, silent=self._every)
        else:
            names = list(self._differing)
            more = f" and {len(names) - 1} more" if len(names) > 1 else ""
            self.phase(f"diagnosing {names[0]}{more}" if names else "checking coverage")

    def phase(self, name: str) -> None:
        """Report a phase of unknown length."""
        self._counter.begin(visible(name))

    def __exit__(self, *_: object) -> None:
        self._counter.end()


class Counter:
    """Progress of many small tasks: a bar in a terminal, a line every few seconds elsewhere.

    Args:
        thing: noun of one task's object.
        doing: participle of the work, which may change.
        clock: returns seconds since any start.
    """

    def __init__(self, thing: str, doing: str, clock: Clock = time.monotonic) -> None:
        self._thing, self.doing, self._clock = thing, doing, clock
        self._bar: Bar | None = None
        self._last = clock()

    def __enter__(self) -> Counter:
        self.begin(self.doing)
        return self

    @property
    def is_shown(self) -> bool:
        """True if there is a bar."""
        return self._bar is not None

    def begin(self, phase: str) -> None:
        """Begin a phase of unknown length."""
        if self._bar is None:
            self._bar = _bar(phase)
        else:
            self._bar.update(self._bar.task_ids[0], description=phase, completed=0, total=None)
        self._log(phase)

    def __call__(self, done: int, total: int, _: object, *, silent: bool = False) -> None:
        """Report the number of finished tasks; a total of 0 is unknown."""
        if self._bar is not None:
            self._bar.update(
                self._bar.task_ids[0],
                description=f"{self.doing} {done}{f'/{total}' if total else ''}",
                completed=done,
                total=total or None,
            )
        elif not total and not silent:
            self._log(f"{self.doing}: {counted(done, self._thing)} done")
        elif done < total and not silent:
            share = f"{100 * done // total} %"
            self._log(f"{self.doing}: {done} of {counted(total, self._thing)} done ({share})")

    def _log(self, line: str) -> None:
        """Print a line without a bar, at most every few seconds."""
        if self._bar is None and self._clock() - self._last >= LOG_SECONDS:
            self._last = self._clock()
            print(line, file=sys.stderr, flush=True)

    def __exit__(self, *_: object) -> None:
        self.end()

    def end(self) -> None:
        """Remove the bar."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None


def _bar(phase: str) -> Bar | None:
    """Return a running bar, or None where there is no terminal to show it."""
    if not sys.stderr.isatty() or os.environ.get("CI"):
        return None
    bar = Bar(
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
        console=Console(stderr=True, theme=_THEME),
        transient=True,
    )
    bar.add_task(phase, total=None)
    bar.start()
    return bar
