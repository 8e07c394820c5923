"""A page on a sweep, in the report's style; it runs no script."""

from __future__ import annotations

from pathlib import Path

from harness.records.sweep import SweepSummary
from harness.records.write import write_whole


def write_sweep(path: Path, found: SweepSummary) -> None:
    """Write the page."""
    write_whole(path, str(found.done))
