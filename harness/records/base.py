"""The base of all records: a frozen struct with named fields that rejects unknown fields."""

import math
from collections.abc import Iterable, Sequence, Sized
from typing import Annotated, Any, TypeVar

import msgspec

Number = float | None
"""A number in a file: None if it has no finite value."""

Count = Annotated[int, msgspec.Meta(ge=0, le=2**53)]
"""A whole number that every JSON reader represents exactly."""

Numbers = tuple[Number, ...]
Rows = tuple[Numbers, ...]


class Record(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A value that passes between folders and into files, the same in both.

    Sequences are tuples and values that are not finite become None, so a record that is written and
    read back equals the original.
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
    """Convert a number for a record."""
    return None if value is None or not math.isfinite(value) else float(value)


def numbers(values: Iterable[float | None]) -> Numbers:
    """Convert a row of numbers."""
    return tuple(number(value) for value in values)


def rows(values: Iterable[Iterable[float | None]]) -> Rows:
    """Convert rows of numbers, such as those of a matrix."""
    return tuple(numbers(row) for row in values)


R = TypeVar("R", bound=Record)


def record_of(kind: type[R], source: object, **fields: Any) -> R:
    """Return a record with these fields, and with the attributes of an object for all others.

    Raises:
        AttributeError: for a field that is neither given nor an attribute.
    """
    rest = (name for name in kind.__struct_fields__ if name not in fields)
    return kind(**fields, **{name: _plain(getattr(source, name)) for name in rest})


def _plain(value: Any) -> Any:
    """Convert a value of a record: numpy's to Python's, and numbers to finite ones or None."""
    value = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(value, list | tuple) and not hasattr(value, "_fields"):
        return tuple(map(_plain, value))
    return number(value) if isinstance(value, float) else value


def rounded(values: Sequence[float], digits: int) -> Numbers:
    """Round a row to significant digits, as one text: a large report has 60 million numbers."""
    text = f"%.{digits}g " * len(values) % tuple(values)
    return tuple(x if math.isfinite(x) else None for x in map(float, text.split()))


def one_length(what: str, *columns: Sized) -> None:
    """Reject columns of one table that differ in length.

    Raises:
        ValueError: naming the table.
    """
    if len({len(column) for column in columns}) > 1:
        raise ValueError(f"{what} has columns of different lengths")
