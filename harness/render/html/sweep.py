"""A page on a sweep, in the report's style, without a script.

Scatter plots, parallel coordinates and bar charts as SVG.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
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

PARALLEL_WIDTH, PARALLEL_LEFT, PARALLEL_SPAN = 1120.0, 62.0, 1000.0
"""Width of parallel coordinates, the first axis, and the distance to the last one."""

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

SMALLEST_PLAIN, LARGEST_PLAIN = 1e-3, 1e5
"""Range of numbers without a power of ten."""

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

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
        """Return some round values: powers of ten, their multiples by 1, 2 and 5, or even steps."""
        decades = range(math.floor(self.low), math.floor(self.high) + 1) if self.log else ()
        if self.log and self.high - self.low >= 2:
            every = max(1, math.ceil((self.high - self.low) / 6))
            powers = [i for i in decades if i >= self.low and i % every == 0]
            if len(powers) > 1:
                return [float(f"1e{i}") for i in powers]
        low, high = (10**self.low, 10**self.high) if self.log else (self.low, self.high)
        round_values = [float(f"{factor}e{i}") for i in decades for factor in (1, 2, 5)]
        within = [value for value in round_values if low <= value <= high]
        if len(within) > 2:
            return within
        raw = (high - low) / 5
        unit = 10.0 ** math.floor(math.log10(raw))
        step = next(unit * k for k in (1, 2, 5, 10) if unit * k >= raw)
        count = math.floor(high / step) - math.ceil(low / step) + 1
        return [(math.ceil(low / step) + i) * step for i in range(count)]


def _axis(values: Sequence[float]) -> _Axis:
    """Return the axis of a varied quantity, logarithmic for a wide range."""
    return _Axis.covering(values, min(values) > 0 and max(values) / min(values) >= WIDE)


def mark(number: int, label: str) -> Mark:
    """Return the marker of a series."""
    colour, path = COLOURS[number % len(COLOURS)], MARKS[number % len(MARKS)]
    return Mark(label=shown(label), colour=colour, path=path)


def scatter(title: str, x_label: str, points: Sequence[Point], summary: str) -> Scatter | None:
    """Draw points with a logarithmic y axis; None without points to draw."""
    drawable = [p for p in points if math.isfinite(p.x) and math.isfinite(p.y) and p.y > 0]
    if not drawable:
        return None
    across = _axis([p.x for p in drawable])
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
        x_ticks=_ticks(across, _x),
        y_ticks=_ticks(upward, _y),
    )


def tick_labels(values: Sequence[float]) -> list[str]:
    """Return labels in as few digits as are exact, and with powers of ten for tiny or huge values.

    Args:
        values: of the ticks, ascending and all different.
    """
    apart = min((b - a for a, b in pairwise(values)), default=abs(values[0]) if values else 0.0)
    for digits in range(1, MAX_DIGITS + 1):
        labels = [f"{value:.{digits - 1}e}" for value in values]
        exact = zip(values, labels, strict=True)
        if all(abs(float(label) - value) <= 1e-6 * apart for value, label in exact):
            break
    if all(value == 0 or SMALLEST_PLAIN <= abs(value) < LARGEST_PLAIN for value in values):
        return [
            f"{float(label):.{digits}g}"
            if abs(float(label)) < 10**digits
            else f"{float(label):.0f}"
            for label in labels
        ]
    return [_power(label) for label in labels]


def _power(label: str) -> str:
    """Write a number such as 2.0e-09 with a power of ten, and ten to a power without factor."""
    factor, _, exponent = label.partition("e")
    if not float(factor):
        return "0"
    power = f"10{str(int(exponent)).translate(SUPERSCRIPTS)}"
    return power if factor == "1" else f"{factor}×{power}"


def _ticks(axis: _Axis, position: Callable[[float], str]) -> tuple[Tick, ...]:
    values = axis.ticks()
    return tuple(
        Tick(position=position(axis.share(value)), label=label)
        for value, label in zip(values, tick_labels(values), strict=True)
    )


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
FRAME |= {"top": TOP, "bottom": HEIGHT - BOTTOM, "parallel": PARALLEL_WIDTH}


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
class ParallelAxis:
    """A vertical axis of parallel coordinates."""

    label: str
    position: str
    ticks: tuple[Tick, ...]


@dataclass(frozen=True, kw_only=True)
class Parallel:
    """All varied quantities of the cases at once, each case a line through one axis each.

    Attributes:
        summary: description in words.
        axes: varied quantities, then the plotted one.
        lines: (path, colour, outcome, description), cases that agree first.
    """

    summary: str
    axes: tuple[ParallelAxis, ...]
    lines: tuple[tuple[str, str, str, str], ...]


@dataclass(frozen=True, kw_only=True)
class Figures:
    """Plots of a system's cases over each varied quantity, and over all of them."""

    system: str
    what: str
    marks: tuple[Mark, ...]
    pictures: tuple[Scatter, ...]
    parallel: Parallel | None


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
    series = list(dict.fromkeys(map(_series, rows)))
    names = [
        name for name in sweep_summary.plan.constants if any(name in row.constants for row in rows)
    ]
    if len({row.step for row in rows}) > 1:
        names.append("")
    drawn = [scatter_of(rows, series, name, what) for name in names]
    return Figures(
        system=shown(system),
        what=what.what,
        marks=tuple(mark(i, name) for i, name in enumerate(series)),
        pictures=tuple(one for one in drawn if one is not None),
        parallel=parallel(rows, series, names, what) if len(names) > 1 else None,
    )


