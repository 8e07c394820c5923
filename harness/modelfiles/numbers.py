"""Every number in a robot's file: its address, and how to change it.

Numbers are read as tolerantly as the file itself: commas may separate them.
"""

import os
import re
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.elements import (
    Number,
    XmlElement,
    attribute_span,
    replace_numbers,
    text_span,
)
from physics_crosscheck.harness.documents.reading import DECIMAL
from physics_crosscheck.reference.mechanism.tree import Tree

_WORD = re.compile(r"[^\s,]+")
_IDENTITIES = ("name", "class", "file")
"""Attributes that are names, though they may look like numbers."""

SMALL = 1e-6
"""A list whose numbers are at most this large has no size of its own."""

UNSIZED = 0.1
"""The size of such numbers: m, rad, kg, kg m^2."""

NUDGE = 1e-5
"""Share of its size by which a number is changed to see its effect; it leaves half of its
digits.
"""


class ModelFile(ABC):
    """A robot's file with its includes: their numbers, and the tree for other values.

    Args:
        documents: the file and its includes.

    Attributes:
        numerals: all numbers, in order.
        unread: why numbers of some of its files are missing, one sentence each.
    """

    unread: tuple[str, ...] = ()

    def __init__(self, documents: Sequence[Document]) -> None:
        self._texts = {one.path: one.data for one in documents}
        self.numerals = tuple(one for document in documents for one in numerals(document))

    @property
    @abstractmethod
    def relevant_numbers(self) -> tuple[int, ...]:
        """Indices of the numbers that may affect the tree."""

    @abstractmethod
    def tree(self, values: Mapping[int, float]) -> Tree | None:
        """Return the tree with other values of some numbers, by index, or None."""

    def texts(self, values: Mapping[int, float]) -> Mapping[Path, bytes]:
        """Return the files, by path, with other values of some numbers."""
        words = ((self.numerals[i], repr(value)) for i, value in values.items())
        return replace_numbers(self._texts, words)

    @property
    def read_numbers(self) -> frozenset[int]:
        """Indices of the law's numbers whose compiled values are compared with the file's text."""
        return frozenset()

    def placing(self, candidates: Collection[int]) -> Collection[int]:
        """Return those numbers that shapes and sites depend on: where they are, or their sizes."""
        return ()

    def engine_variants(self) -> Iterable[tuple[str, Tree]]:
        """Return differences of the engine that compiles the file: causes, each with its tree."""
        return ()


def numerals(document: Document) -> tuple[Number, ...]:
    """Return every number of a file, in order."""
    paths = _paths(document)
    names = ElementAddresses(document)
    result: list[Number] = []
    for element in document.elements:
        rows = [row for key in _keys(element) if (row := _row(document, element, key))]
        for key, spans, values in rows:
            sizes = [abs(value) for value in _related(element, key, rows, values)]
            for word, (start, end) in enumerate(spans):
                ending = (f"@{key}" if key else "") + (f"[{word}]" if len(values) > 1 else "")
                largest = max(sizes)
                result.append(
                    Number(
                        file=document.path,
                        start=start,
                        end=end,
                        line=document.source.line(start),
                        text=document.data[start:end].decode(),
                        address=names.address(element, key) + ending,
                        path=paths[id(element)] + (f"@{key}" if key else ""),
                        scale=largest if largest > SMALL else UNSIZED,
                        within=element,
                        key=key,
                        word=word,
                        omitted=document.omitted,
                    )
                )
    return tuple(result)


def replace_word(text: str, word: int, value: float) -> str:
    """Return a list of numbers with one of them replaced, by index."""
    spans = [match.span() for match in _WORD.finditer(text)]
    start, end = spans[word]
    return text[:start] + repr(value) + text[end:]


def set_temporarily(number: Number, value: float, restored: ExitStack) -> None:
    """Set another value until the exit stack closes."""
    element, text = number.element, number.element.text
    attributes = element.attributes
    restored.callback(_restore, element, attributes, text)
    if number.key:
        changed = {
            **attributes,
            number.key: replace_word(attributes[number.key], number.word, value),
        }
        _restore(element, changed, text)
    else:
        _restore(element, attributes, replace_word(text, number.word, value))


def _restore(element: XmlElement, attributes: dict[str, str], text: str) -> None:
    element.attributes, element.text = attributes, text


_Row = tuple[str, list[tuple[int, int]], list[float]]
"""An attribute, the spans of its numbers, and their values."""


def _keys(element: XmlElement) -> list[str]:
    keys = [key for key in element.attributes if key not in _IDENTITIES]
    return keys if element.children or not element.text.strip() else [*keys, ""]


def _row(document: Document, element: XmlElement, key: str) -> _Row | None:
    """Return the numbers of an attribute, or of the text; None for other content."""
    text = element.attributes[key] if key else element.text
    words = _WORD.findall(text)
    if not words or not all(map(DECIMAL.fullmatch, words)):
        return None
    source = document.source
    start, end = attribute_span(element, key, source) if key else text_span(element, source)
    spans = [
        (start + match.start(), start + match.end())
        for match in re.finditer(rb"[^\s,]+", document.data[start:end])
    ]
    if [document.data[a:b].decode() for a, b in spans] != words:
        return None  # spelled with references, or cut by a comment
    return key, spans, [float(word) for word in words]


def _related(element: XmlElement, key: str, rows: list[_Row], values: list[float]) -> list[float]:
    """Return numbers of one kind: a list, or the six of a tensor."""
    if element.tag == "inertia":
        return [value for other, _, row in rows for value in row if other.startswith("i")] or values
    return values


def _paths(document: Document) -> dict[int, str]:
    paths: dict[int, str] = {}
    for element in document.elements:
        outer = "" if element.parent is None else f"{paths[id(element.parent)]}/"
        paths[id(element)] = f"{outer}{element.tag}"
    return paths


class ElementAddresses:
    """Addresses of a file's elements, with the number of times that each occurs."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._counts: Counter[tuple[str, str]] = Counter()
        self._spelled: dict[int, list[str]] = {}
        for element in document.elements:
            steps = range(1, element.depth + 1)
            spelled = self._spelled[id(element)] = [element.spelled(count) for count in steps]
            self._counts.update(
                (path, key) for path in spelled for key in (*element.attributes, "")
            )

    def address(self, element: XmlElement, key: str) -> str:
        """Return the shortest unique address that begins with a name, or the whole path, or one
        with line and column.
        """
        spelled = self._spelled[id(element)]
        named = [path for path in spelled if "[" in path.split("/")[0]]
        for path in (*named, spelled[-1]):
            if self._counts[path, key] == 1:
                return path
        line = self._document.line(element)
        column = element.start - self._document.data.rfind(b"\n", 0, element.start)
        return f"{line}:{column} {spelled[0]}"


def copy_with_texts(file: Path, texts: Mapping[Path, bytes], folder: Path) -> Path:
    """Write a file and its includes with other texts, and link to the other files of the folder.

    Compiled Python stays behind: it would be taken for that of the copy.
    """
    top = Path(os.path.commonpath([path.parent.resolve() for path in texts]))
    for path, data in texts.items():
        copy = folder / path.resolve().relative_to(top)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(data)
    for neighbour in top.iterdir():
        if neighbour.name != "__pycache__" and not (folder / neighbour.name).exists():
            (folder / neighbour.name).symlink_to(neighbour)
    copied = file if file in texts else next(iter(texts))  # a layer over the file
    return folder / copied.resolve().relative_to(top)
