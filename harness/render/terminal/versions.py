"""Print the changes of engine upgrades in a terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rich.console import Console
from rich.measure import Measurement
from rich.table import Table

from physics_crosscheck.harness.records.base import Number
from physics_crosscheck.harness.records.diff import WORST_FIRST, Changed, Diff
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.versions import Upgrade, Versions
from physics_crosscheck.harness.render.terminal.console import STYLES, escape, print_text
from physics_crosscheck.harness.results.status import counted

MAX_CASES = 40


def print_versions(console: Console, versions: Versions) -> None:
    """Print the verdict with the remedy, then the changes of each upgrade, worst first."""
    print_text(console, advice(versions))
    for upgrade in versions.upgrades:
        console.print()
        print_text(console, f"{versions.engine} {upgrade.before} -> {upgrade.after}", "bold")
        changed = [case for case in upgrade.cases if case.is_change or not case.is_compared]
        if changed:
            _print_table(console, changed[:MAX_CASES])
            for case in changed[:MAX_CASES]:
                _print_messages(console, case)
        if len(changed) > MAX_CASES:
            print_text(console, f"and {len(changed) - MAX_CASES} more")
        for model in upgrade.models:
            print_text(console, f"{model.id}: {', '.join(model.kinds)}")
            for message in model.messages:
                print_text(console, f"  {message}")
        print_text(console, counts(upgrade))


def counts(upgrade: Upgrade) -> str:
    """Return one line: how many cases changed, and how well the others agree."""
    parts = []
    if upgrade.same:
        parts.append(f"{len(upgrade.same)} unchanged{_alike(upgrade.same)}")
    if upgrade.changed:
        parts.append(f"{len(upgrade.changed)} changed")
    if upgrade.not_compared:
        parts.append(f"{len(upgrade.not_compared)} not compared")
    models = f"; {counted(len(upgrade.models), 'model')} changed" if upgrade.models else ""
    return f"{counted(len(upgrade.cases), 'case')}: {', '.join(parts) or 'none'}{models}"


def advice(versions: Versions) -> str:
    """Return the verdict, and what to do."""
    first, last = versions.versions[0], versions.versions[-1]
    if versions.incomplete:
        text = f"ERROR  {versions.engine}: not everything could be compared."
        text += " Fix the errors below first"
    elif versions.changed:
        text = (
            f"FAIL  {versions.engine} {first.version} -> {last.version} changes results. Check them"
            " before you upgrade"
        )
    else:
        return (
            f"ok  {versions.engine} {last.version} can replace {first.version} for these models:"
            " no result changes"
        )
    reports = "  ".join(f"{one.report}/index.html" for one in versions.versions)
    return f"{text}. Reports: {reports}"


def _alike(same: Sequence[Diff]) -> str:
    """Return to what tolerance limits agree, and how many are bitwise equal."""
    measured = [case for case in same if case.moved is not None and case.uncertainty is not None]
    if not measured:
        return ""
    bitwise = sum(case.moved == 0.0 for case in measured)
    if bitwise == len(measured):
        return " (identical to the last bit)"
    size = max(case.moved or 0.0 for case in measured)
    bound = max(case.uncertainty or 0.0 for case in measured)
    last = f", {bitwise} identical to the last bit" if bitwise else ""
    return f" (differ by at most {size:.1e}, uncertainty {bound:.0e}{last})"


def _print_table(console: Console, cases: Sequence[Diff]) -> None:
    rows = [
        (
            str(case.id),
            case.summary,
            verdicts(*case.outcomes),
            limits(case),
            error_change(*case.global_errors),
        )
        for case in cases
    ]
    print_changes(console, "difference", rows)


def print_changes(
    console: Console, size: str, rows: Sequence[tuple[str, str, str, str, str]]
) -> None:
    """Print a table of cases; a list where the table is wider than the console.

    Args:
        console: to print on.
        size: header of the fourth column.
        rows: name of the case, kind of change, verdict in markup, size, and error at dt.
    """
    table = Table(box=None, pad_edge=False, header_style="bold")
    for title in ("case", "changed", "verdict"):
        table.add_column(title, no_wrap=True)
    for title in (size, "error at dt"):
        table.add_column(title, justify="right", no_wrap=True)
    for name, *cells in rows:
        table.add_row(escape(name), *cells)
    wide = Measurement.get(console, console.options.update_width(10_000), table).maximum
    if wide <= console.width:
        console.print(table)
        return
    for name, kinds, verdict, number, error in rows:
        print_text(console, name)
        console.print(f"  {kinds}: {verdict}", soft_wrap=True)
        print_text(console, f"  {size} {number}, error at dt {error}")


def counted_changes(counts: Mapping[Changed, int]) -> list[str]:
    """Return how many cases changed in what, such as `2 with another verdict`, the worst first."""
    number = {"digits": "another number of digits"}
    return [
        f"{counts[what]} with {number.get(what, f'another {what}')}"
        for what in WORST_FIRST
        if counts.get(what)
    ]


def verdicts(before: Outcome | None, after: Outcome | None) -> str:
    """Return the change of a verdict, in the terminal's colours."""
    if before is after:
        return _styled(after)
    return f"{_styled(before)} -> {_styled(after)}"


def _styled(outcome: Outcome | None) -> str:
    return "none" if outcome is None else f"[{STYLES[outcome]}]{outcome}[/]"


def limits(case: Diff) -> str:
    """Return the difference of a case's limits, and its uncertainty."""
    if case.moved is None or case.uncertainty is None:
        return "-"
    return f"{case.moved:.1e} ± {case.uncertainty:.0e}"


def error_change(then: Number, now: Number) -> str:
    """Return the change of a global error, and its ratio."""
    if then is None and now is None:
        return "-"
    if then == now:
        return _percent(then)
    ratio = f" (x {now / then:.3g})" if then and now else ""
    return f"{_percent(then)} -> {_percent(now)}{ratio}"


def _percent(value: Number) -> str:
    return "-" if value is None else f"{100 * value:.3g} %"


def _print_messages(console: Console, case: Diff) -> None:
    print_text(console, f"{case.summary}: {case.id}")
    for message in case.messages:
        print_text(console, f"  {message}")
