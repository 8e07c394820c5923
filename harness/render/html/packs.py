"""Numbers and charts of one part of the page, packed: unpacked by the page when they are looked at.

JSON of rounded numbers, compressed, is smaller than their binary form: what a plot shows has three
to six digits.
"""

from __future__ import annotations

import base64
import gzip
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace

import msgspec
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Column:
    """Where numbers are: the id of a pack, and a key within it."""

    pack: str
    key: str


@dataclass(frozen=True, kw_only=True)
class Curve:
    """One curve; its role and its place among its kind say how it is drawn.

    Attributes:
        label: entry of the legend; curves of one label are shown and hidden together.
        role: how it is drawn, see `script/looks.js`.
        place: number among those of its role: its colour, dash and marker.
        x, y: its numbers; where values are signed and the axis is logarithmic, their size is drawn
            and their sign is told by the mark.
    """

    label: str
    role: str
    place: int
    x: Column
    y: Column


@dataclass(frozen=True, kw_only=True)
class Chart:
    """One plot.

    Attributes:
        part: heading under which it stands.
        title: what it shows.
        x_label, y_label: with units.
        curves: in drawing order.
        key: how to tell the curves apart.
        summary: what is to be seen, in words with numbers.
        log_x, log_y: which axes are logarithmic.
        dates: whether x is a date, in milliseconds since 1970-01-01 UTC.
        over_time: whether x is the time of the motion, shared with the other charts of the pack.
        y_limits: part of the y axis to show at first; None shows all.
        lead: whether it is shown at first, before all others of its pack.
        over_error: whether it shows errors.
        names: of the places on the y axis, where they are names: y counts them from 0.
    """

    part: str
    title: str
    x_label: str
    y_label: str
    curves: tuple[Curve, ...]
    key: str
    summary: str
    log_x: bool = False
    log_y: bool = False
    dates: bool = False
    over_time: bool = False
    over_error: bool = False
    lead: bool = False
    y_limits: tuple[float, float] | None = None
    names: tuple[str, ...] = ()


class Pack:
    """Columns of numbers under an id, to which charts of any pack may refer."""

    def __init__(self, identity: str) -> None:
        self.id = identity
        self._columns: dict[bytes, str] = {}

    def column(self, values: Sequence[float | None] | Array, digits: int) -> Column:
        """Keep numbers, with so many digits; the same numbers are kept once."""
        kept = [_rounded(value, digits) for value in np.asarray(values, dtype=float).tolist()]
        # As text, a quarter of what lists of floats take: a report of many cases has 60 M numbers.
        text = msgspec.json.encode(kept)
        return Column(pack=self.id, key=self._columns.setdefault(text, f"c{len(self._columns)}"))

    def packed(self, charts: Iterable[Chart] = (), **more: object) -> str:
        """The pack, with `more` beside it, as text that a script element may hold."""
        content: dict[str, object] = {
            "columns": {key: msgspec.Raw(text) for text, key in self._columns.items()},
            "charts": [self._record(chart) for chart in charts],
            **more,
        }
        return compressed(content)

    def _record(self, chart: Chart) -> dict[str, object]:
        curves = [
            {**asdict(curve), "x": self._reference(curve.x), "y": self._reference(curve.y)}
            for curve in chart.curves
        ]
        return {**asdict(replace(chart, curves=())), "curves": curves}

    def _reference(self, column: Column) -> str | tuple[str, str]:
        return column.key if column.pack == self.id else (column.pack, column.key)


def compressed(content: Mapping[str, object]) -> str:
    """JSON, compressed, in letters that no element ends with; the same content, the same text."""
    data = msgspec.json.encode(content)
    return base64.b64encode(gzip.compress(data, 6, mtime=0)).decode("ascii")


def _rounded(value: float, digits: int) -> float | None:
    return float(f"{value:.{digits}g}") if math.isfinite(value) else None
