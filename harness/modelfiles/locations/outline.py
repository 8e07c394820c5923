"""A whole XML file with the bytes of its content, to compare two files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.documents.elements import (
    XmlElement,
    attribute_spans,
    end_offset,
    read_elements,
)
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.location import SourceFile, Span
from .xml import find_words


@dataclass(frozen=True, kw_only=True)
class Value:
    """The value of an attribute or an element's text.

    Attributes:
        text: as the parser reads it.
        span: its bytes.
        outer: those of the whole attribute, with the space before it.
        words: the bytes of each word; empty for text with references.
        line: counted from 1; 0 without text.
    """

    text: str
    span: Span
    outer: Span
    words: tuple[Span, ...]
    line: int


@dataclass(frozen=True, kw_only=True)
class Element:
    """An element with its bytes.

    Attributes:
        key: tag, name and index among elements with both equal, by which it is matched.
        label: a unique address in the sense of `harness.modelfiles.locations`, if there is one.
        start, end: first byte, and the one after its last.
        tag_end: where another attribute could be written.
        inner_end: where another child could be written; 0 if it has no closing tag.
    """

    tag: str
    key: tuple[str, str | None, int]
    label: str
    line: int
    attributes: Mapping[str, Value]
    text: Value
    children: tuple[Element, ...]
    start: int
    end: int
    tag_end: int
    inner_end: int


MARKUP = (".xml", ".urdf", ".sdf")
"""Suffixes of model files that are XML."""


def outline(file: Path, data: bytes) -> Element:
    """Read a whole file.

    Raises:
        LocationError: naming file and line.
    """
    source = SourceFile(file, data)
    try:
        data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise LocationError(
            f"byte {error.start} is not UTF-8; save the file as UTF-8", file=file
        ) from None
    raw = read_elements(source)
    return _element(source, raw[0], (raw[0].tag, raw[0].identity, 0))


def _element(source: SourceFile, raw: XmlElement, key: tuple[str, str | None, int]) -> Element:
    data = source.data
    spans, position = attribute_spans(raw, source)
    attributes = {
        name: _value(source, raw.attributes[name], inner, outer)
        for name, (outer, inner) in spans.items()
    }
    close, end = data.index(b">", position), end_offset(raw, source)
    closed = end > close + 1
    text = Value(text="", span=(position, position), outer=(position, position), words=(), line=0)
    if closed and not raw.children and raw.text.strip():
        inner = close + 1, raw.end
        text = _value(source, raw.text, inner, inner)
    counts: dict[tuple[str, str | None], int] = {}
    children = []
    for child in raw.children:
        like = child.tag, child.identity
        counts[like] = counts.get(like, -1) + 1
        children.append(_element(source, child, (*like, counts[like])))
    # As in addresses: up to the nearest element with a name.
    steps, named = 1, raw
    while (
        "name" not in named.attributes
        and named.parent is not None
        and named.parent.parent is not None
    ):
        steps, named = steps + 1, named.parent
    return Element(
        tag=raw.tag,
        key=key,
        label=raw.spelled(steps),
        line=source.line(raw.start),
        attributes=attributes,
        text=text,
        children=tuple(children),
        start=raw.start,
        end=end,
        tag_end=position,
        inner_end=raw.end if closed else 0,
    )


def _value(source: SourceFile, text: str, span: Span, outer: Span) -> Value:
    try:
        words = tuple(find_words(source, *span, "a value"))
    except LocationError:
        words = ()
    return Value(text=text, span=span, outer=outer, words=words, line=source.line(span[0]))
