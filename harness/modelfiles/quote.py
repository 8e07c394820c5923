"""Quotation of file content in messages."""

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
