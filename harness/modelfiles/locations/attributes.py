"""Attributes of XML elements, set, added or removed in the bytes of a file.

Elements are identified by their first byte; all else in the file stays unchanged.
"""

from collections.abc import Sequence
from pathlib import Path

from physics_crosscheck.harness.documents.elements import XmlElement, end_offset, read_elements
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.reading import SourceFile
from . import read_source

Attribute = tuple[int, str, str | None]
"""The first byte of an element, the name of an attribute, and its new value; None removes it."""


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
    for start, name, value in wanted:
        if start not in copies:
            raise LocationError(f"no element starts at byte {start}", file=file)
        attributes = copies[start].attributes
        attributes.pop(name, None)
        if value is not None:
            attributes[name] = value
    data = data[: root.start] + changed.written() + data[end_offset(root, source) :]
    read_elements(SourceFile(file, data))
    return data
