"""Errors about files, and the quotation of file content in messages."""

from __future__ import annotations

import os
from pathlib import Path

MAX_SHOWN_CHARACTERS = 100
"""The most characters that are shown."""


def quote(value: object) -> str:
    """Return a value from a file, quoted and truncated for a sentence."""
    return truncate(repr(value))


def truncate(text: str) -> str:
    """Truncate a text for a sentence."""
    return text if len(text) <= MAX_SHOWN_CHARACTERS else f"{text[:MAX_SHOWN_CHARACTERS]}..."


def original_paths(text: str, copies: Path, folder: Path) -> str:
    """Replace paths of copies in a message by those of the original files.

    Args:
        text: a message.
        copies: the temporary folder of the copies.
        folder: the user's folder, as messages name it.
    """
    for place in dict.fromkeys((str(copies), os.path.realpath(copies))):
        text = text.replace(f"{place}{os.sep}", "" if folder == Path() else f"{folder}{os.sep}")
    return text


class FileError(Exception):
    """A problem with a file; as text, `FILE:LINE: sentence`.

    Attributes:
        sentence: the problem; it names the file itself without `file`.
        file: the file, or None if the sentence names it.
        line: of the file, counted from 1, or None.
        kind: the kind of failure that a case reports (`harness.records.case.FailureKind`).
    """

    kind = "file"

    def __init__(self, sentence: str, *, file: Path | None = None, line: int | None = None) -> None:
        place = "" if file is None else f"{file}: " if line is None else f"{file}:{line}: "
        super().__init__(f"{place}{sentence}")
        self.sentence, self.file, self.line = sentence, file, line


class LocationError(FileError, ValueError):
    """An address that matches no number or several; the message names file, line and remedy."""

    remedy = "write well-formed XML"


class RefusedFileError(LocationError):
    """A file that is refused, though an engine might read it: a DTD, or too many elements."""

    remedy = "remove that"


class TruncatedFileError(LocationError):
    """A file that ends inside an element."""

    remedy = "restore the missing end of the file"
