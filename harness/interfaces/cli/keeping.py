"""Further output of a run: its page, and its history if enabled."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from pathlib import Path

from physics_crosscheck.harness.modelfiles.folders import FolderError
from physics_crosscheck.harness.records.history import (
    FOLDER,
    Past,
    append_history,
    past_of,
    read_history,
)
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.render.html import is_own_page

PATIENCE = 10.0
"""Timeout of git in seconds."""


def check_page(page: Path) -> None:
    """Reject an existing page of another program before anything runs.

    Raises:
        FolderError: naming the page and the remedy.
        OSError: if the page can't be read.
    """
    if page.is_file() and not is_own_page(page):
        raise FolderError(
            f"{page}: crosscheck did not write this page and does not replace it; choose another"
            " folder with --out, or move the page"
        )


def keep_history(out: Path, results: Results, *, begin: bool) -> Sequence[Past]:
    """Append a run to the history of its folder, and return the history.

    Args:
        out: folder of the run's results.
        results: results of the run; an interrupted run is not stored.
        begin: whether to create a missing history.
    """
    if not (begin or (out / FOLDER).is_dir()):
        return ()
    if not results.stopped:
        append_history(out, past_of(results, _commit()))
    return read_history(out)


def _commit() -> str:
    """Return the commit of the current repository; empty outside one."""
    try:
        completed = subprocess.run(
            ["git", "rev-parse", "HEAD"], capture_output=True, text=True, timeout=PATIENCE
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return completed.stdout.strip() if completed.returncode == 0 else ""
