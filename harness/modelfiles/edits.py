"""Numbers of a file written otherwise: all other bytes stay."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from physics_crosscheck.harness.modelfiles.locations import Location


def spliced(data: bytes, changes: Iterable[tuple[int, int, bytes]]) -> bytes:
    """A file's bytes with others from some offset to another, which don't overlap."""
    for start, end, new in sorted(changes, reverse=True):
        data = data[:start] + new + data[end:]
    return data


def reworded(
    texts: Mapping[Path, bytes], words: Iterable[tuple[Location, str]]
) -> dict[Path, bytes]:
    """Files' bytes with other words for numbers in them."""
    changes: dict[Path, list[tuple[int, int, bytes]]] = {}
    for place, word in words:
        changes.setdefault(place.file, []).append((place.start, place.end, word.encode()))
    return {file: spliced(data, changes.get(file, ())) for file, data in texts.items()}
