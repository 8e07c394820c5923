"""The table of results: a row per model and engine, in as many columns as fit.

Cells are never truncated, and empty columns are omitted. In a narrow terminal, names get their own
line, and a line below the table names the columns that did not fit.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass

from rich.console import Console
from rich.text import Text

from physics_crosscheck.harness.records.base import Number
from physics_crosscheck.harness.records.case import Case, FullRun, ModelId, ModelKey
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.results.places import shown_path
from physics_crosscheck.harness.results.status import counted, duration, percent
from physics_crosscheck.harness.results.visible import visible
from .console import STYLES, WORDS, print_wrapped

NAMES = ("system", "model", "engine")

COLUMNS = (
    "status", "digits", "error", "uncertainty", "off by", "error at dt", "dt", "order",
    "dt for 0.1 %",
)  # fmt: skip
"""Columns in order of importance."""

TENTH = 0.001
"""Target error of the last column's steps."""

LARGE = 0.1
"""Minimum error at which a motion without a suitable time step is chaotic."""

MAX_ROWS = 40
"""Maximum number of targets to print; the worst come first."""

GAP = "  "

CHAOTIC = "chaotic"
"""Shown in place of an error at dt that does not depend on the model or the time step."""


@dataclass(frozen=True, kw_only=True)
class ModelRow:
    """A model in an engine.

    Attributes:
        names: names of system, model and engine.
        cells: cells by column, empty for missing values.
        status: status with colours.
    """

    names: tuple[str, ...]
    cells: dict[str, str]
    status: Text


def engine_cells(results: Results) -> dict[str, dict[str, tuple[Outcome, str]]]:
    """Return the worst outcome of each target or model by engine, and its text.

    The text is the digits to which the engine follows the file, or what goes wrong.
    """
    single = len({case.folder for case in results.cases}) == 1
    rows: dict[str, dict[str, list[Case]]] = {}
    reached = [c for c in results.cases if c.engine != "-" or c.outcome is not Outcome.ABSENT]
    for case in reached:
        name = visible(case.model if single else shown_path(case.folder))
        rows.setdefault(name, {}).setdefault(case.engine, []).append(case)
    faulty = {one.key for one in results.models if one.findings and not one.accepted}
    return {
        name: {engine: _cell(cases, faulty) for engine, cases in row.items()}
        for name, row in rows.items()
    }


def print_matrix(console: Console, results: Results) -> None:
    """Print a row for each target, or each model of a single one, and a column for each engine.

    A cell has the digits to which the engine follows the files, or what goes wrong; the worst rows
    come first. Where the columns do not fit, each name has its own line.
    """
    cells = engine_cells(results)
    worst = {name: max(one[0].severity for one in row.values()) for name, row in cells.items()}
    shown = sorted(cells, key=lambda name: -worst[name])[:MAX_ROWS]
    engines = [one for one in dict.fromkeys(case.engine for case in results.cases) if one != "-"]
    widths = [
        max(len(one), *(len(cells[name].get(one, _NO_CELL)[1]) for name in shown))
        for one in engines
    ]
    first = max(map(len, shown))
    narrow = _total([first, *widths]) > console.width
    if engines and not narrow:
        _print_line(console, Text(_joined(["", *engines], [first, *widths])))
    for name in shown:
        line = Text(f"{name}\n" if narrow else name.ljust(first))
        if "-" in cells[name]:
            line.append(GAP).append(cells[name]["-"][1], STYLES[cells[name]["-"][0]])
        for engine, width in zip(engines, widths, strict=True):
            outcome, text = cells[name].get(engine, _NO_CELL)
            line.append(GAP).append(f"{engine} " if narrow and text else "")
            line.append(text if narrow else text.ljust(width), STYLES[outcome])
        _print_line(console, line)
    if hidden := len(cells) - len(shown):
        _print_note(console, f"{counted(hidden, 'more row')}; --details shows every model")


