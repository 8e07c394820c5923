"""A number in a file, and what every search for one shares."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.engines.protocol import FileError
from physics_crosscheck.harness.modelfiles.quote import brief, cut


class LocationError(FileError, ValueError):
    """An address that means no number or several; the message names file, line and remedy."""


class RefusedError(LocationError):
    """A file that is read no further, though an engine might: a DTD, or elements without end."""


@dataclass(frozen=True, kw_only=True)
class Location:
    """A number in a file.

    Attributes:
        file: path of the file.
        start: offset of its first byte.
        end: offset after its last byte.
        line: its line, counted from 1.
        column: its first character in that line, counted from 1.
        text: the number as written, its sign included.
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
"""From an address to its bytes and what the file's parser reads there."""

_NUMBER = re.compile(r"[+-]?(?:\d[\d_]*\.?[\d_]*|\.\d[\d_]*)(?:[eE][+-]?\d+)?", re.ASCII)


@dataclass(frozen=True)
class Source:
    """The bytes of a file, and errors that name their lines."""

    file: Path
    data: bytes

    def line(self, offset: int) -> int:
        """Line of a byte, counted from 1."""
        return len(re.findall(rb"\r\n|\r|\n", self.data[:offset])) + 1

    def lines(self, offsets: Iterable[int]) -> str:
        """Lines of some bytes, in words."""
        found = [str(self.line(offset)) for offset in offsets]
        return ("line " if len(found) == 1 else "lines ") + ", ".join(found)

    def error(self, address: str, sentence: str, offset: int | None = None) -> LocationError:
        """An address can't be resolved, because of the byte at `offset`."""
        line = None if offset is None else self.line(offset)
        return LocationError(f"{brief(address)} {sentence}", file=self.file, line=line)

    def place(self, found: tuple[Span, float], address: str) -> Location:
        """The place of a number, if its bytes say what the file's parser has read there."""
        (start, end), read = found
        text = self.data[start:end].decode("utf-8")
        if not _NUMBER.fullmatch(text):
            raise self.error(address, f"is {brief(text)}; expected a decimal number", start)
        if float(text) != read:
            raise self.error(address, f"is written {brief(text)} but read as {read!r}", start)
        before = re.split(rb"\r\n|\r|\n", self.data[:start])
        column = len(before[-1].decode("utf-8").removeprefix("\ufeff")) + 1
        return Location(
            file=self.file, start=start, end=end, line=len(before), column=column, text=text
        )


def nearest(wanted: str, known: Iterable[str]) -> str:
    """The names most alike to a wanted one, as a list in words; at most six."""
    names = list(dict.fromkeys(known))
    alike = difflib.get_close_matches(wanted, names, n=6, cutoff=0.0) if wanted else names[:6]
    more = len(names) - len(alike)
    return ", ".join(map(cut, alike)) + (f" and {more} more" if more else "")
