"""Replacement of numbers in a file: all other bytes stay."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from physics_crosscheck.harness.modelfiles.locations import Location


def apply_edits(data: bytes, changes: Iterable[tuple[int, int, bytes]]) -> bytes:
    """Return a file's bytes with ranges (start, end) replaced; ranges must not overlap."""
    for start, end, new in sorted(changes, reverse=True):
        data = data[:start] + new + data[end:]
    return data


def replace_numbers(
    texts: Mapping[Path, bytes], words: Iterable[tuple[Location, str]]
) -> dict[Path, bytes]:
    """Return files' bytes with numbers replaced by other words."""
    changes: dict[Path, list[tuple[int, int, bytes]]] = {}
    for place, word in words:
        changes.setdefault(place.file, []).append((place.start, place.end, word.encode()))
    return {file: apply_edits(data, changes.get(file, ())) for file, data in texts.items()}