_NO_CELL = (Outcome.ABSENT, "")


def _off_by(case: Case) -> float:
    return 0.0 if case.verdict is None else case.verdict.discrepancy or 0.0


def _cell(cases: Sequence[Case], faulty: Container[ModelKey]) -> tuple[Outcome, str]:
    """Return the worst outcome of cases in one engine, and its text."""
    case = max(cases, key=lambda one: (one.shown.severity, _off_by(one)))
    if case.shown is Outcome.DIFFERS and _off_by(case):
        return case.shown, f"{WORDS[case.shown]} {percent(_off_by(case))}"
    if case.shown is not Outcome.AGREES:
        return case.shown, WORDS[case.shown]
    if any(one.key in faulty for one in cases):
        return Outcome.DIFFERS, WORDS[Outcome.DIFFERS]
    digits = finite_values(one.digits for one in cases if not one.accepted)
    return case.shown, f"{min(digits):.1f}" if digits else WORDS[case.shown]


def print_models(console: Console, cases: Iterable[Case]) -> None:
    """Print errors with their uncertainties, and the error of time steps, of each model.

    Args:
        console: to print on.
        cases: cases of the run, grouped by model and engine.
    """
    groups = itertools.groupby(cases, lambda case: case.id.of_model)
    rows = [_row(model, list(group)) for model, group in groups]
    if not rows:
        return
    columns = [name for name in COLUMNS if any(row.cells.get(name) for row in rows)]
    lost = _print_rows(console, rows, columns)
    chaotic = any(CHAOTIC in row.cells["error at dt"] for row in rows)
    if chaotic and "error at dt" not in lost:
        note = "chaotic: a motion that no time step follows to its end; the model is right"
        _print_note(console, note)
    if lost:
        _print_note(console, f"a wider terminal also shows: {', '.join(lost)}")


def is_chaotic(case: Case) -> bool:
    """Return whether a case agrees but its final error is large at every time step."""
    run = case.full_run
    if case.outcome is not Outcome.AGREES or run is None or (run.global_error or 0.0) < LARGE:
        return False
    return any(one.target == TENTH and one.step is None for one in run.steps_for)


def finite_values(values: Iterable[Number]) -> list[float]:
    """Return the values that are not missing."""
    return [value for value in values if value is not None]


def _print_note(console: Console, note: str) -> None:
    print_wrapped(console, note, lead=GAP, indent=len(GAP))


def _print_rows(console: Console, rows: Sequence[ModelRow], columns: list[str]) -> list[str]:
    """Print a header and rows; return the columns that did not fit."""
    widths = {name: max(len(name), *(len(row.cells[name]) for row in rows)) for name in columns}
    # A single system is named above the table.
    first = len({row.names[0] for row in rows}) == 1 and len(rows) > 1
    heads = NAMES[first:]
    names = [
        max(len(head), *(len(row.names[i]) for row in rows))
        for i, head in enumerate(NAMES)
        if i >= first
    ]
    least = [widths[name] for name in columns[:2]]
    above = _total([*names, *least]) > console.width
    room = console.width - (len(GAP) if above else _total(names) + len(GAP))
    count = 1
    while count < len(columns) and _total([widths[c] for c in columns[: count + 1]]) <= room:
        count += 1
    shown = columns[:count]
    head = Text(GAP if above else "", style="bold")
    if not above:
        head.append(_joined(heads, names) + GAP)
    head.append(_cells({name: name for name in shown}, shown, widths))
    _print_line(console, head)
    for row in rows:
        line = Text(GAP if above else _joined(row.names[first:], names) + GAP)
        if above:
            system, model, engine = row.names
            _print_line(console, Text(f"{system}/{model} [{engine}]"))
        line += row.status + Text(" " * (widths[shown[0]] - row.status.cell_len))
        if rest := shown[1:]:
            line += Text(GAP + _cells(row.cells, rest, widths))
        _print_line(console, line)
    return columns[count:]


