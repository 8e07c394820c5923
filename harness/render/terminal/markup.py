"""Text that is put into markup for a terminal."""

from __future__ import annotations

from rich.markup import escape as _escape

from physics_crosscheck.harness.results.visible import visible_lines


def escape(text: str) -> str:
    """A text that shows as it is: no markup, no control characters; its lines stay lines."""
    return _escape("\n".join(visible_lines(text)))
