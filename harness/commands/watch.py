"""Progress: a bar at a terminal, plain lines elsewhere."""

from __future__ import annotations

import os
import sys
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from harness.table import line


class Watcher:
    """Progress: a bar at a terminal, a line a case elsewhere."""

    def __enter__(self) -> Watcher:
        self._bar: Progress | None = None
        if sys.stderr.isatty() and not os.environ.get("CI"):
            self._bar = Progress(
                TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(),
                TimeElapsedColumn(), console=Console(stderr=True), transient=True,
            )  # fmt: skip
            self._task = self._bar.add_task("cases", total=None)
            self._bar.start()
        return self

    def count(self, done: int, total: int, _: object) -> None:
        """Progress without a case to tell of."""
        self(done, total, None)

    def __call__(self, done: int, total: int, case: dict[str, Any] | None) -> None:
        """Tell that a case is done."""
        if self._bar is not None:
            self._bar.update(self._task, completed=done, total=total)
        elif case is not None:
            print(line(done, total, case), file=sys.stderr, flush=True)

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()
