"""A robot's file as elements with lines, read as tolerantly as engines read it."""

from __future__ import annotations

import math
import re
from bisect import bisect_right
from codecs import BOM_UTF8
from functools import cached_property
from pathlib import Path

from physics_crosscheck.harness.documents.elements import XmlElement, read_elements, repaired_xml
from physics_crosscheck.harness.documents.errors import LocationError, quote
from physics_crosscheck.harness.documents.location import DECIMAL, SourceFile
from physics_crosscheck.harness.documents.reading import MAX_MODEL_BYTES, read_regular
from physics_crosscheck.harness.modelfiles.robot import ReadError
from physics_crosscheck.harness.records.case import CaseKind

_ENDLESS = re.compile(r"[+-]?inf(inity)?", re.IGNORECASE)
_UNEXPANDED = re.compile(r"\$[({]")
EXPAND = "expand it first: xacro FILE > robot.urdf"


class DocumentError(ValueError):
    """A file that is not XML."""

    kind = "file"

    def __init__(self, error: ReadError) -> None:
        super().__init__(str(error))
        self.error = error


class Document:
    """A file's elements, and the problems found in them.

    Args:
        path: of the file.
        written: its bytes; None: they are read.

    Attributes:
        path: of the file.
        data: its bytes, as UTF-8, with unchanged lines.
        omitted: number of bytes of the file before these: those of a byte order mark.
        elements: all of them, in order.
        obstacles: problems so far.

    Raises:
        DocumentError: for a file that is not XML.
    """

    def __init__(self, path: Path, written: bytes | None = None) -> None:
        self.path = path
        self.obstacles: list[ReadError] = []
        try:
            written = read_regular(path, MAX_MODEL_BYTES) if written is None else written
        except OSError as error:
            raise DocumentError(self._whole(f"can't be read: {error}", "give another")) from None
        self.data = repaired_xml(written)
        self.omitted = len(BOM_UTF8) if written.startswith(BOM_UTF8) else 0
        try:
            self.elements = read_elements(SourceFile(path, self.data))
        except LocationError as error:
            problem = ReadError(
                sentence=error.sentence, file=path, line=error.line or 0, remedy=error.remedy
            )
            raise DocumentError(problem) from None

    @property
    def root(self) -> XmlElement:
        """The first element."""
        return self.elements[0]

    def _whole(self, sentence: str, remedy: str) -> ReadError:
        return ReadError(sentence=sentence, file=self.path, line=0, remedy=remedy)

    @cached_property
    def _ends(self) -> list[int]:
        return [m.start() for m in re.finditer(rb"\r\n|\r|\n", self.data)]

    def line(self, element: XmlElement) -> int:
        """Return the line of an element, from 1."""
        return self.line_at(element.start)

    def line_at(self, offset: int) -> int:
        """Return the line of a byte, from 1."""
        return bisect_right(self._ends, offset) + 1

    def add_problem(
        self, element: XmlElement, sentence: str, remedy: str, kind: CaseKind = "robot"
    ) -> None:
        """Add a problem that prevents building a tree."""
        line = self.line(element)
        self.obstacles.append(
            ReadError(sentence=sentence, file=self.path, line=line, remedy=remedy, kind=kind)
        )

    def child(self, element: XmlElement, tag: str) -> XmlElement | None:
        """Return the child with this tag; several children are a problem unless they are equal."""
        children = [one for one in element.children if one.tag == tag]
        for other in children[1:]:
            if other.content != children[0].content:
                self.add_problem(
                    other, f"a second <{tag}> in one <{element.tag}>", "keep one of them"
                )
        return children[0] if children else None

    def numbers(
        self, element: XmlElement | None, key: str, default: tuple[float, ...], what: str
    ) -> tuple[float, ...]:
        """Return as many finite numbers of an attribute as the default has, or the default."""
        text = None if element is None else element.attributes.get(key)
        if element is None or text is None:
            return default
        values = read_numbers(text, len(default))
        if values is None or not all(map(math.isfinite, values)):
            count = len(default)
            wanted = "a finite number" if count == 1 else f"{count} finite numbers"
            remedy = (
                "write a number" if count == 1 else f"write {count} numbers, separated by spaces"
            )
            self.add_problem(
                element,
                f"{key} of {what} is {quote(text)}; expected {wanted}",
                EXPAND if _UNEXPANDED.search(text) else remedy,
                "file",
            )
            return default
        return values

    def text_numbers(
        self, element: XmlElement | None, default: tuple[float, ...], what: str
    ) -> tuple[float, ...]:
        """Return as many finite numbers of an element's text as the default has, or the default."""
        if element is None or not element.text.strip():
            return default
        values = read_numbers(element.text, len(default))
        if values is None or not all(map(math.isfinite, values)):
            count = len(default)
            wanted = "a finite number" if count == 1 else f"{count} finite numbers"
            self.add_problem(
                element,
                f"<{element.tag}> of {what} is {quote(element.text.strip())}; expected {wanted}",
                "write a number" if count == 1 else f"write {count} numbers, separated by spaces",
                "file",
            )
            return default
        return values

    def number(self, element: XmlElement | None, key: str, default: float, what: str) -> float:
        """Return one number of an attribute."""
        return self.numbers(element, key, (default,), what)[0]


def read_numbers(text: str, count: int) -> tuple[float, ...] | None:
    """Return `count` numbers, which may be infinite, or None if the text is anything else.

    A comma between two of them counts as a blank if that gives their number: "0.1, 0, 0".
    """
    words = text.split(",") if count > 1 and text.count(",") == count - 1 else text.split()
    words = [word.strip() for word in words]
    if len(words) != count:
        return None
    if not all(DECIMAL.fullmatch(word) or _ENDLESS.fullmatch(word) for word in words):
        return None
    return tuple(map(float, words))
