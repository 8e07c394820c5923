"""Every number that a robot's file spells: where it stands, what it is called, and how to move it.

Read as forgivingly as the file itself: numbers may have commas between them.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.modelfiles.document import NUMBER, Document
from physics_crosscheck.harness.modelfiles.edits import spliced
from physics_crosscheck.harness.modelfiles.locations.location import Source
from physics_crosscheck.harness.modelfiles.locations.xml import (
    ATTRIBUTE,
    TAG,
    RawElement,
    attribute_span,
)

_WORD = re.compile(r"[^\s,]+")
_IDENTITIES = ("name", "class", "file")
"""Attributes that are names, though they may look like numbers."""

SMALL = 1e-6
"""A number that stands beside none larger than this is as good as zero: it says no size."""

UNSIZED = 0.1
"""The size of a number where neither it nor one beside it says any: m, rad, kg, kg m^2."""

NUDGE = 1e-5
"""Share of its size by which a number is moved to see what it does: half its digits are left."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Numeral:
    """A number as a file spells it.

    Attributes:
        address: what it is called, once in its file; the shortest such name that tells its place.
        path: the tags that lead to it and its attribute, as in `robot/link/inertial/mass@value`.
        file: in which it stands.
        line: of it, from 1.
        start, end: its first byte in the document's, and the one after its last.
        span: the same in the file itself.
        text: the number as it is spelled there.
        value: it.
        scale: a size that a change of it may be a share of: its own, or that of the numbers beside.
        element: in which it stands.
        key: the attribute; empty of a text.
        word: which number of the attribute.
    """

    address: str
    path: str
    file: Path
    line: int
    start: int
    end: int
    span: tuple[int, int]
    text: str
    value: float
    scale: float
    element: RawElement
    key: str
    word: int

    @property
    def has_name(self) -> bool:
        """Return whether the address names its element, wherever that is in the file."""
        return not self.address[0].isdigit()


def numerals(document: Document) -> tuple[Numeral, ...]:
    """Every number of a file, in its order."""
    paths = _paths(document)
    names = _Names(document)
    found: list[Numeral] = []
    for element in document.elements:
        rows = [row for key in _keys(element) if (row := _row(document, element, key))]
        for key, spans, values in rows:
            beside = [abs(value) for value in _beside(element, key, rows, values)]
            for word, ((start, end), value) in enumerate(zip(spans, values, strict=True)):
                ending = (f"@{key}" if key else "") + (f"[{word}]" if len(values) > 1 else "")
                line = document.line_at(start)
                largest = max(beside)
                found.append(
                    Numeral(
                        address=names.of(element, key) + ending,
                        path=paths[id(element)] + (f"@{key}" if key else ""),
                        file=document.path,
                        line=line,
                        start=start,
                        end=end,
                        span=(start + document.omitted, end + document.omitted),
                        text=document.data[start:end].decode(),
                        value=value,
                        scale=largest if largest > SMALL else UNSIZED,
                        element=element,
                        key=key,
                        word=word,
                    )
                )
    return tuple(found)


def with_values(data: bytes, found: Sequence[Numeral], values: Mapping[int, float]) -> bytes:
    """A document's bytes with other values of some of its numbers, by their index."""
    places = ((found[index], value) for index, value in values.items())
    return spliced(data, ((one.start, one.end, repr(value).encode()) for one, value in places))


def reworded(text: str, word: int, value: float) -> str:
    """A list of numbers with another one, by its place."""
    spans = [match.span() for match in _WORD.finditer(text)]
    start, end = spans[word]
    return text[:start] + repr(value) + text[end:]


def put(one: Numeral, value: float, restored: ExitStack) -> None:
    """Another value for a while."""
    element, text = one.element, one.element.text
    attributes = element.attributes
    restored.callback(_restore, element, attributes, text)
    if one.key:
        changed = {**attributes, one.key: reworded(attributes[one.key], one.word, value)}
        _restore(element, changed, text)
    else:
        _restore(element, attributes, reworded(text, one.word, value))


def _restore(element: RawElement, attributes: Mapping[str, str], text: str) -> None:
    element.attributes, element.text = attributes, text


_Row = tuple[str, list[tuple[int, int]], list[float]]
"""An attribute, where its numbers are, and what they are."""


def _keys(element: RawElement) -> list[str]:
    keys = [key for key in element.attributes if key not in _IDENTITIES]
    return keys if element.children or not element.text.strip() else [*keys, ""]


def _row(document: Document, element: RawElement, key: str) -> _Row | None:
    """The numbers of an attribute, or of the text; None where there is anything else."""
    text = element.attributes[key] if key else element.text
    words = _WORD.findall(text)
    if not words or not all(map(NUMBER.fullmatch, words)):
        return None
    source = Source(document.path, document.data)
    start, end = attribute_span(element, key, source) if key else _text_span(document, element)
    spans = [
        (start + match.start(), start + match.end())
        for match in re.finditer(rb"[^\s,]+", document.data[start:end])
    ]
    if [document.data[a:b].decode() for a, b in spans] != words:
        return None  # spelled with references, or cut by a comment
    return key, spans, [float(word) for word in words]


def _text_span(document: Document, element: RawElement) -> tuple[int, int]:
    tag = TAG.match(document.data, element.start)
    assert tag is not None  # the parser has found an element here
    at = tag.end()
    while match := ATTRIBUTE.match(document.data, at):
        at = match.end()
    return document.data.index(b">", at) + 1, element.end


def _beside(element: RawElement, key: str, rows: list[_Row], values: list[float]) -> list[float]:
    """Numbers of one kind: a list, or the six of a tensor."""
    if element.tag == "inertia":
        return [value for other, _, row in rows for value in row if other.startswith("i")] or values
    return values


def _paths(document: Document) -> dict[int, str]:
    found: dict[int, str] = {}
    for element in document.elements:
        outer = "" if element.parent is None else f"{found[id(element.parent)]}/"
        found[id(element)] = f"{outer}{element.tag}"
    return found


class _Names:
    """Addresses of a file's elements, by how often each is there."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._counts: Counter[tuple[str, str]] = Counter()
        self._spelled: dict[int, list[str]] = {}
        for element in document.elements:
            spelled = self._spelled[id(element)] = _spelled(element)
            self._counts.update(
                (path, key) for path in spelled for key in (*element.attributes, "")
            )

    def of(self, element: RawElement, key: str) -> str:
        """The shortest that begins with a name, or the whole way; with its place where several are
        so called.
        """
        spelled = self._spelled[id(element)]
        named = [path for path in spelled if "[" in path.split("/")[0]]
        for path in (*named, spelled[-1]):
            if self._counts[path, key] == 1:
                return path
        line = self._document.line(element)
        column = element.start - self._document.data.rfind(b"\n", 0, element.start)
        return f"{line}:{column} {spelled[0]}"


def _spelled(element: RawElement) -> list[str]:
    """Its addresses, from one step on."""
    own = element.tag if element.identity is None else f"{element.tag}[{element.identity}]"
    found, above = [own], element.parent
    while above is not None:
        step = above.tag if above.identity is None else f"{above.tag}[{above.identity}]"
        found.append(f"{step}/{found[-1]}")
        above = above.parent
    return found
