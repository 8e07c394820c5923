"""Attributes of XML elements, set, added or removed in the bytes of a file.

Elements are identified by their first byte; all else in the file stays unchanged.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import quoteattr

from physics_crosscheck.harness.documents.elements import ATTRIBUTE, TAG, XmlElement, read_elements
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.location import SourceFile


@dataclass(frozen=True)
class Attribute:
    """A new value of an attribute.

    Attributes:
        start: first byte of its element.
        name: its name.
        value: its value, or None to remove it.
    """

    start: int
    name: str
    value: str | None


def elements(file: Path) -> tuple[XmlElement, ...]:
    """Return every element of an XML file, in order.

    Raises:
        LocationError: for a file that can't be read or parsed.
    """
    try:
        return tuple(read_elements(SourceFile(file, file.read_bytes())))
    except OSError as error:
        raise LocationError(f"can't be read: {error.strerror}", file=file) from None


def with_attributes(data: bytes, file: Path, wanted: Sequence[Attribute]) -> bytes:
    """Return the bytes of `file` with attributes set, added after an element's others, or removed.

    Raises:
        LocationError: if no element starts at such a byte, or the bytes are not XML.
    """
    starts = {element.start for element in read_elements(SourceFile(file, data))}
    for attribute in sorted(wanted, key=lambda attribute: -attribute.start):
        if attribute.start not in starts:
            raise LocationError(f"no element starts at byte {attribute.start}", file=file)
        data = _with(data, attribute)
    read_elements(SourceFile(file, data))
    return data


def _with(data: bytes, attribute: Attribute) -> bytes:
    tag = TAG.match(data, attribute.start)
    assert tag is not None  # the parser has found an element here
    written = (
        b""
        if attribute.value is None
        else f" {attribute.name}={quoteattr(attribute.value)}".encode()
    )
    position = tag.end()
    while match := ATTRIBUTE.match(data, position):
        if match[1].decode("utf-8") == attribute.name:
            return data[: match.start()] + written + data[match.end() :]
        position = match.end()
    return data[:position] + written + data[position:]
