"""A page on a sweep, in the report's style; it runs no script."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from harness.records.outcome import Outcome
from harness.records.sweep import SweepRow, SweepSummary
from harness.records.write import write_whole
from harness.report import template
from harness.report.scatter import (
    BOTTOM,
    HEIGHT,
    LEFT,
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
from harness.report.text import NOTHING, percent, quantity, sci, shown
from harness.text.status import counted
from harness.text.sweep import cost_line

FRAME = {"width": WIDTH, "height": HEIGHT, "left": LEFT, "right": WIDTH - RIGHT}
FRAME |= {"top": TOP, "bottom": HEIGHT - BOTTOM}


@dataclass(frozen=True, kw_only=True)
class Row:
    """A case that is told by itself."""

    name: str
    outcome: str
    drawn: str
    discrepancy: str
    uncertainty: str
    error: str
    reason: str
    command: str


@dataclass(frozen=True, kw_only=True)
class Group:
    """The cases of a system in an engine and integrator."""

    system: str
    engine: str
    integrator: str
    counts: tuple[tuple[str, int], ...]
    digits: str
    error: str


@dataclass(frozen=True, kw_only=True)
class Page:
    """The page; `figures` are of one system each, with the marks of its engines."""

    title: str
    summary: str
    cost: str
    left: str
    command: str
    outcomes: tuple[Bar, ...]
    digits: tuple[Bar, ...]
    groups: tuple[Group, ...]
    figures: tuple[tuple[str, tuple[Mark, ...], tuple[Scatter, ...]], ...]
    rows: tuple[Row, ...]


def write_sweep(path: Path, found: SweepSummary) -> None:
    """Write the page."""
    write_whole(path, render_sweep(found))


def render_sweep(found: SweepSummary) -> str:
    """The page as HTML; the same rows give the same text."""
    return template("sweep.html", page=_page(found), frame=FRAME)


def _page(found: SweepSummary) -> Page:
    left = found.plan.cases - found.done
    systems = list(dict.fromkeys(one.system for one in found.groups))
    return Page(
        title=shown(f"Sweep of {', '.join(systems) or 'nothing'}"),
        summary=", ".join(f"{count} {name}" for name, count in found.outcomes.items()) or "no rows",
        cost=_cost(found),
        left=f"{counted(left, 'case')} not run yet" if left else "",
        command=shown(found.plan.command),
        outcomes=bars(found.outcomes),
        digits=bars(found.digits),
        groups=tuple(
            Group(
                system=shown(one.system),
                engine=shown(one.engine),
                integrator=shown(one.integrator),
                counts=tuple(one.outcomes.items()),
                digits=NOTHING if one.least_digits is None else f"{one.least_digits:.1f}",
                error=percent(one.worst_error),
            )
            for one in found.groups
        ),
        figures=tuple(_figures(found, system) for system in systems),
        rows=tuple(map(_row, found.worst)),
    )


def _cost(found: SweepSummary) -> str:
    if found.overhead is None:
        return ""
    return (
        f"{cost_line(found)}, of it"
        f" {found.reference_seconds / found.engine_seconds:.2f} for reference motions and"
        f" {found.loading_seconds / found.engine_seconds:.2f} for loading models"
    )


def _figures(found: SweepSummary, system: str) -> tuple[str, tuple[Mark, ...], tuple[Scatter, ...]]:
    """The error at the shipped step over each varied quantity of a system."""
    rows = [row for row in found.sampled if row.system == system]
    series = list(dict.fromkeys(f"{row.engine}, {row.integrator}" for row in rows))
    names = [name for name in found.plan.constants if any(name in row.constants for row in rows)]
    drawn = [scatter_of(rows, series, name) for name in names]
    if len({row.step for row in rows}) > 1:
        drawn.append(scatter_of(rows, series, ""))
    marks = tuple(mark(i, name) for i, name in enumerate(series))
    return shown(system), marks, tuple(one for one in drawn if one is not None)


def scatter_of(rows: list[SweepRow], series: list[str], name: str) -> Scatter | None:
    """Errors over a constant, or over the step where no name is given."""
    points = list(_points(rows, series, name))
    what = name or "the step"
    amiss = sum(p.outcome != Outcome.AGREES for p in points)
    ringed = f", {amiss} ringed that did not agree" if amiss else ""
    return scatter(
        f"Error at the shipped step over {what}",
        name or "step h [s]",
        points,
        f"{counted(len(points), 'case')}{ringed}; largest error"
        f" {percent(max((p.y for p in points), default=None))}.",
    )


def _points(rows: list[SweepRow], series: list[str], name: str) -> Iterator[Point]:
    for row in rows:
        x = row.constants.get(name) if name else row.step
        if x is None or row.global_error is None or row.outcome is Outcome.FAILED:
            continue
        number = series.index(f"{row.engine}, {row.integrator}")
        told = f"#{row.index} {row.name}: {percent(row.global_error)}"
        yield Point(x=x, y=row.global_error, series=number, outcome=row.outcome.value, told=told)


def _row(row: SweepRow) -> Row:
    drawn = [f"{name} = {value:.6g}" for name, value in row.constants.items()]
    return Row(
        name=shown(f"#{row.index} {row.name}"),
        outcome=row.outcome.value,
        drawn=shown(", ".join([row.integrator, quantity(row.step, "s"), *drawn])),
        discrepancy=sci(row.discrepancy),
        uncertainty=sci(row.uncertainty),
        error=percent(row.global_error),
        reason=shown(row.reason),
        command=shown(row.command),
    )
