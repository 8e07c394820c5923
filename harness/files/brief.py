"""What stands in a file, as messages show it."""

from __future__ import annotations

MOST_SHOWN = 100
"""Characters of it."""


def brief(value: object) -> str:
    """A value that was read, quoted, and cut where it is too long for a sentence."""
    return cut(repr(value))


def cut(text: str) -> str:
    """A text as far as a sentence shows it."""
    return text if len(text) <= MOST_SHOWN else f"{text[:MOST_SHOWN]}..."
