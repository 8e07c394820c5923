"""Print differences between two files in a terminal."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.comparison import Compared, ComparedProperty
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.render.terminal.versions import say

MOST_SHOWN = 20
"""Maximum number of each kind; the record has all."""

SHARE = 0.99
"""Share of a discrepancy that makes a difference its cause."""

SIX_DIGITS = 5e-6
"""Maximum relative rounding of a number written with six digits."""

MINOR = 1e-5
"""Relative difference below which a property is minor: one line counts them."""


def print_properties(
    console: Console, outcome: Outcome, found: Compared, *, is_named: bool = False
) -> None:
    """Print properties that differ with an effect on motions, frames, and the others.

    Args:
        console: to print on.
        outcome: of the comparison.
        found: by it.
        is_named: whether the verdict names the first property that differs.
    """
    moving = [one for one in found.properties if one.moves]
    frames = [one for one in found.properties if one.kind == "frame"]
    idle = [one for one in found.properties if not one.moves and one.kind != "frame"]
    agrees = outcome is Outcome.AGREES
    title = "bodies and joints that differ, largest effect first"
    if agrees:
        title = "bodies and joints that differ without an effect on these runs"
    alone = is_named and outcome is Outcome.DIFFERS and len(moving) == 1 and not found.turned
    if not alone or found.impossible or not is_explained(found):
        _print_all(console, title, moving)
    if not agrees:
        _print_share(console, found)
    _print_all(console, "frames that differ", frames)
    _print_all(console, "differences without an effect on these runs", idle)


def minor_line(count: int) -> str:
    """Return the line that counts minor differences."""
    noun = "difference" if count == 1 else "differences"
    return f"  {count} minor {noun} (below 1e-5), see --json"


def is_explained(found: Compared) -> bool:
    """Return whether differences between the files are the cause."""
    moving = any(one.moves for one in found.properties)
    return moving and found.explained is not None and found.explained >= SHARE


def _print_all(console: Console, title: str, rows: Sequence[ComparedProperty]) -> None:
    if not rows:
        return
    console.print(f"\n{title}")
    lines = _folded(rows)
    for line in lines[:MOST_SHOWN]:
        say(console, f"  {line}")
    if len(lines) > MOST_SHOWN:
        console.print(f"  and {len(lines) - MOST_SHOWN} more, see --json")


def _folded(rows: Sequence[ComparedProperty]) -> list[str]:
    """Return a line per difference; equal ones of several joints and minor ones share a line."""
    minor = [one for one in rows[1:] if one.relative is not None and 0 < one.relative < MINOR]
    alike: dict[tuple[str, str], list[str]] = {}
    for one in rows:
        if one in minor:
            continue
        line = _where(one) + one.message
        head, found, tail = line.partition(f" of joint {one.about}: ") if one.about else (line,) * 3
        key = (head, tail) if found == f" of joint {one.about}: " else (line, "")
        alike.setdefault(key, []).append(line)
    lines = [
        own[0] if len(own) == 1 else f"{head} of {len(own)} joints: {tail}"
        for (head, tail), own in alike.items()
    ]
    if minor:
        lines.append(minor_line(len(minor)).strip())
    return lines


def _where(one: ComparedProperty) -> str:
    """Return the line in A, and the one in B if it differs."""
    told = [line_name(where) for where in (one.where_a, one.where_b) if where is not None]
    shown = ", ".join(dict.fromkeys(told))
    return f"{shown}  " if shown else ""


def line_name(where: SourceLine) -> str:
    """Return a file's name and line, without folders."""
    return Path(str(where)).name


def _print_share(console: Console, found: Compared) -> None:
    """Print the share of the discrepancy that the files' own equations give."""
    if found.explained is None or found.off is None:
        return
    if is_explained(found):
        return  # the verdict has the share
    a, b = (float("inf") if one is None else one for one in found.off)
    also = " too" if found.properties or found.differences else ""
    say(
        console,
        f"  the engines differ{also}. Distance from the equations of the file:"
        f" {a:.1e} in A, {b:.1e} in B",
    )
    for one in found.impossible:
        say(console, f"  {one}")
