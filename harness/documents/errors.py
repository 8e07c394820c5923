"""Errors about files, and the quotation of file content in messages."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

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


RESTORE = "restore the missing end of the file"
"""The remedy for a file that ends inside an element."""


class LocationError(FileError, ValueError):
    """An address that matches no number or several; the message names file, line and remedy."""

    remedy = "write well-formed XML"

    def with_remedy(self, remedy: str) -> LocationError:
        """Return it with another remedy."""
        self.remedy = remedy
        return self


class RefusedFileError(LocationError):
    """A file that is refused, though an engine might read it: a DTD, or too many elements."""

    remedy = "remove that"


ReadKind = Literal[
    "robot",
    "file",
    "unsupported",
    "massless",
    "no joint",
    "negative mass",
    "moments",
    "triangle",
    "not finite",
]


@dataclass(frozen=True, kw_only=True)
class ReadError:
    """A problem that prevents building a tree from a file.

    Attributes:
        sentence: the problem.
        file: that contains it.
        line: of the file, counted from 1; 0 without a line.
        remedy: the correction.
        kind: `robot` for a structure that is not a tree, `file` for an unreadable file,
            `unsupported`, `massless` for joints that move no inertia, `no joint` where none moves,
            or the rule that the inertia of a link breaks.
        link: name of the link whose inertia no body can have.
        rounded: whether the rounding of its written digits explains that.
    """

    sentence: str
    file: Path
    line: int
    remedy: str
    kind: ReadKind = "robot"
    link: str = ""
    rounded: bool = False

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}" if self.line else f"{self.file}"
        return f"{place}: {self.sentence}; {self.remedy}"

    @staticmethod
    def unreadable(error: LocationError, path: Path) -> ReadError:
        """Return the problem of a file that is not XML."""
        line = error.line or 0
        is_named = line or error.remedy != LocationError.remedy
        remedy = error.remedy if is_named else "give another"
        return ReadError(sentence=error.sentence, file=path, line=line, remedy=remedy, kind="file")
