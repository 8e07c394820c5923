"""Plots: ticks, thinned curves, zooming, panning, and saved files."""

import json
import math
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import fromstring

import numpy as np
import pytest

from physics_crosscheck.harness.render import html as report
from tests.report.chromium import Browser, Tab
from tests.report.page import Page
from tests.report.samples import results
from tests.report.steps import (
    BOTH,
    BUILT,
    CASE,
    DIAGNOSIS,
    PLOTS,
    TALL,
    needs_browser,
    show_first_plot,
)
from tests.report.test_browser import RANGES, TIPS, box

pytestmark = needs_browser

SCRIPT = Path(report.__file__).with_name("script")
WIDTH = 600


@pytest.fixture(scope="module")
def drawing(browser: Browser) -> Iterator[Tab]:
    """Return a blank page with the functions that draw plots."""
    with browser.tab() as tab:
        source = "".join((SCRIPT / f"{name}.js").read_text("utf-8") for name in ("axes", "plots"))
        tab.run(f"{source};null")
        yield tab


def ticks(drawing: Tab, kind: str, low: float, high: float, room: int = 60) -> dict[str, float]:
    """Return labels and values of the ticks of a 600-pixel axis with labels of some width."""
    pairs = drawing.run(
        f"""(() => {{ const axis = new Axis({kind!r}, new Range({low}, {high}));
        axis.length = {WIDTH};
        return axis.ticks((at) => [at - {room / 2}, at + {room / 2}])
          .map(({{value, label}}) => [label, value]); }})()"""
    )
    assert len({label for label, _ in pairs}) == len(pairs), "a label is repeated"
    assert all(low <= value <= high for _, value in pairs)
    return dict(pairs)


@pytest.mark.parametrize(
    ("low", "high", "labels"),
    [
        (0, 10, "0 2 4 6 8 10"),
        (-0.12, 12.12, "0 2 4 6 8 10 12"),
        (-1.05, 1.05, "−1.0 −0.5 0.0 0.5 1.0"),
        (0, 1, "0.0 0.2 0.4 0.6 0.8 1.0"),
        (9.9996, 10.0001, "9.9996 9.9997 9.9998 9.9999 10.0000 10.0001"),
        (0, 3e-7, "0 5×10⁻⁸ 1.0×10⁻⁷ 1.5×10⁻⁷ 2.0×10⁻⁷ 2.5×10⁻⁷ 3.0×10⁻⁷"),
        (-2e6, 2e6, "−2×10⁶ −1×10⁶ 0 10⁶ 2×10⁶"),
    ],
)
def test_linear_ticks_are_round_numbers(drawing: Tab, low: float, high: float, labels: str) -> None:
    drawn = ticks(drawing, "linear", low, high, room=75)
    assert list(drawn) == labels.split()
    for label, value in drawn.items():
        digits = label.replace("−", "-").translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))
        head, _, raised = digits.partition("×10")
        if digits == "106":
            head, raised = "1", "6"
        assert float(head) * 10.0 ** int(raised or 0) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    ("low", "high", "labels"),
    [
        (8e-4, 0.03, "0.001 0.002 0.005 0.01 0.02"),
        (2e-9, 4e-8, "2×10⁻⁹ 5×10⁻⁹ 10⁻⁸ 2×10⁻⁸"),
        (0.5, 2e4, "1 10 100 1000 10000"),
        (5e-14, 2e-3, "10⁻¹² 10⁻¹⁰ 10⁻⁸ 10⁻⁶ 10⁻⁴"),
        (1e-16, 1e16, "10⁻¹⁶ 10⁻¹² 10⁻⁸ 10⁻⁴ 10⁰ 10⁴ 10⁸ 10¹² 10¹⁶"),
        (1.02, 1.95, "1.2 1.4 1.6 1.8"),
    ],
)
def test_logarithmic_ticks_are_decades_or_one_two_and_five(
    drawing: Tab, low: float, high: float, labels: str
) -> None:
    assert list(ticks(drawing, "log", low, high)) == labels.split()


