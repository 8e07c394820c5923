"""The terminal of commands, and text that fits its width."""

from __future__ import annotations

import os
import sys
import textwrap
from collections.abc import Iterable, Mapping, Sequence

from rich.console import Console
from rich.markup import escape as _escape
from rich.text import Text

from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.results.visible import visible, visible_lines

STYLES: Mapping[str, str] = {
    Outcome.AGREES: "green", Outcome.ABSENT: "dim", Outcome.REFUSED: "bold magenta",
    Outcome.UNRESOLVED: "magenta", Outcome.DIFFERS: "bold red", Outcome.FAILED: "bold red reverse",
}  # fmt: skip
"""Colours that are readable on a light and on a dark background: not yellow, cyan or white."""

WORDS: Mapping[str, str] = {
    Outcome.AGREES: "ok", Outcome.ABSENT: "skipped", Outcome.REFUSED: "REFUSED",
    Outcome.UNRESOLVED: "UNRESOLVED", Outcome.DIFFERS: "FAIL", Outcome.FAILED: "ERROR",
}  # fmt: skip
"""The status words of the terminal; JSON keeps the names of the outcomes."""


LOG_COLUMNS = 100
"""Width of a log or a pipe, which have none of their own."""

MIN_COLUMNS = 40
"""Minimum width of lines, also in a narrower terminal."""

_WORD_STYLES = {word: STYLES[outcome] for outcome, word in WORDS.items()}


def terminal() -> Console:
    """Return a console on standard output with colours for outcomes only."""
    has_width = sys.stdout.isatty() or os.environ.get("COLUMNS", "").isdigit()
    return Console(
        soft_wrap=False, highlight=False, emoji=False, width=None if has_width else LOG_COLUMNS
    )


def print_status_lines(console: Console, lines: Iterable[str]) -> None:
    """Print lines unchanged, except that a leading status word is coloured."""
    for line in lines:
        text = Text(visible(line))
        word, _, _ = line.strip().partition(" ")
        if style := _WORD_STYLES.get(word.rstrip(":")):
            begin = line.index(word)
            text.stylize(style, begin, begin + len(word))
        console.print(text, soft_wrap=True)


def print_hint(console: Console, hint: str) -> None:
    """Print in faint style how to look a code up, if there is one."""
    if hint:
        console.print(hint, style="dim", soft_wrap=True)


def print_wrapped(
    console: Console, text: str, *, lead: str = "", style: str = "", indent: int = 0
) -> None:
    """Print a text in lines of the console's width; longer words stay whole.

    Args:
        console: to print on.
        text: text without markup; its line breaks are kept.
        lead: text before the first line.
        style: style of the lead.
        indent: indentation of the other lines.
    """
    width = max(console.width, MIN_COLUMNS)
    for number, line in enumerate(visible_lines(text) or [""]):
        before = lead if number == 0 else " " * indent
        parts = _wrap(line, width, " " * len(before), " " * indent)
        for row, part in enumerate(parts or [""]):
            shown = Text(before + part[len(before) :] if row == 0 else part)
            if row == number == 0:
                shown.stylize(style, 0, len(before))
            console.print(shown, soft_wrap=True)


def print_text(console: Console, text: str, style: str = "") -> None:
    """Print a text wrapped at the console's width, without splitting words."""
    for line in wrapped(text, console.width):
        console.print(f"[{style}]{escape(line)}[/]" if style else escape(line), soft_wrap=True)


def wrapped(text: str, width: int) -> list[str]:
    """Return the lines of a text of at most `width` columns, unless a word is wider.

    Continuation lines are indented by two more columns.

    Args:
        text: one line; its indentation is kept.
        width: columns.
    """
    begin = " " * (len(text) - len(text.lstrip()))
    return _wrap(text.strip(), width, begin, f"{begin}  ") or [""]


def _wrap(text: str, width: int, first: str, rest: str) -> list[str]:
    """Return lines that begin with `first` and `rest`, without splitting words or values."""
    lines = textwrap.wrap(
        text.replace(" %", "\u00a0%").replace(" = ", "\u00a0=\u00a0"),
        width,
        initial_indent=first,
        subsequent_indent=rest,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [line.replace("\u00a0", " ") for line in lines]


def _with_values(words: Sequence[str]) -> list[str]:
    """Return the words of a command, each option joined with its first value."""
    joined: list[str] = []
    for before, word in zip(("", *words), words, strict=False):
        if before.startswith("--") and not word.startswith("-"):
            joined[-1] += f" {word}"
        else:
            joined.append(word)
    return joined


def wrapped_command(words: Sequence[str], width: int) -> list[str]:
    """Split a shell command into lines, each but the last ending in a backslash.

    Args:
        words: words of the command, already quoted.
        width: maximum number of columns.
    """
    lines = [f"  {words[0]}"]
    for word in _with_values(words[1:]):
        if len(lines[-1]) + len(word) + 3 > width and lines[-1].strip():
            lines[-1] += " \\"
            lines.append(f"    {word}")
        else:
            lines[-1] += f" {word}"
    return lines


def escape(text: str) -> str:
    """Escape markup and control characters of a text, keeping its line breaks."""
    return _escape("\n".join(visible_lines(text)))