def parallel(
    rows: Sequence[SweepRow], series: Sequence[str], names: Sequence[str], what: PlottedQuantity
) -> Parallel | None:
    """Draw cases as lines through parallel axes; None without a case with all values.

    Args:
        rows: the cases.
        series: engines with integrators, which select the colour.
        names: varied constants; an empty name is the time step.
        what: quantity of the last axis, logarithmic.
    """
    cases = []
    for row in rows:
        values = [*(_varied(row, name) for name in names), what.value_of(row)]
        finite = [one for one in values if one is not None and math.isfinite(one)]
        if len(finite) == len(values) and finite[-1] > 0 and row.outcome is not Outcome.FAILED:
            cases.append((row, finite))
    if not cases:
        return None
    columns = list(zip(*(values for _, values in cases), strict=True))
    axes = [*map(_axis, columns[:-1]), _Axis.covering(columns[-1], True)]
    places = [PARALLEL_LEFT + i * PARALLEL_SPAN / len(names) for i in range(len(axes))]
    cases.sort(key=lambda case: case[0].outcome is not Outcome.AGREES)
    return Parallel(
        summary=f"{counted(len(cases), 'case')}; each line is one case.",
        axes=tuple(
            ParallelAxis(label=shown(label), position=f"{x:.1f}", ticks=_ticks(axis, _y))
            for label, axis, x in zip(
                [*(name or "step h [s]" for name in names), what.what], axes, places, strict=True
            )
        ),
        lines=tuple(
            (
                "M"
                + "L".join(
                    f"{x:.1f},{_y(axis.share(value))}"
                    for x, axis, value in zip(places, axes, values, strict=True)
                ),
                COLOURS[series.index(_series(row)) % len(COLOURS)],
                row.outcome.value,
                shown(f"#{row.index} {row.name}: {what.format_value(values[-1])}"),
            )
            for row, values in cases
        ),
    )


def _series(row: SweepRow) -> str:
    return f"{row.engine}, {row.integrator}"


def _varied(row: SweepRow, name: str) -> float | None:
    """Return the value of a constant, or the time step if no name is given."""
    return row.constants.get(name) if name else row.step


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
        x, y = _varied(row, name), what.value_of(row)
        if x is None or y is None or row.outcome is Outcome.FAILED:
            continue
        number = series.index(_series(row))
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
