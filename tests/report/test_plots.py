"""The Bokeh JSON of the plots."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from harness.report.charts import Chart
from harness.report.marks import is_mark
from harness.report.plots import Plots, draw
from harness.report.view import report


@pytest.fixture(scope="module")
def drawn(troubled: dict[str, Any]) -> Plots:
    return draw({case.plots: case.charts for case in report(troubled).cases if case.charts})


def filled(plots: Plots, case: str) -> Any:
    """A case's document as script.js makes it: marks replaced by what they stand for."""
    values = plots.cases[case]["values"]

    def fill(value: Any) -> Any:
        if is_mark(value):
            return values[int(value[2:])]
        if isinstance(value, dict):
            return {k: fill(v) for k, v in value.items()}
        return [fill(v) for v in value] if isinstance(value, list) else value

    return fill(json.loads(json.dumps(plots.patterns[plots.cases[case]["pattern"]])))


def objects(value: Any, name: str) -> Iterator[Any]:
    if isinstance(value, dict):
        if value.get("name") == name and value.get("type") == "object":
            yield value
        for item in value.values():
            yield from objects(item, name)
    elif isinstance(value, list):
        for item in value:
            yield from objects(item, name)


def column(value: Any) -> Any:
    raw = gzip.decompress(base64.b64decode(value["array"]["data"]))
    return np.frombuffer(raw, dtype=value["dtype"]).reshape(value["shape"])


def columns(document: Any) -> list[dict[str, Any]]:
    """The columns of every source, figure by figure."""
    return [
        {name: column(value) for name, value in source["attributes"]["data"]["entries"]}
        for root in document["roots"]
        for source in objects(root, "ColumnDataSource")
    ]


def test_the_json_of_a_case_holds_its_series(drawn: Plots, troubled: dict[str, Any]) -> None:
    record = troubled["cases"][0]
    series = record["series"]
    motion, raw, defects, segments, limit, whole, _ = columns(filled(drawn, "plots-0"))
    for values, expected in (
        (motion["x"], series["t"]),
        (motion["y1"], series["reference"][0]),
        (motion["y2"], series["engine"][0]),
        (defects["x"], series["segment_t"]),
        (defects["y1"], series["defect_uncertainty"][0]),
        (defects["y2"], np.abs(series["defect"][0])),
        (defects["y4"], np.abs(series["defect"][1])),
        (segments["x"], series["convergence"]["h"]),
        (segments["y1"], series["convergence"]["raw"]),
        (limit["x"], series["convergence"]["h"][1:]),
        (limit["y1"], series["convergence"]["draws"]),
        (whole["x"], series["plain"]["h"]),
        (whole["y1"], series["plain"]["error"]),
    ):
        np.testing.assert_allclose(values, expected, rtol=2e-7)
    amplitude = np.max(np.abs(series["reference"][0]))
    np.testing.assert_allclose(raw["y1"][1:], np.abs(series["error"][0])[1:] / amplitude, rtol=2e-7)


def test_a_zero_has_no_place_on_a_logarithmic_axis(drawn: Plots, troubled: dict[str, Any]) -> None:
    assert troubled["cases"][0]["series"]["error"][0][0] == 0.0
    assert np.isnan(columns(filled(drawn, "plots-0"))[1]["y1"][0])


def test_values_beyond_single_precision_and_missing_ones_leave_gaps(drawn: Plots) -> None:
    engine = columns(filled(drawn, "plots-4"))[0]["y2"]
    assert np.isfinite(engine[:80]).all()
    assert np.isnan(engine[100:]).all()
    assert not np.isinf(engine).any()


def test_cases_that_look_alike_share_one_pattern(agreeing: dict[str, Any]) -> None:
    plots = draw({case.plots: case.charts for case in report(agreeing).cases})
    # One for systems of one coordinate, one for those of two.
    assert len(plots.patterns) == 2
    assert len(plots.cases) == len(agreeing["cases"])


def test_every_mark_has_a_value(drawn: Plots) -> None:
    for case in drawn.cases:
        assert "@@" not in json.dumps(filled(drawn, case))


def test_every_curve_has_data_and_every_component_a_form_of_its_own(drawn: Plots) -> None:
    document = filled(drawn, "plots-9")
    errors = document["roots"][-2]
    lines = [r["attributes"] for r in objects(errors, "GlyphRenderer")]
    told = [line["name"] for line in lines]
    assert sorted(told) == sorted(
        f"{c}, {kind}"
        for c in ("q0", "q1", "q0_dot", "q1_dot")
        for kind in ("raw error", "defect", "uncertainty")
    )
    raw = [x["glyph"]["attributes"] for x in lines if x["name"].endswith("raw error")]
    assert len({json.dumps(glyph.get("line_dash")) for glyph in raw}) == 4
    marks = [x["glyph"]["attributes"] for x in lines if x["name"].endswith("defect")]
    assert len({json.dumps(glyph.get("marker")) for glyph in marks}) == 4


def test_figures_over_time_share_their_time_axis(drawn: Plots) -> None:
    roots = filled(drawn, "plots-9")["roots"]
    ranges = [root["attributes"]["x_range"]["id"] for root in roots]
    assert ranges[0] == ranges[1] == ranges[2] != ranges[3]


def test_text_that_looks_like_tex_is_not_given_to_bokeh_as_such() -> None:
    for name in ("$$x$$", "\\[x\\]", "\\(x\\)"):
        chart = Chart(name, name, name, False, False, True, (), None, "", "")
        values = draw({"plots-0": (chart,)}).cases["plots-0"]["values"]
        assert values
        assert not any(opening in value for value in values for opening in ("$$", "\\[", "\\("))


def test_an_unknown_role_is_an_error_and_not_an_empty_plot(troubled: dict[str, Any]) -> None:
    chart = report(troubled).cases[0].charts[0]
    odd = replace(chart, curves=(replace(chart.curves[0], role="ghost"),))
    with pytest.raises(ValueError, match="no way to draw 'ghost'"):
        draw({"plots-0": (odd,)})
