"""A number of a file."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from .elements import XmlElement
from .errors import quote
from .location import SourceFile, Span, apply_edits

_NUMBER = re.compile(r"[+-]?(?:\d[\d_]*\.?[\d_]*|\.\d[\d_]*)(?:[eE][+-]?\d+)?", re.ASCII)


@dataclass(frozen=True, kw_only=True)
class Number:
    """A number as written in a file.

    Attributes:
        file: that contains it.
        start, end: its first byte in the document, and the one after its last.
        line, column: of its first character, counted from 1; 0 if it has none.
        text: the number as written, including its sign.
        address: a unique address in its file.
        path: the tags that lead to it and its attribute, as in `robot/link/inertial/mass@value`; in
            TOML its key; in Python the name that it is assigned to, or empty.
        scale: the size that relative changes refer to: its own, or the largest of its list.
        within: the element that contains it; None in a file that is not XML.
        key: the attribute; empty for text.
        word: index in the attribute.
        omitted: number of bytes of the file before the document.
    """

    file: Path
    start: int
    end: int
    line: int
    text: str
    column: int = 0
    address: str = ""
    path: str = ""
    scale: float = 1.0
    within: XmlElement | None = None
    key: str = ""
    word: int = 0
    omitted: int = 0

    @property
    def value(self) -> float:
        """The number."""
        return float(self.text)

    @property
    def span(self) -> Span:
        """Its first byte in the file, and the one after its last."""
        return self.start + self.omitted, self.end + self.omitted

    @property
    def element(self) -> XmlElement:
        """The XML element that contains it."""
        assert self.within is not None
        return self.within

    def __str__(self) -> str:
        return f"{self.file}:{self.line}"


def read_number(
    source: SourceFile, span: Span, value: float, address: str, path: str = ""
) -> Number:
    """Return a number if its bytes equal the parser's value.

    Raises:
        LocationError: with its line.
    """
    start, end = span
    text = source.text(span)
    if not _NUMBER.fullmatch(text):
        raise source.error(address, f"is {quote(text)}; expected a decimal number", start)
    if float(text) != value:
        raise source.error(address, f"is written {quote(text)} but read as {value!r}", start)
    return Number(
        file=source.file, start=start, end=end, line=source.line(start),
        column=source.column(start), text=text, address=address, path=path,
    )  # fmt: skip


def replace_numbers(
    texts: Mapping[Path, bytes], words: Iterable[tuple[Number, str]]
) -> dict[Path, bytes]:
    """Return files' bytes with numbers replaced by other words."""
    changes: dict[Path, list[tuple[int, int, bytes]]] = {}
    for place, word in words:
        changes.setdefault(place.file, []).append((place.start, place.end, word.encode()))
    return {file: apply_edits(data, changes.get(file, ())) for file, data in texts.items()}
