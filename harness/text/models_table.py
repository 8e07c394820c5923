"""The table of results: a row a model and engine, in as many columns as have room.

Nothing in it is cut: what has no room is left out as a whole, the last columns first; where names
alone are too wide, they get a line of their own.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterable, Sequence

from rich.console import Console
from rich.table import Table
from rich.text import Text

from physics_crosscheck.harness.records.base import Number
from physics_crosscheck.harness.records.case import Case, FullRun, ModelId
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.text.markup import escape
from physics_crosscheck.harness.text.styles import STYLES

NAMES = ("system", "model", "engine")

COLUMNS = (
    "outcome", "discrepancy", "uncertainty", "global error", "at step", "order", "0.1 % at",
)  # fmt: skip
"""From what is wanted most to what is wanted least, but for the first."""

ERROR = COLUMNS.index("global error")

LEAST = 3
"""Columns that stand in any table: outcome, discrepancy and uncertainty."""

TENTH = 0.001
"""The global error that the last column's steps would give."""

GAP = 2
INDENT = "  "

Row = tuple[tuple[str, ...], list[str]]
"""Names and cells of a model in an engine."""


def print_models(console: Console, cases: Iterable[Case]) -> None:
    """Print the table, a row a model and engine, as wide as the console at most."""
    groups = itertools.groupby(cases, lambda case: case.id.of_model)
    rows = [_row(model, list(group)) for model, group in groups]
    if not rows:
        return
    names = [max(len(NAMES[i]), *(len(row[0][i]) for row in rows)) for i in range(len(NAMES))]
    cells = [_width(name, [row[1][i] for row in rows]) for i, name in enumerate(COLUMNS)]
    above = _total([*names, *cells[:LEAST]]) > console.width
    taken = [len(INDENT) - GAP] if above else names
    shown = LEAST
    while shown < len(COLUMNS) and _total([*taken, *cells[: shown + 1]]) <= console.width:
        shown += 1
    if above:
        _print_below(console, rows, shown, cells)
    else:
        _print_beside(console, rows, shown)
    if shown > ERROR and any("/" in row[ERROR] for _, row in rows):
        console.print("global error: of positions / of velocities", style="dim")
    if shown == len(COLUMNS) and any(cells[-1].endswith("*") for _, cells in rows):
        console.print("* one of the motions is too sensitive for a step to be told", style="dim")


def _print_beside(console: Console, rows: Sequence[Row], shown: int) -> None:
    table = Table(box=None, pad_edge=False, header_style="bold")
    for name in (*NAMES, COLUMNS[0]):
        table.add_column(name, no_wrap=True)
    for name in COLUMNS[1:shown]:
        table.add_column(name, justify="right", no_wrap=True)
    for names, cells in rows:
        table.add_row(*map(escape, names), *cells[:shown])
    console.print(table)


def _print_below(console: Console, rows: Sequence[Row], shown: int, widths: list[int]) -> None:
    """Names on a line of their own, cells below them."""
    head = [COLUMNS[0].ljust(widths[0])]
    head += [name.rjust(width) for name, width in zip(COLUMNS[1:shown], widths[1:], strict=False)]
    console.print(f"[bold]{INDENT}{(' ' * GAP).join(head)}[/]", soft_wrap=True)
    for (system, model, engine), cells in rows:
        console.print(escape(f"{system}/{model} [{engine}]"), soft_wrap=True)
        line = Text(INDENT)
        for i, (cell, width) in enumerate(zip(cells[:shown], widths, strict=False)):
            text = Text.from_markup(cell)
            room = Text(" " * (width - text.cell_len))
            line += text + room if i == 0 else Text(" " * GAP) + room + text
        console.print(line, soft_wrap=True)


def _total(widths: Sequence[int]) -> int:
    return sum(widths) + GAP * (len(widths) - 1)


def _width(name: str, cells: Sequence[str]) -> int:
    return max(len(name), *(Text.from_markup(cell).cell_len for cell in cells))


def _row(model: ModelId, cases: Sequence[Case]) -> Row:
    counts = Counter(case.outcome for case in cases)
    outcome = ", ".join(f"[{STYLES[o]}]{counts[o]} {o}[/]" for o in reversed(Outcome) if counts[o])
    discrepancy, uncertainty = _sizes(cases)
    runs: list[FullRun] = [case.full_run for case in cases if case.full_run is not None]
    steps = [one.step for run in runs for one in run.steps_for if one.target == TENTH]
    tenth = known(steps)
    return (model.system, model.model, model.engine), [
        outcome,
        _most([discrepancy], "{:.1e}"),
        _most([uncertainty], "{:.1e}"),
        _both(
            _most((run.global_error for run in runs), "{:.2%}"),
            _most((run.velocity_error for run in runs), "{:.2%}"),
        ),
        _most((run.time_step for run in runs), "{:g} s"),
        _range(known(run.order for run in runs)),
        f"{min(tenth):.2g} s" + "*" * (len(tenth) < len(steps)) if tenth else "-",
    ]


def _sizes(cases: Sequence[Case]) -> tuple[Number, Number]:
    """Return a row's E and U.

    Where cases differ, both belong to the component that decides the case that differs most, so
    that E is above U; otherwise each is the largest of all cases, components and segments.
    """
    verdicts = [case.verdict for case in cases if case.verdict is not None]
    differing = [case.verdict for case in cases if case.verdict and case.outcome is Outcome.DIFFERS]
    if differing:
        worst = max(differing, key=lambda one: one.discrepancy or 0.0)
        return worst.discrepancy, worst.uncertainty
    largest = (
        known(one.largest_discrepancy for one in verdicts),
        known(one.largest_uncertainty for one in verdicts),
    )
    discrepancy, uncertainty = (max(found, default=None) for found in largest)
    return discrepancy, uncertainty


def known(values: Iterable[Number]) -> list[float]:
    """Those that are."""
    return [value for value in values if value is not None]


def _most(values: Iterable[Number], form: str) -> str:
    found = known(values)
    return form.format(max(found)) if found else "-"


def _both(positions: str, velocities: str) -> str:
    """The errors of both; of results of before, those of positions."""
    return positions if velocities == "-" else f"{positions} / {velocities}"


def _range(values: Sequence[float]) -> str:
    if not values:
        return "-"
    low, high = (f"{round(value, 1) + 0.0:.1f}" for value in (min(values), max(values)))
    return low if low == high else f"{low}-{high}"
