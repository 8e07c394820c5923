"""Print differences between two files in a terminal."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.comparison import (
    Compared,
    ComparedProperty,
    ComparisonResult,
)
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.render.terminal.console import print_text
from physics_crosscheck.harness.results.status import counted, listed

MAX_ROWS = 20
"""Maximum number of each kind; the record has all."""

MAX_NAMES = 3
"""Largest number of equal differences that a line names."""

SHARE = 0.99
"""Share of a discrepancy that makes a difference its cause."""

SIX_DIGITS = 5e-6
"""Maximum relative rounding of a number written with six digits."""

MINOR = 1e-5
"""Relative difference, or effect, below which a difference is minor: one line counts them."""


def print_properties(
    console: Console, comparison: ComparisonResult, compared: Compared, *, is_named: bool = False
) -> None:
    """Print properties that differ with an effect on motions, frames, and the others.

    Args:
        console: to print on.
        comparison: to report.
        compared: by it.
        is_named: whether the verdict names the first property that differs.
    """
    outcome = comparison.outcome
    moving = [one for one in compared.properties if one.moves]
    rest = [one for one in compared.properties if not one.moves and one != compared.decisive]
    frames = [one for one in rest if one.kind == "frame"]
    without_effect = [one for one in rest if one.kind != "frame"]
    agrees = outcome is Outcome.AGREES
    title = "bodies and joints that differ, largest effect first"
    if agrees:
        title = "bodies and joints that differ without an effect on these runs"
    is_single = is_named and outcome is Outcome.DIFFERS and len(moving) == 1 and not compared.turned
    if not is_single or compared.impossible or not is_explained(compared):
        _print_all(console, title, moving)
    if not agrees:
        _print_share(console, comparison, compared)
    _print_all(console, "frames that differ", frames)
    _print_all(console, "differences that these motions leave out", without_effect)


def law_lines(rows: Sequence[ComparedProperty]) -> list[str]:
    """Return a line per number of the laws that differs, with its effect; equal ones share one."""
    alike: dict[tuple[str, str], list[ComparedProperty]] = {}
    for row in rows:
        head, _, tail = row.message.partition(f" of {row.about}: ")
        if not tail:  # only one file has it
            head, tail = "", row.message.removeprefix(f"{row.about}: ")
        alike.setdefault((head, f"{tail}; {law_effect(row)}"), []).append(row)
    lines = []
    for (head, tail), equal in alike.items():
        names = listed([row.about for row in equal], MAX_NAMES)
        lines.append(f"{_where(equal[0])}{head and f'{head} of '}{names}: {tail}")
    return lines


def law_effect(row: ComparedProperty) -> str:
    """Return what a number of the laws does to a step."""
    if row.effect is None:
        return "effect unknown"
    return f"changes a step by {row.effect:.1e}" if row.effect else "no effect at any drawn state"


def minor_line(count: int) -> str:
    """Return the line that counts minor differences."""
    return f"  {counted(count, 'minor difference')} (below 1e-5), see --json"


def is_explained(compared: Compared) -> bool:
    """Return whether differences between the files are the cause."""
    moving = any(one.moves for one in compared.properties)
    return moving and compared.explained is not None and compared.explained >= SHARE


def _print_all(console: Console, title: str, rows: Sequence[ComparedProperty]) -> None:
    if not rows:
        return
    console.print(f"\n{title}")
    lines = _folded(rows)
    for line in lines[:MAX_ROWS]:
        print_text(console, f"  {line}")
    if len(lines) > MAX_ROWS:
        console.print(f"  and {len(lines) - MAX_ROWS} more, see --json")


def _folded(rows: Sequence[ComparedProperty]) -> list[str]:
    """Return a line per difference; equal ones of several joints and minor ones share a line."""
    minor = [row for row in rows[1:] if row.relative is not None and 0 < row.relative < MINOR]
    alike: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        if row in minor:
            continue
        about = f" of joint {row.about}: "
        head, middle, tail = row.message.partition(about)
        key = (head, tail) if row.about and middle else (row.message, "")
        alike.setdefault(key, []).append(_where(row) + row.message)
    lines = [
        own[0] if len(own) == 1 else f"{head} of {len(own)} joints: {tail}"
        for (head, tail), own in alike.items()
    ]
    if minor:
        lines.append(minor_line(len(minor)).strip())
    return lines


def _where(row: ComparedProperty) -> str:
    """Return the line in A, and the one in B if it differs."""
    lines = [line_name(where) for where in (row.where_a, row.where_b) if where is not None]
    shown = ", ".join(dict.fromkeys(lines))
    return f"{shown}  " if shown else ""


def line_name(where: SourceLine) -> str:
    """Return a file's name and line, without folders."""
    return Path(str(where)).name


def _print_share(console: Console, comparison: ComparisonResult, compared: Compared) -> None:
    """Print how far the engines are from the equations of both files, if these do not explain it.

    The statements about each engine and its own file replace the distances.
    """
    if compared.explained is None or compared.off is None or is_explained(compared):
        return  # unknown, or the verdict has the share
    if any(model.case is None for model in comparison.models):
        a, b = (float("inf") if distance is None else distance for distance in compared.off)
        also = " too" if compared.properties or compared.differences else ""
        print_text(
            console,
            f"  the engines differ{also}. Distance from the equations of the file:"
            f" {a:.1e} in A, {b:.1e} in B",
        )
    for inertia in compared.impossible:
        print_text(console, f"  {inertia}")
