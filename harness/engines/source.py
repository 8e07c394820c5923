"""A model file before its engine sees it: what makes it hang or crash is refused here, by line."""

from __future__ import annotations

import math
import re
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from xml.parsers import expat

import defusedxml.ElementTree

from physics_crosscheck.harness.engines.mending import UTF_16, mended
from physics_crosscheck.harness.engines.protocol import EngineError

LARGEST = 64_000_000
"""Bytes of a model file: what is larger is none."""

DEEPEST = 200
"""Nested elements: engines' parsers call themselves for each, and crash on thousands."""

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


class NoXmlError(EngineError):
    """A file that is no XML; `second_root`: but for what follows its root."""

    def __init__(self, sentence: str, *, file: Path, line: int, second_root: bool) -> None:
        super().__init__(sentence, file=file, line=line)
        self.second_root = second_root


@dataclass(frozen=True)
class XmlSource:
    """A file of XML, with the line of every element."""

    path: Path
    root: ET.Element
    lines: dict[ET.Element, int]

    def refused(self, element: ET.Element, sentence: str) -> EngineError:
        """An error about an element."""
        return EngineError(sentence, file=self.path, line=self.lines[element])


def read_source(path: Path, *, mend: bool = False) -> str:
    """The text of a model file.

    Args:
        path: of the file.
        mend: whether what engines read over in XML is taken out.

    Raises:
        EngineError: for what is no regular file of text, such as a pipe, which would be waited for.
    """
    try:
        if path.exists() and not path.is_file():
            raise EngineError("can't be read: it is not a regular file", file=path)
        if path.stat().st_size > LARGEST:
            raise EngineError(f"can't be read: it has more than {LARGEST:,} bytes", file=path)
        data = path.read_bytes()
        return (mended(data) if mend and not data.startswith(UTF_16) else data).decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise EngineError(f"can't be read: {error}", file=path) from None


@contextmanager
def written(root: ET.Element, path: Path) -> Iterator[Path]:
    """A file of an element, by the name of another; gone afterwards."""
    with tempfile.TemporaryDirectory(prefix="crosscheck-") as folder:
        file = Path(folder) / path.name
        file.write_text(ET.tostring(root, encoding="unicode"), encoding="utf-8")
        try:
            yield file
        except Exception as error:
            # What an engine says is about the user's file: the copy is gone when it is read.
            error.args = tuple(
                one.replace(str(file), str(path)) if isinstance(one, str) else one
                for one in error.args
            )
            raise


def read_xml(text: str, path: Path) -> XmlSource:
    """Parse XML, entity expansion off.

    Raises:
        NoXmlError, EngineError: naming file and line.
    """
    lines = _lines(text, path)
    try:
        root: ET.Element = defusedxml.ElementTree.fromstring(text, forbid_dtd=True)
    except ET.ParseError as error:  # a prefix without a namespace, which expat alone reads over
        raise NoXmlError(
            f"not XML: {error}", file=path, line=error.position[0], second_root=False
        ) from None
    return XmlSource(path, root, dict(zip(root.iter(), lines, strict=True)))


def _lines(text: str, path: Path) -> list[int]:
    """Where each element begins, in their order; no entity is expanded, since none is declared."""
    found: list[int] = []
    depth = 0
    parser = expat.ParserCreate()

    def start(_name: str, _attributes: object) -> None:
        nonlocal depth
        depth += 1
        found.append(parser.CurrentLineNumber)
        if depth > DEEPEST:
            told = f"elements are nested more than {DEEPEST} deep"
            raise EngineError(told, file=path, line=found[-1])

    def end(_name: str) -> None:
        nonlocal depth
        depth -= 1

    def declared(*_: object) -> None:
        told = "refused: it declares entities or a DTD"
        raise EngineError(told, file=path, line=parser.CurrentLineNumber)

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.StartDoctypeDeclHandler = declared
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        raise NoXmlError(
            f"not XML at column {error.offset + 1}: {reason}",
            file=path,
            line=error.lineno,
            second_root=reason == expat.errors.XML_ERROR_JUNK_AFTER_DOC_ELEMENT,
        ) from None
    return found


def finite_numbers(words: str) -> list[float] | None:
    """The numbers that an attribute lists; None where one is no number, or not a finite one.

    A comma may follow a number before a blank: PyBullet takes "1, 2, 3" as it is meant, and
    MuJoCo refuses it. Of "1,2,3" PyBullet makes 0 0 0, of "1 ,2 ,3" 1 0 0: they are no numbers.
    """
    *before, last = words.split() or [""]
    parts = [*(word.removesuffix(",") for word in before), last] if last else []
    numbers = [float(w) if _NUMBER.fullmatch(w) else math.nan for w in parts]
    return numbers if all(map(math.isfinite, numbers)) else None


def folded(error: object) -> str:
    """What an engine says, on one line."""
    return " ".join(str(error).split())


_NO_MEMORY = ("could not allocate memory", "cannot allocate memory", "out of memory", "bad_alloc")
"""What engines say where memory ran out, in lower case."""


def check_memory(error: Exception) -> None:
    """Raise MemoryError where an engine's own error means that memory ran out.

    An EngineError is about a file: those who try other numbers take it for an answer, and a
    shortage of memory is none.

    Raises:
        MemoryError: with what the engine said.
    """
    said = folded(error)
    if isinstance(error, MemoryError) or any(words in said.lower() for words in _NO_MEMORY):
        raise MemoryError(said) from error


@contextmanager
def engine_errors(path: Path | str, title: str) -> Iterator[None]:
    """Whatever an engine raises names the file."""
    try:
        yield
    except EngineError:
        raise
    except Exception as error:
        check_memory(error)
        told = f"{title} raises {type(error).__name__}: {folded(error)}"
        raise EngineError(told, file=Path(path)) from error
