"""A page on a sweep, in the report's style, without a script.

Scatter plots, parallel coordinates and bar charts as SVG.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.sweep import SweepRow, SweepSummary
from physics_crosscheck.harness.records.write import write_whole
from physics_crosscheck.harness.render.html import template
from physics_crosscheck.harness.render.html.text import percent, sci
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

    def labelled(self) -> list[tuple[float, str]]:
        """Return the positions of some values, 0 to 1, with their labels."""
        values = self.ticks()
        return list(zip(map(self.share, values), tick_labels(values), strict=True))

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


def _x(share: float) -> str:
    return f"{LEFT_MARGIN + share * (WIDTH - LEFT_MARGIN - RIGHT):.1f}"


def _y(share: float) -> str:
    return f"{HEIGHT - BOTTOM - share * (HEIGHT - TOP - BOTTOM):.1f}"


FRAME = {"width": WIDTH, "height": HEIGHT, "left": LEFT_MARGIN, "right": WIDTH - RIGHT}
FRAME |= {"top": TOP, "bottom": HEIGHT - BOTTOM, "parallel": PARALLEL_WIDTH}

Drawn = tuple[SweepRow, tuple[float, ...]]
"""A case with its values of varied quantities and of the plotted one."""


@dataclass(frozen=True, kw_only=True)
class Figures:
    """Plots of a system's cases over each varied quantity, and over all of them.

    Attributes:
        system: name of the system.
        rows: its cases.
        names: varied constants; an empty name is the time step.
    """

    system: str
    rows: Sequence[SweepRow]
    names: Sequence[str]

    @property
    def series(self) -> list[str]:
        """Engines with integrators, which select colour and marker."""
        return list(dict.fromkeys(map(series_of, self.rows)))

    @property
    def at_step(self) -> bool:
        """True if the plots show the error at dt, which robot states do not have."""
        return any(row.global_error is not None for row in self.rows)

    @property
    def what(self) -> str:
        """Name of the plotted quantity."""
        return "error at dt" if self.at_step else "larger of E and U"

    def written(self, value: float) -> str:
        """Format a value of the plotted quantity."""
        return percent(value) if self.at_step else sci(value)

    def cases(self, names: Sequence[str]) -> list[Drawn]:
        """Return the cases with values of all these quantities and of the plotted one."""
        cases = []
        for row in self.rows:
            errors = (row.global_error,) if self.at_step else (row.discrepancy, row.uncertainty)
            values = [row.constants.get(name) if name else row.step for name in names]
            values.append(max((one for one in errors if one is not None), default=None))
            finite = tuple(one for one in values if one is not None and math.isfinite(one))
            is_whole = len(finite) == len(values) and finite[-1] > 0
            if is_whole and row.outcome is not Outcome.FAILED:
                cases.append((row, finite))
        return sorted(cases, key=lambda case: len(names) > 1 and not _agrees(case))

    @property
    def pictures(self) -> list[tuple[str, list[Drawn]]]:
        """Each varied quantity with the cases to plot over it; none without a case."""
        return [(name, cases) for name in self.names if (cases := self.cases([name]))]

    def axes(self, cases: Sequence[Drawn]) -> list[_Axis]:
        """Return the axes of cases; the last one, of the plotted quantity, is logarithmic."""
        columns = list(zip(*(values for _, values in cases), strict=True))
        return [*map(_axis, columns[:-1]), _Axis.covering(columns[-1], True)]

    def summary(self, cases: Sequence[Drawn]) -> str:
        """Return how many cases a plot shows, how many did not agree, and the largest value."""
        amiss = sum(not _agrees(case) for case in cases)
        ringed = f", {amiss} that did not agree (ringed)" if amiss else ""
        largest = self.written(max(values[-1] for _, values in cases))
        return f"{counted(len(cases), 'case')}{ringed}; {largest} at most."


def _agrees(case: Drawn) -> bool:
    return case[0].outcome is Outcome.AGREES


def series_of(row: SweepRow) -> str:
    """Return the engine and the integrator of a case."""
    return f"{row.engine}, {row.integrator}"


def write_sweep(path: Path, sweep_summary: SweepSummary) -> None:
    """Write the page."""
    write_whole(path, render_sweep(sweep_summary))


def render_sweep(sweep_summary: SweepSummary) -> str:
    """Return the page as HTML; the same rows give the same text."""
    systems = list(dict.fromkeys(one.system for one in sweep_summary.groups))
    remaining = sweep_summary.plan.cases - sweep_summary.done
    return template(
        "sweep.html",
        title=f"Sweep of {', '.join(systems) or 'nothing'}",
        sweep=sweep_summary,
        cost=_cost(sweep_summary),
        not_run=f"{counted(remaining, 'case')} not run yet" if remaining else "",
        figures=[_figures(sweep_summary, system) for system in systems],
        frame=FRAME,
        colours=COLOURS,
        marks=MARKS,
        x=_x,
        y=_y,
        places=lambda count: [PARALLEL_LEFT + i * PARALLEL_SPAN / count for i in range(count + 1)],
        series_of=series_of,
        with_code=with_code,
    )


def _figures(sweep_summary: SweepSummary, system: str) -> Figures:
    rows = [row for row in sweep_summary.sampled if row.system == system]
    constants = sweep_summary.plan.constants
    names = [name for name in constants if any(name in row.constants for row in rows)]
    if len({row.step for row in rows}) > 1:
        names.append("")
    return Figures(system=system, rows=rows, names=names)


def _cost(sweep_summary: SweepSummary) -> str:
    if sweep_summary.overhead is None:
        return ""
    return (
        f"{cost_line(sweep_summary)}, of it"
        f" {sweep_summary.reference_seconds / sweep_summary.engine_seconds:.2f} for reference"
        f" motions and {sweep_summary.loading_seconds / sweep_summary.engine_seconds:.2f} for"
        " loading models"
    )
