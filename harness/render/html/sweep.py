"""A page on a sweep, in the report's style, without a script.

Scatter plots and bar charts as SVG, without a script.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.sweep import SweepRow, SweepSummary
from physics_crosscheck.harness.records.write import write_whole
from physics_crosscheck.harness.render.html import template
from physics_crosscheck.harness.render.html.text import NOTHING, percent, quantity, sci, shown
from physics_crosscheck.harness.render.terminal.sweep import cost_line
from physics_crosscheck.harness.results.messages import with_code
from physics_crosscheck.harness.results.status import counted

WIDTH, HEIGHT = 560.0, 300.0
LEFT_MARGIN, RIGHT, TOP, BOTTOM = 62.0, 12.0, 10.0, 42.0

COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#7a7a00", "#999999")
"""Colours of Okabe and Ito, safe for colour blindness; each series also has its own marker."""

MARKS = (
    "M-3,0a3,3 0 1 0 6,0a3,3 0 1 0 -6,0",
    "M-2.7,-2.7h5.4v5.4h-5.4z",
    "M0,-3.6L3.2,2.4H-3.2z",
    "M0,-3.8L3.8,0L0,3.8L-3.8,0z",
    "M-3.2,-2.4H3.2L0,3.6z",
)

MAX_DIGITS = 17
"""Digits that distinguish any two doubles."""

WIDE = 8.0
"""Ratio of the largest to the smallest value that makes an axis logarithmic."""


@dataclass(frozen=True, kw_only=True)
class Mark:
    """A series' marker, for its legend."""

    label: str
    colour: str
    path: str


@dataclass(frozen=True, kw_only=True)
class Tick:
    """A labelled value on an axis."""

    position: str
    label: str


@dataclass(frozen=True, kw_only=True)
class Scatter:
    """Points over a quantity.

    Attributes:
        title: quantities of both axes.
        x_label: label of the x axis.
        summary: description in words.
        points: (place, colour, path, outcome, description); a place is `x,y`.
        x_ticks, y_ticks: labelled values on the axes.
    """

    title: str
    x_label: str
    summary: str
    points: tuple[tuple[str, str, str, str, str], ...]
    x_ticks: tuple[Tick, ...]
    y_ticks: tuple[Tick, ...]


@dataclass(frozen=True, kw_only=True)
class Point:
    """A point: the number of its series, its outcome, and a description."""

    x: float
    y: float
    series: int
    outcome: str
    description: str


@dataclass(frozen=True)
class _Axis:
    low: float
    high: float
    log: bool

    @staticmethod
    def covering(values: Sequence[float], log: bool) -> _Axis:
        low, high = min(values), max(values)
        if log:
            low, high = math.log10(low), math.log10(high)
        margin = 0.04 * (high - low) or 0.5 * (abs(high) or 1.0)
        return _Axis(low - margin, high + margin, log)

    def share(self, value: float) -> float:
        """Return the position of a value, 0 to 1."""
        position = math.log10(value) if self.log else value
        return (position - self.low) / (self.high - self.low)

    def ticks(self) -> list[float]:
        """Return some round values."""
        span = self.high - self.low
        if self.log and span >= 2:
            every = max(1, math.ceil(span / 6))
            first = math.ceil(self.low)
            return [10.0**i for i in range(first, math.floor(self.high) + 1, every)]
        low, high = (10**self.low, 10**self.high) if self.log else (self.low, self.high)
        raw = (high - low) / 5
        unit = 10.0 ** math.floor(math.log10(raw))
        step = next(unit * k for k in (1, 2, 5, 10) if unit * k >= raw)
        count = math.floor(high / step) - math.ceil(low / step) + 1
        return [(math.ceil(low / step) + i) * step for i in range(count)]


def mark(number: int, label: str) -> Mark:
    """Return the marker of a series."""
    colour, path = COLOURS[number % len(COLOURS)], MARKS[number % len(MARKS)]
    return Mark(label=shown(label), colour=colour, path=path)


def scatter(title: str, x_label: str, points: Sequence[Point], summary: str) -> Scatter | None:
    """Draw points with a logarithmic y axis; None without points to draw."""
    drawable = [p for p in points if math.isfinite(p.x) and math.isfinite(p.y) and p.y > 0]
    if not drawable:
        return None
    xs = [p.x for p in drawable]
    across = _Axis.covering(xs, min(xs) > 0 and max(xs) / min(xs) >= WIDE)
    upward = _Axis.covering([p.y for p in drawable], True)
    return Scatter(
        title=shown(title),
        x_label=shown(x_label),
        summary=shown(summary),
        points=tuple(
            (
                f"{_x(across.share(p.x))},{_y(upward.share(p.y))}",
                COLOURS[p.series % len(COLOURS)],
                MARKS[p.series % len(MARKS)],
                p.outcome,
                shown(p.description),
            )
            for p in drawable
        ),
        x_ticks=tuple(
            Tick(position=_x(across.share(value)), label=label)
            for value, label in labelled(across.ticks(), "g")
        ),
        y_ticks=tuple(
            Tick(position=_y(upward.share(value)), label=label)
            for value, label in labelled(upward.ticks(), "e")
        ),
    )


def labelled(values: Sequence[float], form: str) -> Iterator[tuple[float, str]]:
    """Yield values with labels, in as few digits as distinguish them.

    Args:
        values: of the ticks, all different.
        form: `e` or `g`, as in a format specification.
    """
    first = 0 if form == "e" else 3
    for digits in range(first, MAX_DIGITS + 1):
        labels = [f"{value:.{digits}{form}}" for value in values]
        if len(set(labels)) == len(values):
            break
    yield from zip(values, labels, strict=True)


@dataclass(frozen=True, kw_only=True)
class Bar:
    """A count, as a share of the largest, in percent."""

    label: str
    count: int
    share: str
    kind: str = ""


def bars(counts: Mapping[str, int]) -> tuple[Bar, ...]:
    """Return counts as bars."""
    largest = max(counts.values(), default=1)
    return tuple(
        Bar(label=shown(name), count=count, share=f"{100 * count / largest:.1f}", kind=shown(name))
        for name, count in counts.items()
    )


def _x(share: float) -> str:
    return f"{LEFT_MARGIN + share * (WIDTH - LEFT_MARGIN - RIGHT):.1f}"


def _y(share: float) -> str:
    return f"{HEIGHT - BOTTOM - share * (HEIGHT - TOP - BOTTOM):.1f}"


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
