"""Attributes of XML elements, set, added or taken out in the bytes of a file.

Elements go by their first byte, as the parser tells it; all else in the file stays as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import quoteattr

from physics_crosscheck.harness.modelfiles.locations.location import LocationError, Source
from physics_crosscheck.harness.modelfiles.locations.xml import (
    ATTRIBUTE,
    TAG,
    RawElement,
    read_elements,
)


@dataclass(frozen=True)
class Attribute:
    """What an attribute is to be.

    Attributes:
        start: first byte of its element.
        name: its name.
        value: its value; None: it is not to be there.
    """

    start: int
    name: str
    value: str | None


def elements(file: Path) -> tuple[RawElement, ...]:
    """Every element of an XML file, in its order.

    Raises:
        LocationError: for a file that can't be read or parsed.
    """
    try:
        return tuple(read_elements(Source(file, file.read_bytes())))
    except OSError as error:
        raise LocationError(f"can't be read: {error.strerror}", file=file) from None


def with_attributes(data: bytes, file: Path, wanted: Sequence[Attribute]) -> bytes:
    """The bytes of `file` with attributes set, added after an element's others, or taken out.

    Raises:
        LocationError: where no element starts at such a byte, or the bytes are no XML.
    """
    known = {element.start for element in read_elements(Source(file, data))}
    for one in sorted(wanted, key=lambda one: -one.start):
        if one.start not in known:
            raise LocationError(f"no element starts at byte {one.start}", file=file)
        data = _with(data, one)
    read_elements(Source(file, data))
    return data


def _with(data: bytes, one: Attribute) -> bytes:
    tag = TAG.match(data, one.start)
    assert tag is not None  # the parser has found an element here
    written = b"" if one.value is None else f" {one.name}={quoteattr(one.value)}".encode()
    at = tag.end()
    while match := ATTRIBUTE.match(data, at):
        if match[1].decode("utf-8") == one.name:
            return data[: match.start()] + written + data[match.end() :]
        at = match.end()
    return data[:at] + written + data[at:]
