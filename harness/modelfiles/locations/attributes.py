"""Attributes of XML elements, set, added or removed in the bytes of a file.

Elements are identified by their first byte; all else in the file stays unchanged.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.documents.elements import XmlElement, end_offset, read_elements
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.reading import SourceFile
from . import read_source


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
    return read_elements(read_source(file))


def with_attributes(data: bytes, file: Path, wanted: Sequence[Attribute]) -> bytes:
    """Return the bytes of `file` with attributes set, added after an element's others, or removed.

    Raises:
        LocationError: if no element starts at such a byte, or the bytes are not XML.
    """
    source = SourceFile(file, data)
    root = read_elements(source)[0]
    changed = root.copy()
    copies = {element.start: element for element in changed.iter()}
    for attribute in wanted:
        if attribute.start not in copies:
            raise LocationError(f"no element starts at byte {attribute.start}", file=file)
        attributes = copies[attribute.start].attributes
        attributes.pop(attribute.name, None)
        if attribute.value is not None:
            attributes[attribute.name] = attribute.value
    data = data[: root.start] + changed.written() + data[end_offset(root, source) :]
    read_elements(SourceFile(file, data))
    return data
