"""Charts with marks for the texts and numbers that are a case's own.

Charts that look alike are equal once marked, so that one drawing serves all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from bokeh.core.serialization import Serializer

from harness.report.charts import Chart
from reference.numeric import Array


@dataclass(frozen=True)
class MarkedCurve:
    """A curve, all but its role and place as marks."""

    label: str
    name: str
    role: str
    place: int
    x: str
    y: str


@dataclass(frozen=True)
class MarkedChart:
    """A chart, its texts as marks."""

    title: str
    x_label: str
    y_label: str
    log_x: bool
    log_y: bool
    over_time: bool
    curves: tuple[MarkedCurve, ...]
    y_limits: tuple[float, float] | None


def mark(charts: Sequence[Chart]) -> tuple[tuple[MarkedChart, ...], list[Any]]:
    """Charts with marks, and the values of the marks: `@@0` stands for the first, and so on.

    Equal values have the same mark.
    """
    values: list[Any] = []
    known: dict[Any, str] = {}

    def text(value: str) -> str:
        return _noted(known, values, value, _not_tex(value))

    def column(row: Array, log: bool) -> str:
        single = _single(row, log)
        # Encoded as Bokeh does it: compressed, which is half the size of digits.
        return _noted(known, values, single.tobytes(), Serializer(deferred=False).encode(single))

    marked = tuple(
        MarkedChart(
            text(chart.title), text(chart.x_label), text(chart.y_label), chart.log_x, chart.log_y,
            chart.over_time,
            tuple(
                MarkedCurve(
                    text(curve.label), text(curve.name), curve.role, curve.place,
                    column(curve.x, chart.log_x), column(curve.y, chart.log_y),
                )
                for curve in chart.curves
            ),
            chart.y_limits,
        )
        for chart in charts
    )  # fmt: skip
    return marked, values


def is_mark(value: object) -> bool:
    """Whether a value in a drawing is a mark."""
    return isinstance(value, str) and value.startswith("@@")


def _noted(known: dict[Any, str], values: list[Any], key: Any, value: Any) -> str:
    if key not in known:
        known[key] = f"@@{len(values)}"
        values.append(value)
    return known[key]


def _single(values: Array, log: bool) -> Any:
    """Single precision holds every digit that results.json has; nan where an axis has no place."""
    large = np.abs(values) > np.finfo(np.float32).max
    kept = np.where(large, np.nan, values).astype(np.float32)
    if log:
        kept[~(kept > 0)] = np.nan
    return kept


def _not_tex(text: str) -> str:
    """Text that Bokeh does not take for TeX: it would ask the network for MathJax."""
    for opening in ("$$", "\\[", "\\("):
        text = text.replace(opening, f"{opening[0]}\u2060{opening[1]}")
    return text
