"""Places of files as a person is told them: from where one stands."""

from __future__ import annotations

import os
from pathlib import Path

from msgspec.structs import replace

from harness.records.base import SourceLine
from harness.records.finding import Explanation


def shown_path(path: str | Path) -> str:
    """A path from where one stands, if it lies below; else as it is."""
    here, whole = Path.cwd(), Path(os.path.abspath(path))
    return str(whole.relative_to(here) if whole.is_relative_to(here) else path)


def shown_line(folder: str, where: SourceLine) -> SourceLine:
    """A line of a model's file, with the path from where one stands."""
    place = Path(folder)
    beside = (place if place.is_dir() else place.parent) / Path(where.file).name
    return replace(where, file=shown_path(beside)) if beside.is_file() else where


def placed(explanation: Explanation, folder: str) -> Explanation:
    """An explanation whose lines have paths from where one stands."""
    causes = tuple(
        replace(cause, where=tuple(shown_line(folder, one) for one in cause.where))
        for cause in explanation.causes
    )
    return replace(explanation, causes=causes)
