"""The page in a real browser, if installed: actions of a reader."""

import re

import numpy as np
import pytest

from physics_crosscheck.records import Results
from tests.report.chromium import Browser, Tab
from tests.report.samples import array, series_of
from tests.report.steps import (
    BOTH,
    BUILT,
    CASE,
    HURRY,
    KINDS,
    PLOTS,
    TALL,
    needs_browser,
    rows,
    shown,
    tab_to,
)

pytestmark = needs_browser


@pytest.mark.slow
def test_views_open_with_all_their_plots(tab: Tab, address: str, troubled: Results) -> None:
    tab.window(height=TALL)
    tab.open(address)
    views = tab.run("[...document.querySelectorAll('.view')].map(v => v.id)")
    assert len([v for v in views if v.startswith("case-")]) == len(troubled.cases)
    drawn = []
    for view in (*KINDS, *(one for one in views if not one.startswith("case-"))):
        tab.go(view)
        tab.until(BUILT)
        assert shown(tab) == [view]
        drawn += tab.run("[...document.querySelectorAll('[data-drawn]')].map(f => f.dataset.drawn)")
    # Two systems too; a ranking, a corrected motion and its defects.
    assert len(drawn) == sum(KINDS.values()) + 2 + 3
    assert all(int(found.split()[0]) >= 1 and int(found.split()[2]) >= 2 for found in drawn)


def test_plots_are_drawn_only_when_visible(tab: Tab, address: str) -> None:
    tab.open(address)
    tab.run(HURRY)
    assert tab.run("document.querySelectorAll('figure:has(.plot)').length") == 0
    tab.go(CASE)
    tab.until("document.querySelector('.view.current [data-drawn]')")
    elsewhere = "document.querySelectorAll('.view:not(.current) figure:has(.plot)').length"
    assert tab.run(elsewhere) == 0
    # Plots further down are drawn automatically, for printing.
    tab.until(BUILT)
    tab.go("overview")
    tab.until("document.querySelectorAll('[data-drawn]').length === 0")


def test_plots_of_a_closed_case_are_not_drawn(tab: Tab, address: str) -> None:
    tab.open(address)
    tab.run(HURRY)
    tab.run("""(() => {
      const text = Response.prototype.text;  // which unpacks the numbers
      Response.prototype.text = async function () {  // as on a busy machine
        const content = await text.call(this);
        location.hash = '#overview';
        await new Promise((done) => setTimeout(done, 200));
        setTimeout(() => { window.long = true; }, 1900);  // later than plots that are not near
        return content;
      };
    })()""")
    tab.run(f"location.hash = '#{CASE}'")
    tab.until("window.long")
    assert shown(tab) == ["overview"]
    assert tab.run("document.querySelectorAll('[data-drawn]').length") == 0


def test_permalink_opens_case_and_back_opens_overview(seen: Tab, address: str) -> None:
    seen.open(f"{address}#{BOTH}")
    assert shown(seen) == [BOTH]
    assert "system_1/robot.urdf/driven" in seen.run("document.title")
    seen.go("overview")
    seen.until("document.querySelector('#overview').checkVisibility()")
    assert shown(seen) == ["overview"]
    seen.run("history.back()")
    seen.until(f"document.getElementById('{BOTH}').checkVisibility()")
    seen.go("case-of/nothing")
    seen.until("document.querySelector('#overview').checkVisibility()")
    assert shown(seen) == ["overview"]


def test_header_stays_visible_after_a_permalink(browser: Browser, address: str) -> None:
    with browser.tab() as fresh:
        fresh.open(f"{address}#{CASE}")
        fresh.until("document.readyState === 'complete'")
        assert fresh.run("new Promise((done) => setTimeout(() => done(scrollY), 300))") == 0


def test_cases_are_filtered_searched_and_sorted(tab: Tab, address: str) -> None:
    tab.open(address)
    assert len(rows(tab)) == 20
    assert "FAILED" in rows(tab)[0]
    choose = (
        "document.getElementById('filter-{}').value = {!r};"
        "document.getElementById('filter-{}').dispatchEvent(new Event('change'))"
    )
    tab.run(choose.format("outcome", "DIFFERS", "outcome"))
    assert len(rows(tab)) == 1
    assert tab.run("document.getElementById('matching').textContent") == "1 of 20 cases"
    faded = "document.querySelectorAll('.matrix .cell.faded').length"
    assert tab.run(faded) == tab.run("document.querySelectorAll('.matrix [data-cell]').length") - 1
    tab.run("document.getElementById('clear').click()")
    tab.run("document.getElementById('search').focus()")
    tab.send("Input.insertText", text="SYSTEM_1 pybullet large")
    assert [row.split()[2] for row in rows(tab)] == ["system_1/robot.urdf/large"]
    tab.run("document.getElementById('clear').click()")
    press = "[...document.querySelectorAll('#cases th button')].find(b => b.textContent === {!r})"
    tab.run(press.format("U") + ".focus()")
    tab.key("Enter", 13)
    tab.run(press.format("E") + ".click()")
    tab.run(press.format("E") + ".click()")
    assert "DIFFERS" in rows(tab)[0], "the largest discrepancy first"
    assert "ABSENT" in "".join(rows(tab)[-5:]), "what has none last"
    head = press.format("E") + ".closest('th').ariaSort"
    assert tab.run(head) == "descending"


