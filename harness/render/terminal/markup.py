"""Escape text for terminal markup."""

from __future__ import annotations

from rich.markup import escape as _escape

from physics_crosscheck.harness.results.visible import visible_lines


def escape(text: str) -> str:
    """Escape markup and control characters of a text, keeping its line breaks."""
    return _escape("\n".join(visible_lines(text)))
