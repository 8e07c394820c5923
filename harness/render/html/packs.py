"""Packed numbers and charts for parts of the page, which unpacks them on demand.

Compressed JSON of rounded numbers is smaller than their binary form, since plots show three to six
digits.
"""

from __future__ import annotations

import base64
import gzip
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.records.base import rounded
from physics_crosscheck.harness.render.html.text import shown

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Column:
    """Location of numbers: the id of a pack, and a key in it."""

    pack: str
    key: str

    @property
    def address(self) -> tuple[str, str]:
        """Pack and key."""
        return self.pack, self.key


@dataclass(frozen=True)
class Curve:
    """A curve; its role and its place select colour and line style.

    Attributes:
        label: legend entry; curves with the same label are shown and hidden together.
        role: kind of curve, see `script/looks.js`.
        x, y: its numbers; on a logarithmic axis, signed values are drawn by magnitude with the sign
            as marker.
        place: number among those of its role, which selects colour, dash and marker.
    """

    label: str
    role: str
    x: Column
    y: Column
    place: int = 0


@dataclass(frozen=True, kw_only=True)
class Chart:
    """A plot.

    Attributes:
        part: heading above it; in a case, the name of its tab.
        title: quantity that it shows.
        x_label, y_label: labels with units.
        curves: curves in drawing order.
        key: how to distinguish the curves.
        summary: description in words with numbers.
        log_x, log_y: which axes are logarithmic.
        over_time: whether x is time, or a date, shared with the other charts of its part.
        y_limits: initial range of the y axis; None shows all.
        lead: whether it is shown first, with those of other parts.
        over_error: whether it shows errors.
        names: labels of the y axis for named rows, counted from 0.
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
    over_time: bool = False
    over_error: bool = False
    lead: bool = False
    y_limits: tuple[float, float] | None = None
    names: tuple[str, ...] = ()


class Pack:
    """Columns of numbers under an id, which charts of any pack can use."""

    def __init__(self, identity: str) -> None:
        self.id = identity
        self._columns: dict[bytes, str] = {}

    def column(self, values: Sequence[float | None] | Array, digits: int) -> Column:
        """Store numbers rounded to some digits; equal columns are stored once."""
        kept = rounded(np.asarray(values, dtype=float).tolist(), digits)
        # Text takes a quarter of a list of floats; a large report has 60 million numbers.
        text = msgspec.json.encode(kept)
        return Column(pack=self.id, key=self._columns.setdefault(text, f"c{len(self._columns)}"))

    def to_text(self, charts: Iterable[Chart] = (), **more: object) -> str:
        """Return the pack and `more` as text for a script element."""
        content: dict[str, object] = {
            "columns": {key: msgspec.Raw(text) for text, key in self._columns.items()},
            "charts": [self._record(chart) for chart in charts],
            **more,
        }
        return compressed(content)

    def _record(self, chart: Chart) -> dict[str, object]:
        """Return a chart with visible texts, and each column by its key in this or another pack."""
        curves = [
            {name: self._written(value) for name, value in vars(curve).items()}
            for curve in chart.curves
        ]
        texts = {name: self._written(value) for name, value in vars(chart).items()}
        return {**texts, "names": list(map(shown, chart.names)), "curves": curves}

    def _written(self, value: object) -> object:
        if isinstance(value, Column):
            return value.key if value.pack == self.id else value.address
        return shown(value) if isinstance(value, str) else value


def compressed(content: Mapping[str, object]) -> str:
    """Compress JSON to safe letters; the same content gives the same text."""
    data = msgspec.json.encode(content)
    return base64.b64encode(gzip.compress(data, 6, mtime=0)).decode("ascii")
