"""Where commands print what a person reads."""

from __future__ import annotations

import sys

from rich.console import Console

ELSEWHERE = 160
"""Columns of a log or a pipe, which have no width of their own."""


def terminal() -> Console:
    """A console on standard output, in which colours mean outcomes alone."""
    width = None if sys.stdout.isatty() else ELSEWHERE
    return Console(soft_wrap=False, highlight=False, emoji=False, width=width)