def _print_line(console: Console, line: Text) -> None:
    line.rstrip()
    console.print(line, soft_wrap=True)


def _joined(names: Sequence[str], widths: Sequence[int]) -> str:
    return GAP.join(name.ljust(width) for name, width in zip(names, widths, strict=True))


def _cells(cells: dict[str, str], columns: Sequence[str], widths: dict[str, int]) -> str:
    return GAP.join(
        cells[name].ljust(widths[name]) if name == "status" else cells[name].rjust(widths[name])
        for name in columns
    )


def _total(widths: Sequence[int]) -> int:
    return sum(widths) + len(GAP) * (len(widths) - 1)


def _row(model: ModelId, cases: Sequence[Case]) -> ModelRow:
    counts = Counter(case.shown for case in cases)
    status = Text(", ").join(
        Text(f"{counts[one]} {WORDS[one]}", STYLES[one]) for one in reversed(Outcome) if counts[one]
    )
    agreeing = [case for case in cases if case.outcome is Outcome.AGREES]
    digits = finite_values(one.digits for one in agreeing)
    discrepancy, uncertainty = _sizes(cases)
    differs = bool(counts[Outcome.DIFFERS]) and discrepancy is not None
    runs = [c.full_run for c in cases if c.full_run is not None and not is_chaotic(c)]
    chaotic = any(map(is_chaotic, cases))
    errors = finite_values(e for run in runs for e in (run.global_error, run.velocity_error))
    steps = finite_values(case.full_run.time_step for case in cases if case.full_run is not None)
    cells = {
        "status": status.plain,
        "digits": f"{min(digits):.1f}" if digits else "",
        "off by": percent(discrepancy or 0.0) if differs else "",
        "error": "" if discrepancy is None else f"{discrepancy:.1e}",
        "uncertainty": "" if uncertainty is None else f"{uncertainty:.1e}",
        "error at dt": _error(max(errors, default=None), chaotic),
        "dt": duration(max(steps)) if steps else "",
        "order": _range(finite_values(run.order for run in runs)),
        "dt for 0.1 %": _step_for_tenth(runs),
    }
    names = visible(model.system), visible(model.model), visible(model.engine)
    return ModelRow(names=names, cells=cells, status=status)


def _error(error: Number, chaotic: bool) -> str:
    parts = ([] if error is None else [percent(error)]) + [CHAOTIC] * chaotic
    return ", ".join(parts)


def _step_for_tenth(runs: Sequence[FullRun]) -> str:
    """Return the time step for an error of 0.1 % in every motion; empty if unknown."""
    steps = [one.step for run in runs for one in run.steps_for if one.target == TENTH]
    finite = finite_values(steps)
    return duration(min(finite)) if finite and len(finite) == len(steps) else ""


def _sizes(cases: Sequence[Case]) -> tuple[Number, Number]:
    """Return a row's E and U.

    If cases differ, both belong to the deciding component of the case that differs most, so E is
    above U. Otherwise each is the maximum over all cases, components and segments.
    """
    verdicts = [case.verdict for case in cases if case.verdict is not None]
    differing = [case.verdict for case in cases if case.verdict and case.outcome is Outcome.DIFFERS]
    if differing:
        worst = max(differing, key=lambda one: one.discrepancy or 0.0)
        return worst.discrepancy, worst.uncertainty
    largest = (
        finite_values(one.largest_discrepancy for one in verdicts),
        finite_values(one.largest_uncertainty for one in verdicts),
    )
    discrepancy, uncertainty = (max(found, default=None) for found in largest)
    return discrepancy, uncertainty


def _range(values: Sequence[float]) -> str:
    if not values:
        return ""
    low, high = (f"{round(value, 1) + 0.0:.1f}" for value in (min(values), max(values)))
    return low if low == high else f"{low} to {high}"
