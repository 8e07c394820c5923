"""What two files say differently, for the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.comparison import Compared, ComparedProperty
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.text.markup import escape

MOST_SHOWN = 20
"""Of each kind; the record has all."""

SHARE = 0.99
"""Of a discrepancy: what explains so much is the cause."""

SIX_DIGITS = 5e-6
"""By so much, relative, a number moves at most where it is written with six digits."""

LEAST_ROUNDED = 4
"""So many differences of that size are one line: fewer may be meant."""


def print_properties(console: Console, outcome: Outcome, found: Compared) -> None:
    """Print bodies and joints that differ, frames, and what no motion here depends on."""
    moving = [one for one in found.properties if one.moves]
    frames = [one for one in found.properties if one.kind == "frame"]
    idle = [one for one in found.properties if not one.moves and one.kind != "frame"]
    agrees = outcome is Outcome.AGREES
    title = "bodies and joints that differ, the weightiest first"
    if agrees:
        title = "bodies and joints that differ in what no motion here depends on"
    _print_all(console, title, moving)
    if not agrees:
        _print_share(console, found)
    _print_all(console, "frames that differ", frames)
    _print_all(console, "what else differs and moves nothing here", idle)


def rounding_line(count: int) -> str:
    """Return what is printed of differences that are rounding."""
    return (
        f"{count} numbers differ by less than 5e-6 of themselves, which is rounding to six digits;"
        " see --json"
    )


def is_explained(found: Compared) -> bool:
    """Whether what the files say is the cause."""
    moving = any(one.moves for one in found.properties)
    return moving and found.explained is not None and found.explained >= SHARE


def _print_all(console: Console, title: str, rows: Sequence[ComparedProperty]) -> None:
    if not rows:
        return
    console.print(f"\n{title}")
    lines = _folded(rows)
    for line in lines[:MOST_SHOWN]:
        console.print(f"  {escape(line)}", soft_wrap=True)
    if len(lines) > MOST_SHOWN:
        console.print(f"  and {len(lines) - MOST_SHOWN} more, see --json")


def _folded(rows: Sequence[ComparedProperty]) -> list[str]:
    """Return a line for each, for joints that are alike together, and one for all rounding."""
    rounded = [one for one in rows if one.relative is not None and one.relative <= SIX_DIGITS]
    if len(rounded) < LEAST_ROUNDED:
        rounded = []
    alike: dict[tuple[str, str], list[str]] = {}
    for one in rows:
        if one in rounded:
            continue
        line = _where(one) + one.message
        head, found, tail = line.partition(f" of joint {one.about}: ") if one.about else (line,) * 3
        key = (head, tail) if found == f" of joint {one.about}: " else (line, "")
        alike.setdefault(key, []).append(line)
    lines = [
        own[0] if len(own) == 1 else f"{head} of {len(own)} joints: {tail}"
        for (head, tail), own in alike.items()
    ]
    if rounded:
        lines.append(rounding_line(len(rounded)))
    return lines


def _where(one: ComparedProperty) -> str:
    """The line in A, and that in B where it is another."""
    told = [_line(where) for where in (one.where_a, one.where_b) if where is not None]
    shown = ", ".join(dict.fromkeys(told))
    return f"{shown}  " if shown else ""


def _line(where: SourceLine) -> str:
    return Path(str(where)).name


def _print_share(console: Console, found: Compared) -> None:
    """How much of the discrepancy the files' own equations make."""
    if found.explained is None or found.off is None:
        return
    if is_explained(found):
        console.print("  these explain the motions: the equations of both files differ as they do")
        return
    a, b = (float("inf") if one is None else one for one in found.off)
    console.print(
        f"  beside the files the engines differ: A moves {a:.1e} off the equations of its file,"
        f" B {b:.1e}",
        soft_wrap=True,
    )
    for one in found.impossible:
        console.print(f"  {escape(one)}", soft_wrap=True)
