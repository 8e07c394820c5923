"""The terminal that commands print to, and text that fits its width."""

from __future__ import annotations

import os
import sys
import textwrap

from rich.console import Console
from rich.text import Text

from physics_crosscheck.harness.text.visible import visible_lines

LOG_COLUMNS = 100
"""Columns of a log or a pipe, which have no width of their own."""

MIN_COLUMNS = 40
"""A narrower terminal gets lines of this width."""


def terminal() -> Console:
    """Return a console on standard output, in which only outcomes have colours."""
    known = sys.stdout.isatty() or os.environ.get("COLUMNS", "").isdigit()
    return Console(
        soft_wrap=False, highlight=False, emoji=False, width=None if known else LOG_COLUMNS
    )


def print_wrapped(
    console: Console, text: str, *, lead: str = "", style: str = "", indent: int = 0
) -> None:
    """Print a text in lines of the console's width; a word longer than that stays whole.

    Args:
        console: to print on.
        text: without markup; each of its lines begins a new line.
        lead: in front of the first line.
        style: of the lead.
        indent: columns in front of every other line.
    """
    width = max(console.width, MIN_COLUMNS)
    for number, line in enumerate(visible_lines(text) or [""]):
        before = lead if number == 0 else " " * indent
        wrapped = textwrap.wrap(
            line,
            width,
            initial_indent=" " * len(before),
            subsequent_indent=" " * indent,
            break_long_words=False,
            break_on_hyphens=False,
        )
        for row, part in enumerate(wrapped or [""]):
            shown = Text(before, style) + Text(part[len(before) :]) if row == 0 else Text(part)
            console.print(shown, soft_wrap=True)
