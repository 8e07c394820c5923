"""HTML for notebooks, for light and dark pages: inline styles only, and no script.

Text and rules inherit the page's colour. A badge has its own background colour and states the
outcome in words.
"""

import math
from collections.abc import Iterable, Sequence
from html import escape
from typing import TextIO

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.reference.mechanism.numeric import Array

Indices = NDArray[np.intp]

GROUNDS = {
    Outcome.AGREES: "#176f2c", Outcome.ABSENT: "#6b5900", Outcome.REFUSED: "#6b5900",
    Outcome.UNRESOLVED: "#7a3a9a",
    Outcome.DIFFERS: "#b42318", Outcome.FAILED: "#7a0c1e",
}  # fmt: skip
"""Background colours of badges; white text has a contrast of at least 6."""

_CELL = "padding:2px 10px;border:0;border-bottom:1px solid rgba(128,128,128,.35);"
_LEFT_ALIGNED, _RIGHT = "text-align:left;", "text-align:right;font-variant-numeric:tabular-nums;"
_LINE = "#3d7fc1"
"""Line colour with a contrast of at least 4 on white and on black."""

WIDTH, HEIGHT = 240, 34
"""Size of a small curve, pixels."""

_BUCKETS = 120


def paper(text: TextIO, width: int) -> Console:
    """Return a console that writes plain text; rich would write into the notebook's cell."""
    return Console(file=text, width=width, color_system=None, emoji=False, force_jupyter=False)


def badge(outcome: Outcome) -> str:
    """Return an outcome as white text on its colour."""
    style = (
        f"background:{GROUNDS[outcome]};color:#fff;padding:1px 7px;border-radius:9px;"
        "font-size:85%;font-weight:600;white-space:nowrap"
    )
    return f'<span style="{style}">{outcome}</span>'


def block(*parts: str) -> str:
    """Stack parts of a page."""
    return f'<div class="crosscheck" style="max-width:100%;overflow-x:auto">{"".join(parts)}</div>'


def line(text: str, *, strong: bool = False, faint: bool = False) -> str:
    """Return a line of text, escaped."""
    style = "margin:4px 0;" + ("font-weight:600;" if strong else "")
    style += "opacity:.75;" if faint else ""
    return f'<div style="{style}">{escape(text)}</div>'


def table(heads: Sequence[str], rows: Iterable[Sequence[str]], text_columns: int = 1) -> str:
    """Return a table of HTML cells; the first columns are left-aligned, the others right-aligned.

    Args:
        heads: headings, escaped here.
        rows: cells.
        text_columns: number of columns with text.
    """

    def cells(tag: str, row: Sequence[str]) -> str:
        right = _RIGHT + ("white-space:nowrap;" if tag == "td" else "")
        sides = (_LEFT_ALIGNED if i < text_columns else right for i in range(len(row)))
        return "".join(
            f'<{tag} style="{_CELL}{side}">{cell}</{tag}>'
            for side, cell in zip(sides, row, strict=True)
        )

    head = f"<thead><tr>{cells('th', [escape(one) for one in heads])}</tr></thead>"
    body = "".join(f'<tr style="background:none">{cells("td", row)}</tr>' for row in rows)
    style = "border-collapse:collapse;border:0;margin:4px 0;font-size:inherit"
    # Documentation themes widen the cells of tables without a class, until they are cut.
    return f'<table class="crosscheck" style="{style}">{head}<tbody>{body}</tbody></table>'


def shown(value: float | None, form: str = "{:.4g}") -> str:
    """Format a number; a dash if it is missing."""
    return "–" if value is None or not math.isfinite(value) else form.format(value)


def curve(t: Array, values: Array, description: str, noise: float = 0.0) -> str:
    """Return a small curve, (n,) over (n,), as SVG, with gaps at values that are not finite.

    For many points, the smallest and the largest of each stretch are drawn, so that no oscillation
    is lost.

    Args:
        t, values: coordinates of the points.
        description: text for screen readers.
        noise: a curve with a smaller range is drawn as constant.
    """
    finite = np.isfinite(values)
    if not finite.any():
        return ""
    low, high = float(np.min(values[finite])), float(np.max(values[finite]))
    still = high - low <= noise
    span, middle = (math.inf, 0.5) if still else (high - low, 0.0)
    width = float(t[-1] - t[0]) or 1.0

    def place(i: int) -> str:
        x = 2 + (WIDTH - 4) * float(t[i] - t[0]) / width
        y = HEIGHT - 3 - (HEIGHT - 6) * ((float(values[i]) - low) / span + middle)
        return f"{x:.1f},{y:.1f}"

    drawn = []
    for stretch in _stretches(finite):
        points = " ".join(place(i) for i in _extremes(values, stretch))
        drawn.append(
            f'<polyline points="{points}" fill="none" stroke="{_LINE}" stroke-width="1.3"/>'
        )
    return (
        f'<svg role="img" aria-label="{escape(description)}" width="{WIDTH}" height="{HEIGHT}"'
        f' viewBox="0 0 {WIDTH} {HEIGHT}">{"".join(drawn)}</svg>'
    )


def _stretches(finite: NDArray[np.bool_]) -> list[Indices]:
    indices = np.flatnonzero(finite)
    return [s for s in np.split(indices, np.flatnonzero(np.diff(indices) > 1) + 1) if len(s) > 1]


def _extremes(values: Array, stretch: Indices) -> list[int]:
    """Return ascending indices of the points of a stretch that a curve of this size can show."""
    if len(stretch) <= 2 * _BUCKETS:
        return [int(i) for i in stretch]
    kept = {int(stretch[0]), int(stretch[-1])}
    for part in np.array_split(stretch, _BUCKETS):
        kept |= {int(part[np.argmin(values[part])]), int(part[np.argmax(values[part])])}
    return sorted(kept)
