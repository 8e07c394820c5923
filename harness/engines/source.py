"""Model files before an engine reads them: files that would hang or crash it are refused, by
line.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from xml.parsers import expat

from physics_crosscheck.harness.documents.elements import (
    UTF_16,
    XmlElement,
    read_elements,
    repaired_xml,
)
from physics_crosscheck.harness.documents.errors import LocationError, RefusedFileError
from physics_crosscheck.harness.documents.location import DECIMAL, SourceFile
from physics_crosscheck.harness.engines.protocol import EngineError

MAX_FILE_BYTES = 64_000_000
"""The largest size of a model file, bytes."""


class NoXmlError(EngineError):
    """A file that is not XML; `second_root` is true if only content after its root is wrong."""

    def __init__(self, sentence: str, *, file: Path, line: int, second_root: bool) -> None:
        super().__init__(sentence, file=file, line=line)
        self.second_root = second_root


@dataclass(frozen=True)
class XmlSource:
    """An XML file."""

    path: Path
    root: XmlElement

    def refused(self, element: XmlElement, sentence: str) -> EngineError:
        """Return an error about an element."""
        file, line = element.place
        return EngineError(sentence, file=file, line=line)

    def named(self, elements: Iterable[XmlElement], kind: str) -> dict[str, XmlElement]:
        """Return elements by name; names must exist and be unique.

        Args:
            elements: some elements of the file.
            kind: of elements that may not share a name, for messages.

        Raises:
            EngineError: naming file and line.
        """
        by_name: dict[str, XmlElement] = {}
        for element in elements:
            name = element.get("name")
            if not name:
                raise self.refused(element, f"a <{element.tag}> has no name")
            if name in by_name:
                raise self.refused(element, f"a second {kind} is called {name!r}")
            by_name[name] = element
        return by_name


def read_source(path: Path, *, tolerant: bool = False) -> str:
    """Return the text of a model file.

    Args:
        path: of the file.
        tolerant: whether XML errors that engines ignore are removed.

    Raises:
        EngineError: for anything but a regular text file, such as a pipe, which would block.
    """
    try:
        if path.exists() and not path.is_file():
            raise EngineError("can't be read: it is not a regular file", file=path)
        if path.stat().st_size > MAX_FILE_BYTES:
            raise EngineError(
                f"can't be read: it has more than {MAX_FILE_BYTES:,} bytes", file=path
            )
        data = path.read_bytes()
        return (repaired_xml(data) if tolerant and not data.startswith(UTF_16) else data).decode(
            "utf-8"
        )
    except (OSError, UnicodeDecodeError) as error:
        raise EngineError(f"can't be read: {error}", file=path) from None


@contextmanager
def temporary_file(root: XmlElement, path: Path) -> Iterator[Path]:
    """Yield a temporary file of an element, with the name of another file."""
    with tempfile.TemporaryDirectory(prefix="crosscheck-") as folder:
        file = Path(folder) / path.name
        file.write_bytes(root.written())
        try:
            yield file
        except Exception as error:
            # The engine's message names the copy, which is removed; name the user's file instead.
            error.args = tuple(
                one.replace(str(file), str(path)) if isinstance(one, str) else one
                for one in error.args
            )
            raise


def read_xml(text: str, path: Path) -> XmlSource:
    """Parse XML, with entity expansion off.

    Raises:
        NoXmlError, EngineError: naming file and line.
    """
    try:
        return XmlSource(path, read_elements(SourceFile(path, text.encode()))[0])
    except RefusedFileError as error:
        raise EngineError(error.sentence, file=path, line=error.line) from None
    except LocationError as error:
        second_root = error.sentence.endswith(expat.errors.XML_ERROR_JUNK_AFTER_DOC_ELEMENT)
        raise NoXmlError(
            error.sentence, file=path, line=error.line or 1, second_root=second_root
        ) from None


def finite_numbers(words: str) -> list[float] | None:
    """Return the numbers that an attribute lists, or None if one is not a finite number.

    A comma may follow a number before a blank: PyBullet reads "1, 2, 3" as expected, and MuJoCo
    refuses it. PyBullet reads "1,2,3" as 0 0 0 and "1 ,2 ,3" as 1 0 0, so these are not numbers.
    """
    *before, last = words.split() or [""]
    parts = [*(word.removesuffix(",") for word in before), last] if last else []
    numbers = [float(w) if DECIMAL.fullmatch(w) else math.nan for w in parts]
    return numbers if all(map(math.isfinite, numbers)) else None


def one_line(error: object) -> str:
    """Return an engine's message on one line."""
    return " ".join(str(error).split())


_NO_MEMORY = ("could not allocate memory", "cannot allocate memory", "out of memory", "bad_alloc")
"""Messages of engines after a failed allocation, in lower case."""


def check_memory(error: Exception) -> None:
    """Raise MemoryError if an engine's own error reports that memory ran out.

    An EngineError is about a file, and callers that vary numbers treat it as an answer. A lack of
    memory is not an answer.

    Raises:
        MemoryError: with the engine's message.
    """
    message = one_line(error)
    if isinstance(error, MemoryError) or any(words in message.lower() for words in _NO_MEMORY):
        raise MemoryError(message) from error


@contextmanager
def engine_errors(path: Path | str, title: str) -> Iterator[None]:
    """Convert any exception of an engine into an error that names the file."""
    try:
        yield
    except EngineError:
        raise
    except Exception as error:
        check_memory(error)
        problem = f"{title} raises {type(error).__name__}: {one_line(error)}"
        raise EngineError(problem, file=Path(path)) from error
