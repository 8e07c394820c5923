"""A comparison of two models, for the terminal."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.table import Table

from physics_crosscheck.harness.records.comparison import (
    Compared,
    Comparison,
    FileDifference,
    FileEdit,
)
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.text.compared_properties import (
    LEAST_ROUNDED,
    SIX_DIGITS,
    is_explained,
    print_properties,
    rounding_line,
)
from physics_crosscheck.harness.text.markup import escape
from physics_crosscheck.harness.text.status import counted
from physics_crosscheck.harness.text.styles import STYLES

MOST_TOLD = 20
MOST_TERMS = 8
NOT_COMPARED = "not compared"

SHOWN = 3
"""So many of the differences that no run shows are named at the top."""

MOST_EXPLAINED = 0.5
"""Share of a discrepancy above which a difference is its cause."""

FEW = 6
"""So many differences that move nothing are told beside those that do."""


def print_comparison(console: Console, comparison: Comparison) -> None:
    """Print both models, the outcome, the terms that differ, and the lines that do."""
    if comparison.found is None:
        _print_failure(console, comparison)
        return
    _print_models(console, comparison, comparison.found)
    _print_outcome(console, comparison, comparison.found)
    print_properties(console, comparison.outcome, comparison.found)
    _print_terms(console, comparison.outcome, comparison.found)
    _print_differences(console, comparison.outcome, comparison.found)


def _say(console: Console, text: str, style: str = "") -> None:
    console.print(f"[{style}]{escape(text)}[/]" if style else escape(text), soft_wrap=True)


def _print_failure(console: Console, comparison: Comparison) -> None:
    failed = f"[{STYLES[Outcome.FAILED]}]{Outcome.FAILED}[/]"
    console.print(f"{failed}  {escape(comparison.reason)}", soft_wrap=True)
    for line in comparison.stdout.splitlines()[-6:]:
        _say(console, f"  | {line}")


def _print_models(console: Console, comparison: Comparison, found: Compared) -> None:
    for line in _not_compared(found):
        _say(console, line, "yellow")
    for label, model in zip("AB", comparison.models, strict=True):
        pull = ", ".join(f"{g:g}" for g in model.gravity or ())
        said = f", gravity ({pull})" if pull else ""
        _say(console, f"{label}  {model.model} in {model.engine}{said}")
    for note in (*found.notes, *found.map):
        if not note.startswith(NOT_COMPARED):
            _say(console, f"   {note}", "dim")
    if found.left_out:
        names = ", ".join(found.left_out)
        _say(console, f"   left out of {found.states_of}: {names}, which follow or stay put", "dim")
    _say(
        console,
        f"   {counted(found.runs.count, 'run')} of {found.runs.length:.3g} s from states of"
        f" {found.states_of}, {found.runs.driven} of them under known forces",
    )
    console.print()


def _not_compared(found: Compared) -> list[str]:
    """Return a line for what is left out, and one for what differs and no run shows."""
    lines = [note for note in found.notes if note.startswith(NOT_COMPARED)]
    silent = [one for one in found.untested if not one.startswith(NOT_COMPARED)]
    if silent:
        more = f"; and {len(silent) - SHOWN} more" if len(silent) > SHOWN else ""
        shown = "; ".join(silent[:SHOWN])
        lines.append(f"{NOT_COMPARED}: the files differ where no run shows it: {shown}{more}")
    return lines


def _print_outcome(console: Console, comparison: Comparison, found: Compared) -> None:
    # Where they agree, last digits choose the component.
    agrees = comparison.outcome is Outcome.AGREES
    console.print(
        f"[{STYLES[comparison.outcome]}]{comparison.outcome}[/]  discrepancy"
        f" {_size(found.discrepancy)}, uncertainty {_size(found.uncertainty)}"
        f"{'' if agrees else f', on {escape(found.component)}'}"
    )
    if comparison.reason:
        _say(console, f"  {comparison.reason}")
    if comparison.outcome is not Outcome.AGREES and len(found.joints) > 1:
        _say(console, f"  by joint: {_by_joint(found)}")
    if found.turned:
        turn = "turns" if len(found.turned) == 1 else "turn"
        axis = "it so with --joints, or turn its axis"
        axes = "them so with --joints, or turn their axes"
        _say(
            console,
            f"  {', '.join(found.turned)} {turn} the other way in B; map"
            f" {axis if len(found.turned) == 1 else axes} (that leaves"
            f" {_size(found.left_when_turned)})",
        )


def _size(value: float | None) -> str:
    return f"{float('inf') if value is None else value:.1e}"


def _by_joint(found: Compared) -> str:
    sizes = [float("inf") if size is None else size for size in found.by_component]
    n = len(found.joints)
    worst = {name: max(sizes[i], sizes[n + i]) for i, name in enumerate(found.joints)}
    order = sorted(worst, key=lambda name: -_rounded(worst[name]))
    apart = [name for name in order if worst[name] > 0]
    return ", ".join(f"{name} {worst[name]:.1e}" for name in apart[:MOST_TOLD])


def _rounded(size: float) -> float:
    """Return six digits: what is alike keeps its order, whatever the last digits are."""
    return float(f"{size:.5e}")


def _print_terms(console: Console, outcome: Outcome, found: Compared) -> None:
    if found.terms:
        console.print("\nterms of the equations that differ, the weightiest first")
        for term in found.terms[:MOST_TERMS]:
            _say(console, f"  {term.message}")
        if len(found.terms) > MOST_TERMS:
            console.print(f"  and {len(found.terms) - MOST_TERMS} more, see --json")
    elif outcome is Outcome.DIFFERS and not found.turned and not is_explained(found):
        console.print("\nno single term differs by more than it can be measured to")


def _print_differences(console: Console, outcome: Outcome, found: Compared) -> None:
    if not found.differences:
        return
    agrees = outcome is Outcome.AGREES
    console.print("\nwhere the files differ, A -> B")
    table = Table(box=None, show_header=False, pad_edge=False, padding=(0, 2, 0, 0))
    for _ in range(3):
        table.add_column(overflow="fold")
    shown = [one for one in found.differences if not agrees or len(one.edits) == 1]
    still = [one for one in shown if one.moved == 0.0 and not one.not_tried]
    if not agrees and len(still) > FEW:
        shown = [one for one in shown if one not in still]
    rounded = [one for one in shown if _is_rounding(one)]
    if len(rounded) >= LEAST_ROUNDED:
        shown = [one for one in shown if one not in rounded]
    for one in shown[:MOST_TOLD]:
        table.add_row(*(escape(cell) for cell in _cells(one, agrees)))
    console.print(table)
    if len(rounded) >= LEAST_ROUNDED:
        console.print(rounding_line(len(rounded)), soft_wrap=True)
    if len(shown) > MOST_TOLD:
        console.print(f"and {len(shown) - MOST_TOLD} more, see --json")
    if not agrees and len(still) > FEW:
        console.print(f"{len(still)} more on which no motion here depends, see --json")
    if found.untried:
        told = counted(found.untried, "more difference")
        console.print(f"not tried alone: {told} of the files")


def _is_rounding(one: FileDifference) -> bool:
    """Return whether a number differs by rounding to six digits, and is not the cause."""
    if len(one.edits) != 1 or (one.explained or 0.0) > MOST_EXPLAINED:
        return False
    try:
        a, b = float(one.edits[0].a), float(one.edits[0].b)
    except ValueError:
        return False
    return abs(a - b) <= SIX_DIGITS * max(abs(a), abs(b))


def _cells(one: FileDifference, agrees: bool) -> tuple[str, str, str]:
    if len(one.edits) > 1:
        return "", f"all {len(one.edits)} together", _effect(one, agrees)
    (edit,) = one.edits
    return _lines(edit), f"{edit.what}: {edit.a} -> {edit.b}", _effect(one, agrees)


def _lines(edit: FileEdit) -> str:
    """The line in A; that in B where it has another number; B's where A has no such line."""
    if edit.where_a is None or edit.where_b is None:
        return ""
    a, b = (Path(str(where)).name for where in (edit.where_a, edit.where_b))
    if edit.a == "nothing" and edit.where_a.line is None:
        return b
    return a if a == b or edit.where_a.line == edit.where_b.line else f"{a}, {b}"


def _effect(one: FileDifference, agrees: bool) -> str:
    if one.not_tried:
        return f"not tried: {one.not_tried}"
    if one.moved == 0.0:
        return "no motion here depends on it"
    if agrees:
        return f"moves the motions by {_size(one.moved)}, which others undo"
    if one.explained == 1.0:
        return "explains all of it"
    return f"explains {_share(one.explained or 0.0)} of it, moves by {_size(one.moved)}"


def _share(explained: float) -> str:
    if explained <= 0.0005:
        return "nothing"
    return f"{100 * min(explained, 0.99999):.3g} %"
