"""What a run leaves behind beside its results: its page, and a history where one is kept."""

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
"""Seconds after which git is not waited for."""


def check_page(page: Path) -> None:
    """Refuse to replace a page that somebody else wrote, before anything is run.

    Raises:
        FolderError: naming the page and the remedy.
        OSError: for a page that can't be read.
    """
    if page.is_file() and not is_own_page(page):
        raise FolderError(
            f"{page}: crosscheck did not write this page and does not replace it; choose another"
            " folder with --out, or move the page"
        )


def keep_history(out: Path, results: Results, *, begin: bool) -> Sequence[Past]:
    """Append a run to the history of its folder, and give all of it.

    Args:
        out: the folder of the run's results.
        results: of the run; one that was stopped is not kept.
        begin: whether a history is begun where there is none.
    """
    if not (begin or (out / FOLDER).is_dir()):
        return ()
    if not results.stopped:
        append_history(out, past_of(results, _commit()))
    return read_history(out)


def _commit() -> str:
    """The commit of the repository that one stands in; empty where there is none."""
    try:
        told = subprocess.run(
            ["git", "rev-parse", "HEAD"], capture_output=True, text=True, timeout=PATIENCE
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return told.stdout.strip() if told.returncode == 0 else ""