TABS = "[...document.querySelectorAll('.view.current [role=tab]')]"
PANELS = """[...document.querySelectorAll('.view.current [role=tabpanel]')]
  .filter((panel) => panel.checkVisibility({visibilityProperty: true}))
  .map((panel) => panel.dataset.tab)"""


def test_case_opens_at_its_worst_time_with_wide_plots(
    tab: Tab, address: str, troubled: Results
) -> None:
    tab.window(1440, 900)
    tab.open(f"{address}#{CASE}")
    tab.until("document.querySelectorAll('.view.current .lead [data-drawn]').length === 2")
    boxes = tab.run("""[...document.querySelectorAll(
      ".view.current .moving, .view.current .lead .plot")].map((one) => {
      const {bottom, width} = one.getBoundingClientRect(); return [bottom, width]; })""")
    assert len(boxes) == 3
    assert max(bottom for bottom, _ in boxes) < 900, "without scrolling"
    assert sum(width > 800 for _, width in boxes) == 2
    titles = (
        "[...document.querySelectorAll('.view.current .lead figure h4')].map((h) => h.textContent)"
    )
    assert tab.run(titles) == ["q0: reference and engines", "q0: error against uncertainty"]
    verdict = troubled.cases[0].verdict
    assert verdict is not None
    shown_time = "document.querySelector('.view.current .controls output').textContent"
    assert tab.run(shown_time) == f"{verdict.time:.3f} s"
    tab.run("""(() => { const slider = document.querySelector(".view.current .controls input");
      slider.value = 3; slider.dispatchEvent(new Event("input")); })()""")
    assert tab.run(shown_time) != f"{verdict.time:.3f} s"
    tab.run("document.querySelector('.view.current .controls button:last-child').click()")
    assert tab.run(shown_time) == f"{verdict.time:.3f} s"


def test_tabs_are_selected_by_keys_and_persist_in_the_next_case(tab: Tab, address: str) -> None:
    tab.window(height=TALL)
    tab.open(f"{address}#{CASE}")
    tab.until(BUILT)
    names = ["Motion", "Error", "Step size", "Linear equations", "Numbers"]
    assert tab.run(f"{TABS}.map((t) => t.textContent)") == names
    assert tab.run(PANELS) == ["Motion"]
    tab.run(f"{TABS}[0].focus()")
    for key, code, name in (
        ("ArrowRight", 39, "Error"), ("End", 35, "Numbers"), ("ArrowRight", 39, "Motion"),
        ("ArrowLeft", 37, "Numbers"), ("Home", 36, "Motion"), ("ArrowRight", 39, "Error"),
    ):  # fmt: skip
        tab.key(key, code)
        assert tab.run(PANELS) == [name]
        chosen = f"{TABS}.filter((t) => t.ariaSelected === 'true' && t.tabIndex === 0)"
        assert tab.run(f"{chosen}.map((t) => t.textContent)") == [name]
        assert tab.run("document.activeElement.textContent") == name
        assert (
            tab.run(f"document.getElementById({TABS}[1].getAttribute('aria-controls')).dataset.tab")
            == "Error"
        )
    tab.go(BOTH)
    tab.until(BUILT)
    assert tab.run(PANELS) == ["Error"]


def test_keyboard_reaches_the_tabs_of_a_case(tab: Tab, address: str) -> None:
    tab.open(address)
    tab_to(tab, f"#overview a[href='#{CASE}']", 120)
    tab.key("Enter", 13)
    tab.until("document.querySelector('.view.current [data-drawn]')")
    tab_to(tab, "[role=tab]")
    tab.key("ArrowRight", 39)
    assert tab.run(PANELS) == ["Error"]
    tab_to(tab, "[role=tabpanel]", 1)
    # The heading of a case does not fold it.
    assert tab.run("document.querySelector('.view.current summary').tabIndex") == -1
    tab.run("document.querySelector('.view.current summary').click()")
    assert tab.run("document.querySelector('.view.current').open")