@pytest.mark.parametrize("decades", [0.1, 0.5, 1, 1.5, 2, 3, 7, 15, 40, 300])
def test_logarithmic_labels_do_not_overlap(drawing: Tab, decades: float) -> None:
    for room in (24, 60, 110):
        low, high = 3e-160, 3e-160 * 10**decades
        drawn = list(ticks(drawing, "log", low, high, room).values())
        places = np.array([math.log10(value / low) / decades * WIDTH for value in drawn])
        assert 2 <= len(drawn) <= WIDTH / room + 1
        assert np.all(np.diff(places) >= room - 1e-6)


def test_thinned_curve_keeps_extremes_in_every_pixel_column(drawing: Tab) -> None:
    rng = np.random.default_rng(5)
    x = np.linspace(-50.0, WIDTH + 50.0, 40_000)
    y = rng.normal(size=x.size).cumsum()
    y[20_000] = 1e4
    y[30_000:30_010] = np.nan
    given = json.dumps([x.tolist(), [None if math.isnan(v) else v for v in y]])
    kept = drawing.run(
        f"""(() => {{ const [x, y] = {given}.map((row) => row.map((value) => value ?? NaN));
        return thinned(x, y, {WIDTH}); }})()"""
    )
    indices = np.array([i for i in kept if i >= 0])
    assert np.all(np.diff(indices) > 0), "in the order of the curve"
    assert len(indices) <= 4 * (WIDTH + 3)
    assert kept.count(-1) == 10, "a gap stays one"
    columns = np.floor(x)
    for column in range(WIDTH):
        of_curve = y[columns == column]
        of_kept = y[indices[columns[indices] == column]]
        if np.isfinite(of_curve).any():
            assert np.nanmax(of_kept) == np.nanmax(of_curve)
            assert np.nanmin(of_kept) == np.nanmin(of_curve)
    assert drawing.run("thinned([0, 1.5, 3, NaN], [1, 2, 3, 4], 600)") == [0, 1, 2, -1]


def settle(tab: Tab) -> None:
    """Wait until what has changed is drawn."""
    tab.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def shown_part(tab: Tab, place: int = 0) -> list[float]:
    settle(tab)
    frame = box(tab, place)
    return [frame[name] for name in ("start", "end", "low", "high")]


@pytest.fixture
def case(seen: Tab, address: str) -> Tab:
    """Return a case's page with its leading plots of motion and error over time drawn."""
    seen.open(f"{address}#{BOTH}")
    show_first_plot(seen)
    seen.until(f"{PLOTS}.length >= 2")
    seen.run("document.querySelector('.view.current [aria-label=\"Reset the zoom\"]').click()")
    return seen


def test_box_zooms_both_axes_and_reset_restores_them(case: Tab) -> None:
    whole = shown_part(case)
    frame = box(case)
    place = [frame["left"] + 0.25 * frame["width"], frame["top"] + 0.2 * frame["height"]]
    case.drag(
        (place[0], place[1]), (place[0] + 0.5 * frame["width"], place[1] + 0.4 * frame["height"])
    )
    wide, high = whole[1] - whole[0], whole[3] - whole[2]
    expected = [whole[0] + 0.25 * wide, whole[0] + 0.75 * wide]
    expected += [whole[3] - 0.6 * high, whole[3] - 0.2 * high]
    np.testing.assert_allclose(shown_part(case), expected, atol=0.02 * wide)
    assert case.run(RANGES)[1] == pytest.approx(case.run(RANGES)[0]), "the other plot follows"
    labels = "[...document.querySelector('.view.current .plot').querySelectorAll('text')]"
    assert "12" not in case.run(f"{labels}.map((text) => text.textContent)"), "new ticks"
    case.run("document.querySelector('.view.current [aria-label=\"Reset the zoom\"]').click()")
    assert shown_part(case) == whole
    assert all(shown == whole[:2] for shown in case.run(RANGES))


def test_flat_drag_zooms_one_axis_and_double_click_resets(case: Tab) -> None:
    whole = shown_part(case)
    frame = box(case)
    y = frame["top"] + frame["height"] / 2
    case.drag((frame["left"] + 100, y), (frame["left"] + 200, y + 2))
    now = shown_part(case)
    assert now[1] - now[0] < 0.5 * (whole[1] - whole[0])
    assert now[2:] == whole[2:]
    for count in (1, 2):
        for kind in ("mousePressed", "mouseReleased"):
            case.mouse(kind, frame["left"] + 50, y, button="left", clickCount=count)
    assert shown_part(case) == whole
    case.drag((frame["left"] + 100, y), (frame["left"] + 102, y + 2))
    assert shown_part(case) == whole, "a click must not zoom"


