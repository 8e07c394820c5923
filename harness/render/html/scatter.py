"""Scatter plots and bar charts as SVG, without a script."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from physics_crosscheck.harness.render.html.text import shown

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
