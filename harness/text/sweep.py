"""A sweep, for the terminal: outcomes, digits, worst cases, each with its command."""

from __future__ import annotations

from collections.abc import Iterator

from rich.console import Console
from rich.table import Table

from physics_crosscheck.harness.records.base import Number
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.sweep import SweepRow, SweepSummary
from physics_crosscheck.harness.text.markup import escape
from physics_crosscheck.harness.text.status import counted
from physics_crosscheck.harness.text.styles import STYLES
from physics_crosscheck.harness.text.visible import visible

MOST = 12
"""Cases that are told one by one."""


def print_sweep(console: Console, found: SweepSummary) -> None:
    """Print what the rows say together."""
    table = Table(box=None, pad_edge=False, header_style="dim")
    for title in ("system", "engine", "integrator", "cases", "outcomes", "digits", "largest error"):
        table.add_column(title)
    for one in found.groups:
        table.add_row(
            escape(one.system),
            escape(one.engine),
            escape(one.integrator),
            str(sum(one.outcomes.values())),
            _coloured(one.outcomes),
            "–" if one.least_digits is None else f"{one.least_digits:.1f} at least",
            _sci(one.worst_error),
        )
    console.print(table)
    for row in found.worst[:MOST]:
        for line in row_lines(row):
            _say(console, line)
    for line in summary_lines(found):
        _say(console, line)


def summary_lines(found: SweepSummary) -> Iterator[str]:
    """How many cases there are, what became of them, and what they cost."""
    counts = ", ".join(f"{count} {name}" for name, count in found.outcomes.items())
    left = found.plan.cases - found.done
    more = f"; {left} are not run yet" if left else ""
    yield f"{counted(found.done, 'case')}: {counts or 'none'}{more}"
    if cost := cost_line(found):
        yield cost


def cost_line(found: SweepSummary) -> str:
    """What the cases took; empty where none was stepped."""
    if found.overhead is None:
        return ""
    return (
        f"{found.steps:.3g} engine steps in {found.engine_seconds:.1f} s of the processor;"
        f" {found.overhead:.2f} times that in all"
    )


def row_lines(row: SweepRow) -> Iterator[str]:
    """A case: its name and verdict, why, and the command that runs it alone."""
    drawn = ", ".join(f"{name} = {value:.6g}" for name, value in row.constants.items())
    step = "" if row.step is None else f", {row.step:g} s"
    yield visible(
        f"{row.outcome.value} #{row.index} {row.name}, {row.integrator}{step}"
        f"{': ' if drawn else ''}{drawn}"
    )
    judged = (
        f"E {_sci(row.discrepancy)}, U {_sci(row.uncertainty)}, error at the step"
        f" {_sci(row.global_error)}"
    )
    yield visible(f"  {judged}{'; ' if row.reason else ''}{row.reason}")
    yield visible(f"  {row.command}")


def _say(console: Console, line: str) -> None:
    """A line as it is: a range 10:100:log has no emoji."""
    console.print(line, soft_wrap=True, markup=False, emoji=False)


def _coloured(outcomes: dict[str, int]) -> str:
    parts = []
    for outcome in Outcome:
        if count := outcomes.get(outcome.value):
            style = STYLES[outcome]
            parts.append(f"[{style}]{count} {outcome.value}[/]")
    return ", ".join(parts)


def _sci(value: Number) -> str:
    return "–" if value is None else f"{value:.1e}"
