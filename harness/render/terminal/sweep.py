"""Print a sweep in a terminal: the worst cases, each with its command, and all outcomes."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence

from rich.console import Console
from rich.measure import Measurement
from rich.table import Table

from physics_crosscheck.harness.records.base import Number
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.sweep import SweepRow, SweepSummary
from physics_crosscheck.harness.results.messages import explain_hint, with_code
from physics_crosscheck.harness.results.status import counted, percent
from physics_crosscheck.harness.results.visible import visible
from .console import STYLES, WORDS, escape, print_hint, print_status_lines, wrapped, wrapped_command

MAX_ROWS = 12
"""Maximum number of listed problems."""


def print_sweep(console: Console, sweep_summary: SweepSummary) -> None:
    """Print the verdict, the worst case of each problem, and the outcomes by engine."""
    _print_line(console, verdict_line(sweep_summary))
    bad = [row for row in sweep_summary.worst if row.outcome is not Outcome.AGREES]
    for alike in _alike(bad)[:MAX_ROWS]:
        _print_case(console, alike)
    _print_outcomes(console, sweep_summary)
    if cost := cost_line(sweep_summary):
        _print_line(console, cost)
    print_hint(console, explain_hint(row.code for row in bad))


def _alike(rows: Sequence[SweepRow]) -> list[list[SweepRow]]:
    """Group cases with one problem of a model file, the worst first."""
    groups: dict[tuple[str, ...], list[SweepRow]] = {}
    for row in rows:
        key = row.system, row.model, row.engine, row.integrator, row.code
        groups.setdefault(key, []).append(row)
    return list(groups.values())


def _print_case(console: Console, alike: Sequence[SweepRow]) -> None:
    """Print the worst of some cases, and the numbers of the others."""
    worst, *others = alike
    for line in row_lines(worst):
        _print_line(console, line)
    if others:
        _print_line(console, f"  also {', '.join(f'#{row.index}' for row in others)}")


def _print_outcomes(console: Console, sweep_summary: SweepSummary) -> None:
    """Print the outcomes by engine as a table, or as a list if it would be too wide."""
    columns: dict[str, list[str]] = {
        "system": [escape(one.system) for one in sweep_summary.groups],
        "engine": [escape(one.engine) for one in sweep_summary.groups],
        "integrator": [escape(one.integrator) for one in sweep_summary.groups],
        "cases": [str(sum(one.outcomes.values())) for one in sweep_summary.groups],
        "outcomes": [_coloured(one.outcomes) for one in sweep_summary.groups],
        "digits": [_digits(one.least_digits) for one in sweep_summary.groups],
        "error at dt": [_percent(one.worst_error) for one in sweep_summary.groups],
    }
    used = {title: cells for title, cells in columns.items() if any(cells)}
    table = Table(box=None, pad_edge=False, header_style="dim")
    for title in used:
        table.add_column(title)
    for cells in zip(*used.values(), strict=True):
        table.add_row(*cells)
    wide = Measurement.get(console, console.options.update_width(10_000), table).maximum
    if wide <= console.width:
        console.print(table)
    else:
        _print_groups(console, sweep_summary)


def _print_groups(console: Console, sweep_summary: SweepSummary) -> None:
    """Print the outcomes as a list if a table would be too wide."""
    for group in sweep_summary.groups:
        digits, error = _digits(group.least_digits), _percent(group.worst_error)
        parts = _counts(group.outcomes)
        parts += [f"{digits} digits"] if digits else []
        parts += [f"error at dt up to {error}"] if error else []
        name = f"{group.system} [{group.engine}], {group.integrator}"
        _print_line(console, f"  {name}: {', '.join(parts)}")


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
    steps = f"{sweep_summary.steps:,} engine steps took {seconds}".replace(",", " ")
    return f"{steps}; the whole sweep {sweep_summary.overhead:.2f} times as much"


def row_lines(row: SweepRow) -> Iterator[str]:
    """Yield the verdict of a case, its numbers, and the command that runs it alone."""
    drawn = ", ".join(f"{name} = {value:.6g}" for name, value in row.constants.items())
    step = "" if row.step is None else f", {row.step:g} s"
    yield visible(
        f"{WORDS[row.outcome]}  #{row.index} {row.name}, {row.integrator}{step}"
        f"{': ' if drawn else ''}{drawn}"
    )
    if row.reason:
        yield visible(f"  {with_code(row.code, row.reason)}")
    else:
        judged = f"difference {_sci(row.discrepancy)}, uncertainty {_sci(row.uncertainty)}"
        error = "" if row.global_error is None else f", error at dt {percent(row.global_error)}"
        yield f"  {judged}{error}"
    yield visible(f"  {row.command}")


def _print_line(console: Console, line: str) -> None:
    """Print a line with its status word in colour, wrapped unless it is a command."""
    words = shlex.split(line) if line.startswith("  crosscheck ") else []
    width = console.width
    lines = wrapped_command(list(map(shlex.quote, words)), width) if words else wrapped(line, width)
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
    return "" if value is None else percent(value)


def _digits(value: Number) -> str:
    return "" if value is None else f"{value:.1f}"


def _sci(value: Number) -> str:
    return "–" if value is None else f"{value:.1e}"
