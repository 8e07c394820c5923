"""A page on a sweep, in the report's style, without a script."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.sweep import SweepRow, SweepSummary
from physics_crosscheck.harness.records.write import write_whole
from physics_crosscheck.harness.render.html import template
from physics_crosscheck.harness.render.html.scatter import (
    BOTTOM,
    HEIGHT,
    LEFT_MARGIN,
    RIGHT,
    TOP,
    WIDTH,
    Bar,
    Mark,
    Point,
    Scatter,
    bars,
    mark,
    scatter,
)
from physics_crosscheck.harness.render.html.text import NOTHING, percent, quantity, sci, shown
from physics_crosscheck.harness.render.terminal.sweep import cost_line
from physics_crosscheck.harness.results.messages import with_code
from physics_crosscheck.harness.results.status import counted

FRAME = {"width": WIDTH, "height": HEIGHT, "left": LEFT_MARGIN, "right": WIDTH - RIGHT}
FRAME |= {"top": TOP, "bottom": HEIGHT - BOTTOM}


@dataclass(frozen=True, kw_only=True)
class SweepCaseRow:
    """A listed case."""

    name: str
    outcome: str
    drawn: str
    discrepancy: str
    uncertainty: str
    error: str
    reason: str
    command: str


@dataclass(frozen=True, kw_only=True)
class GroupView:
    """The cases of a system in an engine and integrator."""

    system: str
    engine: str
    integrator: str
    counts: tuple[tuple[str, int], ...]
    digits: str
    error: str


@dataclass(frozen=True, kw_only=True)
class Figures:
    """Plots of a system's cases over each varied quantity."""

    system: str
    what: str
    marks: tuple[Mark, ...]
    pictures: tuple[Scatter, ...]


@dataclass(frozen=True, kw_only=True)
class PlottedQuantity:
    """A plotted quantity of each case: its name, value and format."""

    what: str
    value_of: Callable[[SweepRow], float | None]
    format_value: Callable[[float | None], str]


def _known_to(row: SweepRow) -> float | None:
    """Return the larger of a case's discrepancy and uncertainty."""
    return max((one for one in (row.discrepancy, row.uncertainty) if one is not None), default=None)


AT_THE_STEP = PlottedQuantity(
    what="error at dt", value_of=lambda row: row.global_error, format_value=percent
)
OF_SEGMENTS = PlottedQuantity(what="larger of E and U", value_of=_known_to, format_value=sci)
"""Quantity for robot states, which have no motion at the model's time step."""


@dataclass(frozen=True, kw_only=True)
class SweepPage:
    """The page; each of `figures` has one system's plots and the markers of its engines."""

    title: str
    summary: str
    cost: str
    not_run: str
    command: str
    outcomes: tuple[Bar, ...]
    digits: tuple[Bar, ...]
    groups: tuple[GroupView, ...]
    figures: tuple[Figures, ...]
    rows: tuple[SweepCaseRow, ...]


def write_sweep(path: Path, sweep_summary: SweepSummary) -> None:
    """Write the page."""
    write_whole(path, render_sweep(sweep_summary))


def render_sweep(sweep_summary: SweepSummary) -> str:
    """Return the page as HTML; the same rows give the same text."""
    return template("sweep.html", page=_page(sweep_summary), frame=FRAME)


def _page(sweep_summary: SweepSummary) -> SweepPage:
    remaining = sweep_summary.plan.cases - sweep_summary.done
    systems = list(dict.fromkeys(one.system for one in sweep_summary.groups))
    return SweepPage(
        title=shown(f"Sweep of {', '.join(systems) or 'nothing'}"),
        summary=", ".join(f"{count} {name}" for name, count in sweep_summary.outcomes.items())
        or "no rows",
        cost=_cost(sweep_summary),
        not_run=f"{counted(remaining, 'case')} not run yet" if remaining else "",
        command=shown(sweep_summary.plan.command),
        outcomes=bars(sweep_summary.outcomes),
        digits=bars(sweep_summary.digits),
        groups=tuple(
            GroupView(
                system=shown(one.system),
                engine=shown(one.engine),
                integrator=shown(one.integrator),
                counts=tuple(one.outcomes.items()),
                digits=NOTHING if one.least_digits is None else f"{one.least_digits:.1f}",
                error=percent(one.worst_error),
            )
            for one in sweep_summary.groups
        ),
        figures=tuple(_figures(sweep_summary, system) for system in systems),
        rows=tuple(map(_row, sweep_summary.worst)),
    )


def _cost(sweep_summary: SweepSummary) -> str:
    if sweep_summary.overhead is None:
        return ""
    return (
        f"{cost_line(sweep_summary)}, of it"
        f" {sweep_summary.reference_seconds / sweep_summary.engine_seconds:.2f} for reference"
        f" motions and {sweep_summary.loading_seconds / sweep_summary.engine_seconds:.2f} for"
        " loading models"
    )


def _figures(sweep_summary: SweepSummary, system: str) -> Figures:
    """Return the plots of a system's cases over each varied quantity."""
    rows = [row for row in sweep_summary.sampled if row.system == system]
    what = AT_THE_STEP if any(row.global_error is not None for row in rows) else OF_SEGMENTS
    series = list(dict.fromkeys(f"{row.engine}, {row.integrator}" for row in rows))
    names = [
        name for name in sweep_summary.plan.constants if any(name in row.constants for row in rows)
    ]
    drawn = [scatter_of(rows, series, name, what) for name in names]
    if len({row.step for row in rows}) > 1:
        drawn.append(scatter_of(rows, series, "", what))
    return Figures(
        system=shown(system),
        what=what.what,
        marks=tuple(mark(i, name) for i, name in enumerate(series)),
        pictures=tuple(one for one in drawn if one is not None),
    )


def scatter_of(
    rows: list[SweepRow], series: list[str], name: str, what: PlottedQuantity = AT_THE_STEP
) -> Scatter | None:
    """Plot a quantity over a constant, or over the step if no name is given."""
    points = list(_points(rows, series, name, what))
    over = name or "the step"
    amiss = sum(p.outcome != Outcome.AGREES for p in points)
    ringed = f", {amiss} that did not agree (ringed)" if amiss else ""
    largest = what.format_value(max((p.y for p in points), default=None))
    return scatter(
        f"{what.what[0].upper()}{what.what[1:]} over {over}",
        name or "step h [s]",
        points,
        f"{counted(len(points), 'case')}{ringed}; {largest} at most.",
    )


def _points(
    rows: list[SweepRow], series: list[str], name: str, what: PlottedQuantity
) -> Iterator[Point]:
    for row in rows:
        x, y = row.constants.get(name) if name else row.step, what.value_of(row)
        if x is None or y is None or row.outcome is Outcome.FAILED:
            continue
        number = series.index(f"{row.engine}, {row.integrator}")
        label = f"#{row.index} {row.name}: {what.format_value(y)}"
        yield Point(x=x, y=y, series=number, outcome=row.outcome.value, description=label)


def _row(row: SweepRow) -> SweepCaseRow:
    drawn = [f"{name} = {value:.6g}" for name, value in row.constants.items()]
    return SweepCaseRow(
        name=shown(f"#{row.index} {row.name}"),
        outcome=row.outcome.value,
        drawn=shown(", ".join([row.integrator, quantity(row.step, "s"), *drawn])),
        discrepancy=sci(row.discrepancy),
        uncertainty=sci(row.uncertainty),
        error=percent(row.global_error),
        reason=shown(with_code(row.code, row.reason)),
        command=shown(row.command),
    )