def wheel(tab: Tab, x: float, y: float, **more: Any) -> None:
    tab.mouse("mouseMoved", x, y)
    tab.mouse("mouseWheel", x, y, deltaX=0, deltaY=-120, **more)


def test_panning_moves_and_wheel_zooms_only_when_enabled(case: Tab) -> None:
    whole = shown_part(case)
    frame = box(case)
    middle = (frame["left"] + frame["width"] / 2, frame["top"] + frame["height"] / 2)
    wheel(case, *middle)
    assert shown_part(case) == whole, "the page scrolls instead"
    pan = "document.querySelector('.view.current .tools [aria-pressed]')"
    case.run(f"{pan}.focus()")
    case.key(" ", 32)
    case.until(f"{pan}.ariaPressed === 'true'")
    frame = box(case)
    middle = (frame["left"] + frame["width"] / 2, frame["top"] + frame["height"] / 2)
    wheel(case, *middle)
    case.until(f"{RANGES}[0][0] > {whole[0]} + 0.1")
    now = shown_part(case)
    assert now[1] - now[0] == pytest.approx((whole[1] - whole[0]) / 1.2)
    assert now[0] + now[1] == pytest.approx(whole[0] + whole[1], abs=0.05), "about the pointer"
    case.drag(middle, (middle[0] + 0.1 * frame["width"], middle[1]))
    moved = shown_part(case)
    assert moved[1] - moved[0] == pytest.approx(now[1] - now[0])
    assert now[0] - moved[0] == pytest.approx(0.1 * (now[1] - now[0]), rel=0.05)
    case.run(f"{pan}.click()")
    assert case.run(f"{pan}.ariaPressed") == "false"


def test_shift_drag_moves_the_plot(case: Tab) -> None:
    whole = shown_part(case)
    frame = box(case)
    start = (frame["left"] + 100, frame["top"] + 50)
    case.mouse("mouseMoved", *start)
    case.mouse("mousePressed", *start, button="left", clickCount=1, buttons=1, modifiers=8)
    end = (start[0] + 60, start[1])
    case.mouse("mouseMoved", *end, button="left", buttons=1, modifiers=8)
    case.mouse("mouseReleased", *end, button="left", clickCount=1)
    now = shown_part(case)
    assert now[1] - now[0] == pytest.approx(whole[1] - whole[0])
    assert now[0] < whole[0]


def test_buttons_have_names_and_zoom_from_the_keyboard(case: Tab) -> None:
    whole = shown_part(case)
    buttons = "[...document.querySelector('.view.current .tools').querySelectorAll('button')]"
    names = case.run(f"{buttons}.map((button) => button.ariaLabel)")
    assert names[:2] == ["Zoom in", "Zoom out"]
    assert names[3:] == ["Reset the zoom", "Save as SVG", "Save as PNG"]
    assert case.run("document.querySelectorAll('[role=img] button').length") == 0
    case.run(f"{buttons}[0].focus()")
    case.key(" ", 32)
    now = shown_part(case)
    assert now[1] - now[0] == pytest.approx((whole[1] - whole[0]) / 1.44)
    assert now[3] - now[2] == pytest.approx((whole[3] - whole[2]) / 1.44)


def hover(tab: Tab, x: float, y: float, count: int) -> None:
    """Rest there until there are so many tips; a plot that is drawn again drops them."""

    def shown() -> bool:
        tab.mouse("mouseMoved", x, y)
        return bool(tab.run(f"{TIPS}.length === {count}"))

    tab.browser.until(shown, f"{count} tips")


def test_tips_of_coincident_curves_do_not_overlap(case: Tab) -> None:
    frame = box(case)
    for share in (0.011, 0.5, 0.98):
        t = frame["start"] + share * (frame["end"] - frame["start"])
        x = frame["left"] + share * frame["width"]
        y = (
            frame["top"]
            + (frame["high"] - math.sin(t)) / (frame["high"] - frame["low"]) * frame["height"]
        )
        hover(case, x, y, count=2)
        (a, b) = case.run("""[...document.querySelectorAll(".tip")]
          .map((tip) => tip.getBoundingClientRect())
          .map(({left, right, top, bottom}) => [left, right, top, bottom])""")
        apart = a[1] <= b[0] or b[1] <= a[0] or a[3] <= b[2] or b[3] <= a[2]
        assert apart, share
        assert min(a[0], b[0]) >= 0
    case.mouse("mouseMoved", 5, 5)
    case.until(f"{TIPS}.length === 0")


