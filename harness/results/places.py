"""Paths of files relative to the working folder."""

import os
import re
from collections.abc import Iterable
from pathlib import Path

from msgspec.structs import replace

from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.finding import Explanation


def shown_path(path: str | Path) -> str:
    """Return a path relative to the working folder if it is inside; otherwise unchanged."""
    here, whole = Path.cwd(), Path(os.path.abspath(path))
    return str(whole.relative_to(here) if whole.is_relative_to(here) else path)


def shown_line(folder: str, where: SourceLine) -> SourceLine:
    """Return a line of a model's file, with its path relative to the working folder."""
    place = Path(folder)
    path = (place if place.is_dir() else place.parent) / Path(where.file).name
    return replace(where, file=shown_path(path)) if path.is_file() else where


def is_spelled(where: SourceLine, name: str, data: bytes) -> bool:
    """Return whether a location is in the named file and its span still has its text.

    Args:
        where: the location.
        name: name of a model file or its sidecar, without folders.
        data: content of that file.
    """
    folder, is_found = where.file.removesuffix(name), where.file.endswith(name)
    if where.span is None or not is_found or folder[-1:] not in ("", "/", "\\"):
        return False
    return bool(where.text) and data[slice(*where.span)] == where.text.encode()


def column(where: SourceLine, text: str) -> int:
    """Return the column of a location's first character, counted from 1.

    Args:
        where: a location whose text is still in the file.
        text: text of the file.
    """
    assert where.span is not None
    before = text.encode()[: where.span[0]].decode(errors="replace").removeprefix("\ufeff")
    return len(re.split(r"\r\n|\r|\n", before)[-1]) + 1


def placed(explanation: Explanation, folder: str) -> Explanation:
    """Return an explanation whose lines have paths relative to the working folder."""
    causes = tuple(
        replace(cause, locations=tuple(shown_line(folder, one) for one in cause.locations))
        for cause in explanation.causes
    )
    return replace(explanation, causes=causes)


def lines_listed(places: Iterable[tuple[SourceLine | None, str]], folder: str) -> str:
    """Return lines of files, naming each file once: `a.urdf:12 link, :40 hand`."""
    parts, last = [], ""
    for where, name in places:
        if where is None:
            continue
        shown = shown_line(folder, where) if folder else where
        place = str(shown)
        if shown.file == last and shown.line is not None:
            place = f":{shown.line}"
        last = shown.file
        parts.append(f"{place} {name}".rstrip())
    return ", ".join(dict.fromkeys(parts))
