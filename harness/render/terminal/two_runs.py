"""Print the changes between two runs: which cases changed, and by how much."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from rich.console import Console

from physics_crosscheck.harness.records.base import Number
from physics_crosscheck.harness.records.diff import Diff, RunDiff, Status
from physics_crosscheck.harness.render.terminal.console import print_text
from physics_crosscheck.harness.render.terminal.versions import (
    MAX_CASES,
    counted_changes,
    error_change,
    print_changes,
    verdicts,
)
from physics_crosscheck.harness.results.status import counted


def headline(runs: RunDiff) -> str:
    """Return one line: how many cases changed, each by its worst change."""
    parts = counted_changes(Counter(case.changed[0] for case in runs.changed if case.changed))
    states = Counter(case.status for case in runs.changed)
    parts += [f"{states[one]} {one}" for one in (Status.GONE, Status.NEW) if states[one]]
    worse = sum(case.is_worse for case in runs.cases)
    line = f"{counted(len(runs.cases), 'case')}: {', '.join(parts) or 'nothing changed'}"
    return f"{line}; {worse} worse" if worse else line


def digits_change(then: Number, now: Number) -> str:
    """Return the change in agreeing digits."""
    if then is None and now is None:
        return "-"
    before, after = ("-" if one is None else f"{one:.1f}" for one in (then, now))
    return before if before == after else f"{before} -> {after}"


def print_two_runs(console: Console, runs: RunDiff) -> None:
    """Print the summary, new causes with their remedy, then what changed, worst first."""
    print_text(console, f"{'FAIL' if runs.changed else 'ok'}  {headline(runs)}")
    for line in runs.broken:
        print_text(console, f"Fix: change {line}")
    for line in runs.fixed:
        print_text(console, f"fixed  {line}")
    for what, then, now in runs.versions:
        print_text(console, f"{what} {then} -> {now}")
    both = [case for case in runs.changed if case.before is not None and case.after is not None]
    if shown_causes := both[:MAX_CASES]:
        _print_table(console, shown_causes)
    if len(both) > MAX_CASES:
        print_text(console, f"and {len(both) - MAX_CASES} more, on the page")
    for kind in (Status.GONE, Status.NEW):
        models: dict[str, list[str]] = {}
        for case in sorted(runs.changed, key=lambda one: one.id):
            if case.status is kind:
                models.setdefault(str(case.id.of_model), []).append(case.id.scenario)
        for model, scenarios in models.items():
            print_text(console, f"{kind}  {model}: {', '.join(scenarios)}")


def _print_table(console: Console, cases: Sequence[Diff]) -> None:
    rows = [
        (
            str(case.id),
            case.summary,
            verdicts(*case.outcomes),
            digits_change(*case.digits),
            error_change(*case.global_errors),
        )
        for case in cases
    ]
    print_changes(console, "digits", rows)
