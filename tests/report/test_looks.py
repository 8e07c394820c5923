"""Appearance in a browser: dark, narrow, printed, without scripts, and with hostile names."""

import json
import re
from pathlib import Path

import pytest

from physics_crosscheck.harness.render.html import write_report
from physics_crosscheck.records import Results
from tests.report.chromium import Browser, Tab
from tests.report.steps import (
    BUILT,
    CASE,
    DIAGNOSIS,
    PLOTS,
    SYSTEM,
    TALL,
    needs_browser,
    rows,
    show_first_plot,
    shown,
    sound,
)
from tests.report.test_page import HOSTILE, hostile

pytestmark = needs_browser


COLOURS = f"""[getComputedStyle(document.body).backgroundColor, {PLOTS}.map((plot) =>
  [...plot.svg.querySelectorAll("text")].map((text) => getComputedStyle(text).fill))]"""
"""Colours of the page and of the texts of each plot."""


def brightness(colour: str) -> int:
    """Return the sum of a colour's red, green and blue, at most 765."""
    return sum(map(int, re.findall(r"\d+", colour)))


def test_plots_follow_light_and_dark_mode(seen: Tab, address: str) -> None:
    seen.window(height=TALL)
    seen.open(f"{address}#{CASE}")
    seen.until(BUILT)
    paper, light = seen.run(COLOURS)
    assert paper == "rgb(255, 255, 255)"
    assert all(brightness(colour) < 400 for plot in light for colour in plot)
    seen.window(height=TALL, scheme="dark")
    paper, dark = seen.run(COLOURS)
    assert brightness(paper) < 120
    assert all(brightness(colour) > 450 for plot in dark for colour in plot)
    seen.window(height=TALL, scheme="light")
    assert seen.run(COLOURS)[1] == light


def test_narrow_screen_needs_no_horizontal_scrolling(seen: Tab, address: str) -> None:
    seen.window(390, 844)
    for view in ("overview", SYSTEM, CASE, DIAGNOSIS):
        seen.open(f"{address}#{view}")
        show_first_plot(seen)
        assert seen.run("document.documentElement.scrollWidth") <= 390, view


def test_printed_page_is_light_and_without_controls(seen: Tab, address: str) -> None:
    seen.window(scheme="dark", media="print")
    seen.open(address)
    assert seen.run("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    for hidden in (".filters", ".bar nav", ".skip", ".copy"):
        assert not seen.run(f"document.querySelector('{hidden}').checkVisibility()")
    assert seen.run("document.querySelector('.matrix').checkVisibility()")
    pdf = seen.send("Page.printToPDF", landscape=True)["data"]
    assert len(pdf) > 10_000


def test_printed_page_has_every_tab_with_plots(seen: Tab, address: str) -> None:
    seen.open(f"{address}#{CASE}")
    show_first_plot(seen)
    seen.run("""addEventListener("beforeprint", () => { window.waiting = document
      .querySelectorAll(".view.current figure:has(.plot):not([data-drawn])").length; })""")
    seen.send("Page.printToPDF")
    seen.until("window.waiting === 0")
    seen.window(1050, 740, media="print")
    panels = "[...document.querySelectorAll('.view.current [role=tabpanel]')]"
    shown_panels = f"{panels}.filter((p) => p.checkVisibility({{visibilityProperty: true}}))"
    assert seen.run(f"{shown_panels}.length === {panels}.length")
    assert seen.run(f"{panels}.map((p) => p.querySelector('h3').checkVisibility())") == [True] * 5
    assert not seen.run("document.querySelector('.view.current .tabs').checkVisibility()")
    heights = f"{panels}.map((p) => p.getBoundingClientRect().height)"
    assert min(seen.run(heights)) > 100
    positions = (
        "['.motion', '.lead .group'].map((n) => document.querySelector(`.view.current ${n}`)"
        ".getBoundingClientRect().top)"
    )
    top, other = seen.run(positions)
    assert top == other, "motion and plots beside each other"


def test_dark_plots_are_printed_light(tab: Tab, address: str) -> None:
    tab.window(scheme="dark")
    tab.open(f"{address}#{CASE}")
    show_first_plot(tab)
    tab.window(scheme="dark", media="print")
    _, (first, *_) = tab.run(COLOURS)
    assert all(brightness(colour) < 400 for colour in first)


def test_plots_are_as_wide_as_their_column(seen: Tab, address: str) -> None:
    seen.open(f"{address}#{CASE}")
    show_first_plot(seen)
    fits = f"{PLOTS}.every((plot) => plot.svg.width.baseVal.value === plot.element.clientWidth)"
    assert seen.run(fits)
    seen.window(700, 900)
    seen.until(f"{PLOTS}.every((plot) => plot.element.clientWidth < 700) && {fits}")
    # Printing scales them without a redraw.
    seen.window(500, 900, media="print")
    inside = """[...document.querySelectorAll(".view.current .plot > svg")]
      .every((svg) => svg.getBoundingClientRect().right <= 500)"""
    assert seen.run(inside)


def test_page_without_javascript_has_all_but_plots(
    browser: Browser, address: str, troubled: Results
) -> None:
    with browser.tab(scripts=False) as tab:
        tab.send("Page.navigate", url=address)
        tab.until("document.querySelectorAll('footer').length === 1")
        assert len(shown(tab)) == tab.run("document.querySelectorAll('.view').length")
        text = tab.run("document.body.innerText")
        assert "JavaScript is off" in text
        assert "13 of 20 cases agree" in text
        assert "is 38.25; the motion implies 39.5" in text
        assert len(rows(tab)) == len(troubled.cases)
        assert not tab.run("document.querySelector('.filters').checkVisibility()")
        tab.run(f"document.getElementById('{CASE}').open = true")
        assert "dt for 1" in tab.run("document.body.innerText")
        assert tab.run("document.querySelectorAll('canvas').length") == 0


CHECK = """axe.run(document, {resultTypes: ["violations"]}).then((found) => found.violations
  .filter((v) => ["serious", "critical"].includes(v.impact))
  .map((v) => [v.id, v.nodes.slice(0, 3).map((n) => n.html.slice(0, 200) + n.failureSummary)]))"""


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_accessibility_checker_finds_nothing_serious(tab: Tab, address: str, scheme: str) -> None:
    axe = pytest.importorskip("axe_core_python", reason="axe-core is not installed")
    tab.window(height=TALL, scheme=scheme)
    tab.open(address)
    tab.run(Path(axe.__file__).with_name("axe.min.js").read_text("utf-8") + ";null")
    for view in ("overview", SYSTEM, CASE, DIAGNOSIS):
        tab.go(view)
        tab.until(BUILT)
        assert tab.run(CHECK) == [], view


@pytest.mark.slow
def test_hostile_names_are_harmless_in_plots(
    browser: Browser, tmp_path: Path, troubled: Results
) -> None:
    path = tmp_path / "index.html"
    name = "".join(HOSTILE)
    write_report(path, hostile(name, troubled))
    with browser.tab() as tab:
        tab.window(height=TALL)
        tab.open(path.as_uri())
        for kind in ("case", "diagnosis", "system"):
            view = tab.run(f"document.querySelector('.view[id^={kind}]').id")
            tab.run(f"location.hash = {json.dumps(view)}")
            tab.until(f"document.getElementById({json.dumps(view)}).checkVisibility()")
            tab.until(BUILT)
        assert tab.run("document.querySelectorAll('img, b:not([class]) b').length") == 0
        text = tab.run("document.body.innerText")
        assert "<script>alert(1)</script>" in text
        assert "⟨U+202E⟩" in text
        sound(tab, path.as_uri())