def test_one_legend_hides_a_curve_in_every_plot_of_its_tab(tab: Tab, address: str) -> None:
    tab.window(height=TALL)
    tab.open(f"{address}#{BOTH}")
    tab.until(BUILT)
    group = "[...document.querySelectorAll('.view.current .group')][1]"
    reference = f"""{PLOTS}.filter((plot) => {group}.contains(plot.element))
      .flatMap((plot) => plot.layers.filter((layer) => layer.curve.role === "reference"))
      .map(({{path}}) => path.checkVisibility() && path.getBoundingClientRect().width > 100)"""
    assert tab.run(f"{group}.querySelectorAll('.legend').length") == 1
    count = len(tab.run(reference))
    assert count >= 2
    assert tab.run(reference) == [True] * count
    tab.run(f"{group}.querySelector('.legend button').click()")
    assert tab.run(reference) == [False] * count
    assert tab.run(f"{group}.querySelector('.legend button').ariaPressed") == "false"
    # A redrawn plot follows the legend.
    drawn = f"{PLOTS}.filter((plot) => {group}.contains(plot.element))"
    tab.run(f"(() => {{ window.before = new Set({drawn}); }})()")
    tab.go("overview")
    tab.until(f"{PLOTS}.length === 0")
    tab.go(BOTH)
    tab.until(BUILT)
    assert tab.run(f"{drawn}.every((plot) => !before.has(plot))")
    assert tab.run(reference) == [False] * count


RANGES = f"""{PLOTS}.filter((plot) => plot.chart.over_time)
  .map((plot) => [plot.x.value(0), plot.x.value(plot.frame.width)])"""
"""Script that returns the ranges of the plots over time."""


def box(tab: Tab, place: int = 0) -> dict[str, float]:
    """Return the frame of a plot in the current view and its range."""
    frame: dict[str, float] = tab.run(f"""(() => {{
      const canvas = document.querySelectorAll(".view.current .plot")[{place}];
      canvas.scrollIntoView({{block: "center", behavior: "instant"}});
      const rect = canvas.getBoundingClientRect();
      const {{frame: {{left, top, width, height}}, x, y}} = canvas.plot;
      return {{left: rect.left + left, top: rect.top + top, width, height,
        start: x.range.start, end: x.range.end, low: y.range.start, high: y.range.end}};
    }})()""")
    return frame


def test_zoom_and_reset_apply_to_all_plots_over_time(tab: Tab, address: str) -> None:
    tab.window(height=TALL)
    tab.open(f"{address}#{BOTH}")
    tab.until(BUILT)
    before = tab.run(RANGES)
    assert len(before) == 2 + 5 + 1
    frame = box(tab)
    y = frame["top"] + frame["height"] / 2
    ends = [frame["left"] + share * frame["width"] for share in (0.25, 0.5)]
    tab.drag((ends[0], y - 40), (ends[1], y + 40))
    wide = frame["end"] - frame["start"]
    expected = [frame["start"] + share * wide for share in (0.25, 0.5)]
    tab.until(f"{RANGES}.every(([a]) => Math.abs(a - {expected[0]}) < 0.05)")
    np.testing.assert_allclose(tab.run(RANGES), [expected] * 8, atol=0.05)


TIPS = "[...document.querySelectorAll('.tip')].map((tip) => tip.innerText)"


