"""Print a sweep in a terminal: outcomes, digits, worst cases, each with its command."""

from __future__ import annotations

from collections.abc import Iterator

from rich.console import Console
from rich.measure import Measurement
from rich.table import Table

from physics_crosscheck.harness.records.base import Number
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.sweep import SweepRow, SweepSummary
from physics_crosscheck.harness.render.terminal.console import print_status_lines, wrapped
from physics_crosscheck.harness.render.terminal.markup import escape
from physics_crosscheck.harness.render.terminal.styles import STYLES, WORDS
from physics_crosscheck.harness.results.status import counted, percent
from physics_crosscheck.harness.results.visible import visible

MAX_ROWS = 12
"""Maximum number of listed cases without agreement."""


def print_sweep(console: Console, sweep_summary: SweepSummary) -> None:
    """Print the verdict, the outcomes by system and engine, and the worst cases."""
    _print_line(console, verdict_line(sweep_summary))
    table = Table(box=None, pad_edge=False, header_style="dim")
    for title in (
        "system",
        "engine",
        "integrator",
        "cases",
        "outcomes",
        "digits",
        "error at dt",
    ):
        table.add_column(title)
    for group in sweep_summary.groups:
        table.add_row(
            escape(group.system),
            escape(group.engine),
            escape(group.integrator),
            str(sum(group.outcomes.values())),
            _coloured(group.outcomes),
            "–" if group.least_digits is None else f"{group.least_digits:.1f}",
            _percent(group.worst_error),
        )
    wide = Measurement.get(console, console.options.update_width(10_000), table).maximum
    if wide <= console.width:
        console.print(table)
    else:
        _print_groups(console, sweep_summary)
    bad = [row for row in sweep_summary.worst if row.outcome is not Outcome.AGREES]
    for row in bad[:MAX_ROWS]:
        for line in row_lines(row):
            _print_line(console, line)
    if cost := cost_line(sweep_summary):
        _print_line(console, cost)


def _print_groups(console: Console, sweep_summary: SweepSummary) -> None:
    """Print the outcomes as a list if a table would be too wide."""
    for group in sweep_summary.groups:
        digits = "" if group.least_digits is None else f", {group.least_digits:.1f} digits"
        counts = ", ".join(_counts(group.outcomes))
        _print_line(
            console,
            f"  {group.system} [{group.engine}], {group.integrator}: {counts}{digits},"
            f" error at dt up to {_percent(group.worst_error)}",
        )


def verdict_line(sweep_summary: SweepSummary) -> str:
    """Return the verdict, the number of cases per outcome, and the number of remaining cases."""
    counts = ", ".join(_counts(sweep_summary.outcomes))
    remaining = sweep_summary.plan.cases - sweep_summary.done
    more = f"; {remaining} not run yet" if remaining else ""
    broken = not sweep_summary.outcomes or sweep_summary.outcomes.keys() & {
        Outcome.FAILED,
        Outcome.REFUSED,
    }
    differ = sweep_summary.outcomes.keys() - {Outcome.AGREES.value}
    word = "ERROR" if broken else "FAIL" if differ else "ok"
    if word == "ok":
        verb = "agrees" if sweep_summary.done == 1 else "agree"
        return f"ok  {counted(sweep_summary.done, 'case')} {verb}{more}"
    return f"{word}  {counted(sweep_summary.done, 'case')}: {counts or 'none'}{more}"


def cost_line(sweep_summary: SweepSummary) -> str:
    """Return the cost of all engine steps; empty where no case ran."""
    if sweep_summary.overhead is None:
        return ""
    seconds = f"{sweep_summary.engine_seconds:.1f} s of processor time"
    steps = f"{sweep_summary.steps:.3g} engine steps took {seconds}"
    return f"{steps}; the whole sweep {sweep_summary.overhead:.2f} times as much"


def row_lines(row: SweepRow) -> Iterator[str]:
    """Yield the verdict of a case, its numbers, and the command that runs it alone."""
    drawn = ", ".join(f"{name} = {value:.6g}" for name, value in row.constants.items())
    step = "" if row.step is None else f", {row.step:g} s"
    yield visible(
        f"{WORDS[row.outcome]}  #{row.index} {row.name}, {row.integrator}{step}"
        f"{': ' if drawn else ''}{drawn}"
    )
    judged = (
        f"difference {_sci(row.discrepancy)}, uncertainty {_sci(row.uncertainty)}, error at dt"
        f" {_percent(row.global_error)}"
    )
    yield visible(f"  {judged}{'; ' if row.reason else ''}{row.reason}")
    yield visible(f"  {row.command}")


def _print_line(console: Console, line: str) -> None:
    """Print a line with its status word in colour, wrapped unless it is a command."""
    lines = [line] if line.startswith("  crosscheck ") else wrapped(line, console.width)
    print_status_lines(console, lines)


def _coloured(outcomes: dict[str, int]) -> str:
    parts = []
    for outcome in Outcome:
        if count := outcomes.get(outcome.value):
            style = STYLES[outcome]
            parts.append(f"[{style}]{count} {WORDS[outcome]}[/]")
    return ", ".join(parts)


def _counts(outcomes: dict[str, int]) -> list[str]:
    return [f"{number} {WORDS[Outcome(name)]}" for name, number in outcomes.items()]


def _percent(value: Number) -> str:
    return "–" if value is None else percent(value)


def _sci(value: Number) -> str:
    return "–" if value is None else f"{value:.1e}"
