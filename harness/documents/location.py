"""A number in a file, and the shared parts of every search."""

from __future__ import annotations

import difflib
import re
from bisect import bisect_right
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from .errors import LocationError, quote, truncate


@dataclass(frozen=True, kw_only=True)
class Location:
    """A number in a file.

    Attributes:
        file: path of the file.
        start: offset of its first byte.
        end: offset after its last byte.
        line: its line, counted from 1.
        column: its first character in that line, counted from 1.
        text: the number as written, including its sign.
    """

    file: Path
    start: int
    end: int
    line: int
    column: int
    text: str

    @property
    def value(self) -> float:
        """The number."""
        return float(self.text)

    def __str__(self) -> str:
        return f"{self.file}:{self.line}"


Span = tuple[int, int]
"""First byte of a number, and the one after its last."""


Resolve = Callable[[str], tuple[Span, float]]
"""A function from an address to its bytes and the parser's value there."""

DECIMAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
"""A finite number, as model files write it."""

_NUMBER = re.compile(r"[+-]?(?:\d[\d_]*\.?[\d_]*|\.\d[\d_]*)(?:[eE][+-]?\d+)?", re.ASCII)


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

    def lines(self, offsets: Iterable[int]) -> str:
        """Return the lines of some bytes, in words."""
        numbers = [str(self.line(offset)) for offset in offsets]
        return ("line " if len(numbers) == 1 else "lines ") + ", ".join(numbers)

    def error(self, address: str, sentence: str, offset: int | None = None) -> LocationError:
        """Return an error about an address, because of the byte at `offset`."""
        line = None if offset is None else self.line(offset)
        return LocationError(f"{quote(address)} {sentence}", file=self.file, line=line)

    def place(self, number: tuple[Span, float], address: str) -> Location:
        """Return the place of a number if its bytes equal the parser's value."""
        (start, end), read = number
        text = self.data[start:end].decode("utf-8")
        if not _NUMBER.fullmatch(text):
            raise self.error(address, f"is {quote(text)}; expected a decimal number", start)
        if float(text) != read:
            raise self.error(address, f"is written {quote(text)} but read as {read!r}", start)
        line = self.line(start)
        before = self.data[self._starts[line - 1] : start].decode("utf-8").removeprefix("\ufeff")
        return Location(
            file=self.file, start=start, end=end, line=line, column=len(before) + 1, text=text
        )


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


def replace_numbers(
    texts: Mapping[Path, bytes], words: Iterable[tuple[Location, str]]
) -> dict[Path, bytes]:
    """Return files' bytes with numbers replaced by other words."""
    changes: dict[Path, list[tuple[int, int, bytes]]] = {}
    for place, word in words:
        changes.setdefault(place.file, []).append((place.start, place.end, word.encode()))
    return {file: apply_edits(data, changes.get(file, ())) for file, data in texts.items()}