def test_hovering_shows_values_in_every_plot(tab: Tab, address: str, troubled: Results) -> None:
    tab.window(height=TALL)
    tab.open(f"{address}#{BOTH}")
    tab.until(BUILT)
    record = next(
        c
        for c in troubled.cases
        if c.system == "system_1"
        and (c.model, c.engine, c.scenario) == ("robot.urdf", "pybullet", "driven")
    )
    series = series_of(record)
    frame = box(tab)
    k = 97
    t = float(series.t[k] or 0.0)
    x = frame["left"] + (t - frame["start"]) / (frame["end"] - frame["start"]) * frame["width"]
    value = float(series.reference[0][k] or 0.0)
    y = frame["top"] + (frame["high"] - value) / (frame["high"] - frame["low"]) * frame["height"]
    tab.mouse("mouseMoved", x + 3, y)
    tab.mouse("mouseMoved", x, y)
    tab.until("document.querySelector('.view.current .readout').textContent.startsWith('t = 4.8')")
    texts = tab.run(
        "[...document.querySelectorAll('.view.current .chosen .readout')].map(r => r.textContent)"
    )
    assert len(texts) == 2 + 1 + 1, "every plot over time shows its own values"
    for i, text in ((0, texts[0]), (1, texts[2])):
        values = dict(re.findall(r"(?:: |; )([^;]+?) (\S+)(?=;|$)", text))
        assert float(values["reference"]) == pytest.approx(series.reference[i][k], rel=1e-4)
        mine = next(value for name, value in values.items() if name.startswith("this"))
        assert float(mine) == pytest.approx(series.engine[i][k], rel=1e-4)
    cursors = f"{PLOTS}.filter((p) => p.chart.over_time && p.element.closest('.chosen'))"
    cursors += ".map((p) => [p.cursor.x1, p.x])"
    times = tab.run(f"{cursors}.map(([x1, x]) => x.value(x1.baseVal.value))")
    np.testing.assert_allclose(times, [t] * 4, atol=0.03)
    tab.until(f"{TIPS}.some((tip) => tip.startsWith('reference'))")
    (tip,) = (tip for tip in tab.run(TIPS) if tip.startswith("reference"))
    match = re.search(r"t: (\S+)\s+value: (\S+)", tip)
    assert match
    assert float(match[1]) == pytest.approx(t, rel=1e-4)
    assert float(match[2]) == pytest.approx(value, rel=1e-3)
    tab.run(f"{TABS}[1].click()")
    errors = tab.run(
        "[...document.querySelectorAll('.view.current .chosen .readout')].map(r => r.textContent)"
    )
    assert [one.partition(":")[0] for one in errors] == [texts[0].partition(":")[0]] * 4


def test_mechanism_plays_pauses_and_scrubs_by_keyboard(
    tab: Tab, address: str, troubled: Results
) -> None:
    tab.open(f"{address}#{CASE}")
    tab.until("document.querySelector('.view.current .moving')")
    time = "Number(document.querySelector('.view.current .controls input').value)"
    tab.until(f"Math.abs({time} - 1.1) < 0.02")
    tab.run("document.querySelector('.view.current .play').click()")
    tab.until(f"{time} > 1.3")
    tab.run("document.querySelector('.view.current .play').click()")
    stopped = tab.run(time)
    assert tab.run(f"new Promise((ok) => setTimeout(() => ok({time}), 200))") == stopped
    tab.run("document.querySelector('.view.current .controls input').focus()")
    tab.key("ArrowRight", 39)
    tab.until(f"{time} > {stopped}")
    tab.key("Home", 36)
    tab.until(f"{time} === 0")
    series = series_of(troubled.cases[0])
    k = 60
    tab.run(f"""(() => {{ const slider = document.querySelector(".view.current .controls input");
      slider.step = "any"; slider.value = {series.t[k]};
      slider.dispatchEvent(new Event("input")); }})()""")
    script = "document.querySelector('.moving .{} .block').getAttribute('transform')"
    for role, rows_of in (("reference", series.reference), ("engine", series.engine)):
        q = float(rows_of[0][k] or 0.0)
        numbers = [float(n) for n in tab.run(script.format(role))[7:-1].split()]
        w, h, angle = 0.3, 0.2, q**2
        c, s = np.cos(angle), np.sin(angle)
        expected = [w * c, w * s, -h * s, h * c, q, np.sin(0.5 * q)]
        np.testing.assert_allclose(numbers, expected, rtol=1e-4, atol=1e-6)


def test_system_without_sketch_shows_a_note_and_moving_cursor(seen: Tab, address: str) -> None:
    seen.open(f"{address}#{BOTH}")
    seen.until("document.querySelector('.view.current .controls')")
    assert "declares no sketch" in seen.run("document.querySelector('.view.current').innerText")
    assert seen.run("document.querySelector('.view.current .moving')") is None


def test_each_plot_has_a_description_and_a_table(
    seen: Tab, address: str, troubled: Results
) -> None:
    seen.window(height=TALL)
    seen.open(f"{address}#{CASE}")
    seen.until(BUILT)
    labels = seen.run("[...document.querySelectorAll('.view.current .plot')].map(p => p.ariaLabel)")
    assert all(len(text) > 40 for text in labels)
    assert not seen.run("document.querySelector('.view.current .told').checkVisibility()")
    motion = ".view.current .lead .data"
    seen.run(f"document.querySelector('{motion}').open = true")
    seen.until(f"document.querySelector('{motion} table')")
    cells = seen.run(
        "[...document.querySelectorAll('.view.current .data table')].map(t =>"
        " [...t.tBodies[0].rows].map(r => [...r.cells].map(c => Number(c.textContent))))"
    )
    series = series_of(troubled.cases[0])
    table = np.array(cells[0])
    np.testing.assert_allclose(table[:, 0], array(series.t))
    np.testing.assert_allclose(table[:, 1], array(series.reference[0]))
