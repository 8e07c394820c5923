"""What every record is: a frozen struct with named fields, which knows no other field."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sized
from typing import Annotated

import msgspec

Number = float | None
"""A number as files hold it: None where it has no finite value."""

Count = Annotated[int, msgspec.Meta(ge=0, le=2**53)]
"""A whole number that every reader of JSON holds exactly."""

Numbers = tuple[Number, ...]
Rows = tuple[Numbers, ...]


class Record(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A value that travels from room to room and into files, the same in both.

    Sequences are tuples, and what is not finite is None already, so that a record which is written
    and read back equals the one that was written.
    """


Span = tuple[Count, Count]
"""The first byte of a number in its file, and the byte after its last."""


class SourceLine(Record, frozen=True, kw_only=True):
    """A line of a file, with the number that it refers to.

    Attributes:
        file: Name or path of the file.
        line: Line number, counted from 1; None for the whole file.
        span: First byte of the number and the byte after its last; None without a
            number.
        text: The number as written in the file; empty without a `span`.
    """

    file: str
    line: Count | None = None
    span: Span | None = None
    text: str = ""

    def __str__(self) -> str:
        return self.file if self.line is None else f"{self.file}:{self.line}"


def number(value: float | None) -> Number:
    """A number as a record holds it."""
    return None if value is None or not math.isfinite(value) else float(value)


def numbers(values: Iterable[float | None]) -> Numbers:
    """A row of them."""
    return tuple(number(value) for value in values)


def rows(values: Iterable[Iterable[float | None]]) -> Rows:
    """Rows of them, such as those of a matrix."""
    return tuple(numbers(row) for row in values)


def one_length(what: str, *columns: Sized) -> None:
    """Refuse columns of one table that are not equally long.

    Raises:
        ValueError: naming the table.
    """
    if len({len(column) for column in columns}) > 1:
        raise ValueError(f"{what} has columns of different lengths")
