"""A robot's file as elements with lines, read as forgivingly as engines read it."""

from __future__ import annotations

import math
import re
from bisect import bisect_right
from codecs import BOM_UTF8
from functools import cached_property
from pathlib import Path

from physics_crosscheck.harness.engines.mending import mended
from physics_crosscheck.harness.modelfiles.locations.location import (
    LocationError,
    RefusedError,
    Source,
)
from physics_crosscheck.harness.modelfiles.locations.xml import RawElement, read_elements
from physics_crosscheck.harness.modelfiles.quote import brief
from physics_crosscheck.harness.modelfiles.reading import MOST_MODEL, read_regular
from physics_crosscheck.harness.modelfiles.robot import Obstacle
from physics_crosscheck.harness.records.case import CaseKind

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_ENDLESS = re.compile(r"[+-]?inf(inity)?", re.IGNORECASE)
_UNEXPANDED = re.compile(r"\$[({]")
EXPAND = "expand it first: xacro FILE > robot.urdf"


class DocumentError(ValueError):
    """A file that is no XML."""

    kind = "file"

    def __init__(self, obstacle: Obstacle) -> None:
        super().__init__(str(obstacle))
        self.obstacle = obstacle


class Document:
    """A file's elements, and what is found wrong with them on the way.

    Args:
        path: of the file.
        written: its bytes; None: they are read.

    Attributes:
        path: of the file.
        data: its bytes, as UTF-8, with lines where they are.
        omitted: how many bytes of the file precede these: those of a byte order mark.
        elements: all of them, in their order.
        obstacles: so far.

    Raises:
        DocumentError: for what is no XML.
    """

    def __init__(self, path: Path, written: bytes | None = None) -> None:
        self.path = path
        self.obstacles: list[Obstacle] = []
        try:
            written = read_regular(path, MOST_MODEL) if written is None else written
        except OSError as error:
            raise DocumentError(self._whole(f"can't be read: {error}", "give another")) from None
        self.data = mended(written)
        self.omitted = len(BOM_UTF8) if written.startswith(BOM_UTF8) else 0
        try:
            self.elements = read_elements(Source(path, self.data))
        except LocationError as error:
            remedy = "remove that" if isinstance(error, RefusedError) else "write well-formed XML"
            found = Obstacle(
                sentence=error.sentence, file=path, line=error.line or 0, remedy=remedy
            )
            raise DocumentError(found) from None

    @property
    def root(self) -> RawElement:
        """The first element."""
        return self.elements[0]

    def _whole(self, sentence: str, remedy: str) -> Obstacle:
        return Obstacle(sentence=sentence, file=self.path, line=0, remedy=remedy)

    @cached_property
    def _ends(self) -> list[int]:
        return [m.start() for m in re.finditer(rb"\r\n|\r|\n", self.data)]

    def line(self, element: RawElement) -> int:
        """Where it begins, from 1."""
        return self.line_at(element.start)

    def line_at(self, offset: int) -> int:
        """Line of a byte, from 1."""
        return bisect_right(self._ends, offset) + 1

    def hinder(
        self, element: RawElement, sentence: str, remedy: str, kind: CaseKind = "robot"
    ) -> None:
        """Note what makes it impossible to build a tree."""
        line = self.line(element)
        self.obstacles.append(
            Obstacle(sentence=sentence, file=self.path, line=line, remedy=remedy, kind=kind)
        )

    def child(self, element: RawElement, tag: str) -> RawElement | None:
        """The one of this tag; several are an obstacle unless they say the same."""
        found = [one for one in element.children if one.tag == tag]
        for other in found[1:]:
            if _content(other) != _content(found[0]):
                self.hinder(other, f"a second <{tag}> in one <{element.tag}>", "keep one of them")
        return found[0] if found else None

    def numbers(
        self, element: RawElement | None, key: str, default: tuple[float, ...], what: str
    ) -> tuple[float, ...]:
        """So many finite numbers of an attribute as the default has, or the default."""
        text = None if element is None else element.attributes.get(key)
        if element is None or text is None:
            return default
        found = read_numbers(text, len(default))
        if found is None or not all(map(math.isfinite, found)):
            count = len(default)
            wanted = "a finite number" if count == 1 else f"{count} finite numbers"
            remedy = (
                "write a number" if count == 1 else f"write {count} numbers, separated by spaces"
            )
            self.hinder(
                element,
                f"{key} of {what} is {brief(text)}; expected {wanted}",
                EXPAND if _UNEXPANDED.search(text) else remedy,
                "file",
            )
            return default
        return found

    def text_numbers(
        self, element: RawElement | None, default: tuple[float, ...], what: str
    ) -> tuple[float, ...]:
        """So many finite numbers of an element's text as the default has, or the default."""
        if element is None or not element.text.strip():
            return default
        found = read_numbers(element.text, len(default))
        if found is None or not all(map(math.isfinite, found)):
            count = len(default)
            wanted = "a finite number" if count == 1 else f"{count} finite numbers"
            self.hinder(
                element,
                f"<{element.tag}> of {what} is {brief(element.text.strip())}; expected {wanted}",
                "write a number" if count == 1 else f"write {count} numbers, separated by spaces",
                "file",
            )
            return default
        return found

    def number(self, element: RawElement | None, key: str, default: float, what: str) -> float:
        """One."""
        return self.numbers(element, key, (default,), what)[0]


def read_numbers(text: str, count: int) -> tuple[float, ...] | None:
    """So many numbers, infinite ones among them; None where they are not.

    A comma between two of them is a blank where that makes their count: "0.1, 0, 0".
    """
    words = text.split(",") if count > 1 and text.count(",") == count - 1 else text.split()
    words = [word.strip() for word in words]
    if len(words) != count:
        return None
    if not all(NUMBER.fullmatch(word) or _ENDLESS.fullmatch(word) for word in words):
        return None
    return tuple(map(float, words))


def _content(element: RawElement) -> object:
    """What an element says, blanks apart."""
    attributes = sorted((key, value.split()) for key, value in element.attributes.items())
    inner = [_content(child) for child in element.children]
    return element.tag, attributes, element.text.split(), inner
