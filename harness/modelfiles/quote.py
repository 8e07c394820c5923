"""What stands in a file, as messages show it."""

from __future__ import annotations

import os
from pathlib import Path

MOST_SHOWN = 100
"""Characters of it."""


def brief(value: object) -> str:
    """A value that was read, quoted, and cut where it is too long for a sentence."""
    return cut(repr(value))


def cut(text: str) -> str:
    """A text as far as a sentence shows it."""
    return text if len(text) <= MOST_SHOWN else f"{text[:MOST_SHOWN]}..."


def original_paths(text: str, copies: Path, folder: Path) -> str:
    """Return a message about copies of files as one about the files themselves.

    Args:
        text: a message.
        copies: the temporary folder that they are in.
        folder: the user's, as messages name it.
    """
    for place in dict.fromkeys((str(copies), os.path.realpath(copies))):
        text = text.replace(f"{place}{os.sep}", "" if folder == Path() else f"{folder}{os.sep}")
    return text
