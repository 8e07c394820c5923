"""Charts drawn by Bokeh, as the JSON that BokehJS embeds.

Bokeh takes a quarter of a second and 30 kB for the plots of one case, whose numbers are 15 kB, and
most cases look alike. So each look is drawn once, as a pattern with marks where a case has its own
texts and numbers; a case names its pattern and says what its marks stand for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from bokeh.document import Document
from bokeh.models import (
    BoxZoomTool,
    ColumnDataSource,
    DataRange1d,
    FixedTicker,
    GlyphRenderer,
    HoverTool,
    Legend,
    LegendItem,
    Line,
    PanTool,
    PrintfTickFormatter,
    Range1d,
    ResetTool,
    SaveTool,
    Scatter,
    WheelZoomTool,
)
from bokeh.plotting import figure
from bokeh.resources import Resources
from bokeh.themes import Theme

from harness.report.charts import Chart
from harness.report.marks import MarkedChart, MarkedCurve, is_mark, mark

INK, MUTED, GRID = "#010101", "#020202", "#030303"
"""Stand-ins: script.js puts the page's own colours there, light or dark, when it draws."""

BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9",
)  # fmt: skip
PALETTE = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
"""Okabe and Ito 2008, without black and yellow: one of the two grounds would swallow them."""

DASHES = ("solid", (7, 3), (2, 2), (7, 3, 2, 3))
MARKERS = ("circle", "square", "triangle", "diamond", "inverted_triangle", "hex")

ROUND_STEPS = [float(f"{m}e{k}") for k in range(-8, 2) for m in (1, 2, 5)]

STYLE = Theme(
    json={
        "attrs": {
            "Plot": {
                "height": 270, "sizing_mode": "stretch_width", "background_fill_alpha": 0.0,
                "border_fill_alpha": 0.0, "outline_line_color": GRID, "min_border_right": 12,
            },
            "Title": {"text_color": INK, "text_font_size": "13px", "text_font": "system-ui"},
            "Axis": {
                "axis_label_text_color": INK, "axis_label_text_font_style": "normal",
                "axis_label_text_font_size": "12px", "axis_label_text_font": "system-ui",
                "major_label_text_color": MUTED, "major_label_text_font": "system-ui",
                "axis_line_color": MUTED, "major_tick_line_color": MUTED,
                "minor_tick_line_color": None, "axis_label_standoff": 5,
            },
            "Grid": {"grid_line_color": GRID},
            "Legend": {
                "background_fill_alpha": 0.0, "border_line_alpha": 0.0, "label_text_color": INK,
                "label_text_font_size": "12px", "label_text_font": "system-ui", "padding": 0,
                "margin": 2, "label_standoff": 4, "glyph_width": 26,
                "click_policy": "hide", "orientation": "horizontal",
            },
        }
    }
)  # fmt: skip


def bokeh_script() -> str:
    """BokehJS, from the installed wheel: what plots need, without widgets and the like."""
    return str(Resources(mode="inline", components=["bokeh"]).js_raw[0])


@dataclass(frozen=True)
class Plots:
    """The plots of all cases.

    Attributes:
        patterns: Bokeh documents, with marks in them; their roots are the charts in order.
        cases: for each case the number of its pattern and the values of the marks in it.
    """

    patterns: tuple[Any, ...]
    cases: Mapping[str, Mapping[str, Any]]


def draw(charts_of: Mapping[str, Sequence[Chart]]) -> Plots:
    """Draw the charts of each case. The same charts give the same JSON."""
    numbers: dict[Any, int] = {}
    patterns: list[Any] = []
    cases = {}
    for case, charts in charts_of.items():
        marked, values = mark(charts)
        if marked not in numbers:
            numbers[marked] = len(patterns)
            patterns.append(_document(marked))
        cases[case] = {"pattern": numbers[marked], "values": values}
    return Plots(tuple(patterns), cases)


def _document(charts: Sequence[MarkedChart]) -> Any:
    """One document for all charts of a case, so that its time axes can be linked."""
    document = Document(theme=STYLE)
    time_range = DataRange1d(range_padding=0.02)
    for chart in charts:
        document.add_root(_figure(chart, time_range if chart.over_time else DataRange1d()))
    plain = _tidied(document.to_json(deferred=False), {})
    plain.pop("title")
    return plain


