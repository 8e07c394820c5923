"""The bytes of a file, and the shared parts of every search in it."""

from __future__ import annotations

import difflib
import re
from bisect import bisect_right
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from .errors import LocationError, quote, truncate

Span = tuple[int, int]
"""First byte of a number, and the one after its last."""


Resolve = Callable[[str], tuple[Span, float]]
"""A function from an address to its bytes and the parser's value there."""

DECIMAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
"""A finite number, as model files write it."""


@dataclass(frozen=True)
class SourceFile:
    """The bytes of a file, and errors that name their lines."""

    file: Path
    data: bytes

    def line(self, offset: int) -> int:
        """Return the line of a byte, counted from 1."""
        return bisect_right(self._starts, offset)

    @cached_property
    def _starts(self) -> list[int]:
        """Offsets of the first byte of each line."""
        return [0, *(match.end() for match in re.finditer(rb"\r\n|\r|\n", self.data))]

    def column(self, offset: int) -> int:
        """Return the column of a character's first byte, counted from 1."""
        start = self._starts[self.line(offset) - 1]
        return len(self.data[start:offset].decode("utf-8").removeprefix("\ufeff")) + 1

    def text(self, span: Span) -> str:
        """Return the text between two bytes."""
        return self.data[slice(*span)].decode("utf-8")

    def lines(self, offsets: Iterable[int]) -> str:
        """Return the lines of some bytes, in words."""
        numbers = [str(self.line(offset)) for offset in offsets]
        return ("line " if len(numbers) == 1 else "lines ") + ", ".join(numbers)

    def error(self, address: str, sentence: str, offset: int | None = None) -> LocationError:
        """Return an error about an address, because of the byte at `offset`."""
        line = None if offset is None else self.line(offset)
        return LocationError(f"{quote(address)} {sentence}", file=self.file, line=line)


def nearest(wanted: str, candidates: Iterable[str]) -> str:
    """Return the names most similar to a wanted one, as a list in words; at most six."""
    names = list(dict.fromkeys(candidates))
    alike = difflib.get_close_matches(wanted, names, n=6, cutoff=0.0) if wanted else names[:6]
    more = len(names) - len(alike)
    return ", ".join(map(truncate, alike)) + (f" and {more} more" if more else "")


def apply_edits(data: bytes, changes: Iterable[tuple[int, int, bytes]]) -> bytes:
    """Return a file's bytes with ranges (start, end) replaced; of overlapping ranges, the first."""
    pieces, done = list[bytes](), 0
    for start, end, new in sorted(changes):
        if start >= done:
            pieces += (data[done:start], new)
            done = end
    return b"".join((*pieces, data[done:]))