def test_tip_of_hypothesis_names_it(seen: Tab, address: str) -> None:
    seen.open(f"{address}#{DIAGNOSIS}")
    show_first_plot(seen)
    frame = box(seen)
    share = seen.run(f"{PLOTS}[0].x.scale()(0.4)")
    hover(seen, frame["left"] + share, frame["top"] + frame["height"] * 2.5 / 3, count=1)
    assert seen.run(TIPS)[0].split() == ["mass", "x:", "0.4"]


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_plot_is_saved_as_a_standalone_file(
    seen: Tab, address: str, tmp_path: Path, scheme: str
) -> None:
    seen.window(scheme=scheme)
    seen.open(f"{address}#{CASE}")
    show_first_plot(seen)
    allowed = {"behavior": "allow", "downloadPath": str(tmp_path)}
    seen.browser.send("Browser.setDownloadBehavior", **allowed)
    for ending in ("SVG", "PNG"):
        seen.run(
            f"document.querySelector('.view.current [aria-label=\"Save as {ending}\"]').click()"
        )
    files = [tmp_path / f"q0-reference-and-engines.{ending}" for ending in ("svg", "png")]
    seen.browser.until(
        lambda: all(file.exists() and file.stat().st_size for file in files), "files"
    )
    time.sleep(0.1)
    size = seen.run(f"[{PLOTS}[0].svg.width.baseVal.value, {PLOTS}[0].svg.height.baseVal.value]")
    text = files[0].read_text("utf-8")
    root = fromstring(text)
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    assert "var(" not in text
    paths = root.findall(".//{http://www.w3.org/2000/svg}path")
    assert len([path for path in paths if len(path.get("d", "")) > 500]) >= 3, "the curves"
    assert root.findtext("{http://www.w3.org/2000/svg}title") == "q0: reference and engines"
    paper = "#ffffff" if scheme == "light" else "#14181c"
    assert f"fill: {paper}" in text
    picture = files[1].read_bytes()
    assert picture.startswith(b"\x89PNG")
    wide, high = (int.from_bytes(picture[start : start + 4]) for start in (16, 20))
    assert [wide, high] == [2 * value for value in size]


def test_page_draws_each_point_at_its_place(seen: Tab, address: str) -> None:
    """Compare the drawn path of the reference with the data of the table."""
    seen.window(height=TALL)
    seen.open(f"{address}#{CASE}")
    seen.until(BUILT)
    path, x, y = seen.run(f"""(() => {{
      const plot = {PLOTS}.find((each) => each.chart.title.startsWith("q0: reference"));
      const layer = plot.layers.find((each) => each.curve.role === "reference");
      return [layer.path.getAttribute("d"), layer.curve.x, layer.curve.y];
    }})()""")
    drawn = np.array([point.split(",") for point in path[1:].split("L")], dtype=float)
    frame = box(seen)
    time_shown = frame["start"] + drawn[:, 0] / frame["width"] * (frame["end"] - frame["start"])
    value = frame["high"] - drawn[:, 1] / frame["height"] * (frame["high"] - frame["low"])
    expected = np.interp(time_shown, x, y)
    np.testing.assert_allclose(value, expected, atol=0.01)
    assert max(value) == pytest.approx(max(y), abs=1e-3)


def test_page_without_plots_has_no_plot_script() -> None:
    bare, whole = (Page(report.render(results(count))) for count in (0, 1))
    (script,) = (text for text in bare.contents["script"] if "overview()" in text)
    assert not any(f"class {name}" in script for name in ("Plot", "Axis", "Clock"))
    assert any("class Plot" in text for text in whole.contents["script"])


def test_page_without_plots_runs(browser: Browser, tmp_path: Path) -> None:
    path = tmp_path / "index.html"
    report.write_report(path, results(0))
    with browser.tab() as tab:
        tab.open(path.as_uri())
        assert tab.problems == []