def _figure(chart: MarkedChart, x_range: Any) -> Any:
    limits = chart.y_limits
    plot = figure(
        title=chart.title, x_axis_label=chart.x_label, y_axis_label=chart.y_label,
        x_range=x_range, y_range=DataRange1d() if limits is None else Range1d(*limits),
        x_axis_type="log" if chart.log_x else "linear",
        y_axis_type="log" if chart.log_y else "linear", tools=[],
    )  # fmt: skip
    if chart.log_x:
        # Bokeh's own are spaced evenly, at the right end, over less than two decades.
        plot.xaxis.ticker = FixedTicker(ticks=ROUND_STEPS)
        plot.xaxis.formatter = PrintfTickFormatter(format="%g")
    items: dict[str, list[Any]] = {}
    sources: dict[str, Any] = {}
    for curve in chart.curves:
        # Curves over the same x share a source.
        source = sources.setdefault(curve.x, ColumnDataSource({"x": [curve.x]}))
        column = f"y{len(source.data)}"
        source.data[column] = [curve.y]
        for glyph in _glyphs(curve, column):
            drawn = plot.add_glyph(source, glyph, name=curve.name)
            items.setdefault(curve.label, []).append(drawn)
    legend = [LegendItem(label={"value": label}, renderers=r) for label, r in items.items()]
    # What converges has long names: a narrow screen has room for two in a row.
    columns, spacing = (2, 2) if chart.log_x else (4, 14)
    plot.add_layout(Legend(items=legend, ncols=columns, spacing=spacing), "below")
    drawn = [renderer for renderers in items.values() for renderer in renderers]
    plot.add_tools(*_tools(drawn, "t" if chart.over_time else "h"))
    plot.toolbar.logo = None
    plot.toolbar.autohide = True
    plot.toolbar.active_drag = plot.toolbar.tools[1]
    return plot


def _tools(drawn: list[GlyphRenderer], x: str) -> list[Any]:
    hover = HoverTool(
        renderers=drawn,
        tooltips=[("", "$name"), (x, "$snap_x{%.4g} s"), ("value", "$snap_y{%.3g}")],
        formatters={"$snap_x": "printf", "$snap_y": "printf"},
    )
    return [PanTool(), BoxZoomTool(), WheelZoomTool(), ResetTool(), SaveTool(), hover]


def _glyphs(curve: MarkedCurve, y: str) -> list[Any]:
    colour = PALETTE[curve.place % len(PALETTE)]
    dash = DASHES[curve.place % len(DASHES)]
    marker = MARKERS[curve.place % len(MARKERS)]
    match curve.role:
        case "reference":
            return [Line(x="x", y=y, line_color=SKY, line_width=5, line_alpha=0.6)]
        case "engine":
            return [Line(x="x", y=y, line_color=VERMILION, line_width=1.5, line_dash=(5, 3))]
        case "raw":
            return [Line(x="x", y=y, line_color=colour, line_width=1.6, line_dash=dash)]
        case "defect":
            return [Scatter(x="x", y=y, marker=marker, size=4, line_color=colour, fill_color=None)]
        case "uncertainty":
            return [Line(x="x", y=y, line_color=colour, line_width=0.8, line_alpha=0.8)]
        case "rungs":
            return _marked(y, BLUE, "circle", "solid")
        case "plain":
            return _marked(y, VERMILION, "square", (7, 3))
        case "draws":
            return _marked(y, GREEN, "triangle", (2, 2))
        case "guide":
            return [Line(x="x", y=y, line_color=INK, line_width=1.2, line_dash=(1, 3))]
    raise ValueError(f"no way to draw {curve.role!r} is known")


def _marked(y: str, colour: str, marker: str, dash: Any) -> list[Any]:
    return [
        Line(x="x", y=y, line_color=colour, line_width=1.4, line_dash=dash),
        Scatter(x="x", y=y, marker=marker, size=7, line_color=colour, fill_color=colour),
    ]


def _tidied(value: Any, names: dict[str, str]) -> Any:
    """The document with marks where it has columns, and ids counted from its beginning.

    Bokeh counts ids over the process.
    """
    if isinstance(value, list | tuple):
        if len(value) == 1 and is_mark(value[0]):
            return value[0]
        return [_tidied(item, names) for item in value]
    if not isinstance(value, dict):
        return value
    tidied = {}
    for key, item in value.items():
        if key == "id" and (len(value) == 1 or value.get("type") == "object"):
            tidied[key] = names.setdefault(item, str(len(names)))
        else:
            tidied[key] = _tidied(item, names)
    return tidied
