"""How the page looks in a browser: dark, narrow, on paper, without scripts, and under attack."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.report import write_report
from tests.report.chromium import Browser, Tab
from tests.report.steps import (
    BOTH,
    CASE,
    DIAGNOSIS,
    PLOTS,
    SYSTEM,
    TALL,
    look,
    needs_browser,
    rows,
    shown,
    sound,
    unfold,
)
from tests.report.test_page import HOSTILE, hostile

pytestmark = needs_browser


@pytest.mark.slow
def test_dark_light_and_back_redraws_what_is_drawn(tab: Tab, address: str) -> None:
    tab.window(height=TALL)
    tab.open(f"{address}#{CASE}")
    colours = """[getComputedStyle(document.body).backgroundColor,
      [...Bokeh.index].filter((view) => view.frame).map((view) => view.model.xaxes[0])
        .map((axis) => axis.axis_label_text_color.value ?? axis.axis_label_text_color)]"""
    unfold(tab)
    light = tab.run(colours)
    tab.window(height=TALL, scheme="dark")
    tab.until(
        f"JSON.stringify({colours}[1]) !== {json.dumps(json.dumps(light[1]))}"
        f" && {colours}[1].length >= {len(light[1])}"
    )
    dark = tab.run(colours)
    assert light[0] == "rgb(255, 255, 255)"
    assert sum(map(int, re.findall(r"\d+", dark[0]))) < 120
    tab.window(height=TALL, scheme="light")
    tab.until(
        f"{colours}[1].length >= {len(light[1])}"
        f" && {colours}[1].every((c) => c === {light[1][0]!r})"
    )


@pytest.mark.parametrize("view", ["overview", SYSTEM, CASE, DIAGNOSIS])
def test_a_narrow_screen_needs_no_scrolling_sideways(tab: Tab, address: str, view: str) -> None:
    tab.window(390, 844)
    tab.open(f"{address}#{view}")
    look(tab)
    assert tab.run("document.documentElement.scrollWidth") <= 390


def test_on_paper_it_is_light_and_without_what_can_not_be_pressed(tab: Tab, address: str) -> None:
    tab.window(scheme="dark", media="print")
    tab.open(address)
    assert tab.run("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    for hidden in (".filters", ".bar nav", ".skip", ".copy"):
        assert not tab.run(f"document.querySelector('{hidden}').checkVisibility()")
    assert tab.run("document.querySelector('.matrix').checkVisibility()")
    pdf = tab.send("Page.printToPDF", landscape=True)["data"]
    assert len(pdf) > 10_000


def test_paper_has_what_is_folded_as_text_and_the_screen_folds_it_again(
    tab: Tab, address: str
) -> None:
    tab.open(f"{address}#{CASE}")
    look(tab)
    tab.run("""(() => { window.seen = [];
      addEventListener("beforeprint", () => {
        seen.push([...document.querySelectorAll(".view.current .topic")].map((t) => t.open)); });
    })()""")
    tab.send("Page.printToPDF")
    tab.until("window.seen.length > 0")
    assert tab.run("seen[0]") == [False] * 5 + [True], "numbers, and no plots that nobody opened"
    topics = "[...document.querySelectorAll('.view.current .topic')]"
    tab.until(f"{topics}.every((t) => !t.open)")
    tab.window(1050, 740, media="print")
    assert not tab.run(f"{topics}.some((t) => t.checkVisibility())"), "no heading of nothing"
    beside = (
        "['.motion', '.lead .group'].map((n) => document.querySelector(`.view.current ${n}`)"
        ".getBoundingClientRect().top)"
    )
    top, other = tab.run(beside)
    assert top == other, "motion and plot beside each other"


def test_plots_that_were_drawn_on_a_dark_ground_keep_it_on_paper(tab: Tab, address: str) -> None:
    tab.window(scheme="dark")
    tab.open(f"{address}#{CASE}")
    look(tab)
    tab.window(scheme="light", media="print")
    plot = "document.querySelector('.view.current [data-drawn] .plot')"
    tab.until(f"{plot} && getComputedStyle({plot}).backgroundColor === 'rgb(20, 24, 28)'")
    assert tab.run(f"{PLOTS}.length") > 0


def test_without_javascript_everything_but_the_plots_is_there(
    browser: Browser, address: str, troubled: Results
) -> None:
    with browser.tab(scripts=False) as tab:
        tab.send("Page.navigate", url=address)
        tab.until("document.querySelectorAll('footer').length === 1")
        assert len(shown(tab)) == tab.run("document.querySelectorAll('.view').length")
        text = tab.run("document.body.innerText")
        assert "JavaScript is off" in text
        assert "13 of 20 cases agree" in text
        assert "is 38.25, the motion wants 39.5" in text
        assert len(rows(tab)) == len(troubled.cases)
        assert not tab.run("document.querySelector('.filters').checkVisibility()")
        tab.run(f"document.getElementById('{CASE}').open = true")
        assert "These steps would give" in tab.run("document.body.innerText")
        assert tab.run("document.querySelectorAll('canvas').length") == 0


CHECK = """axe.run(document, {resultTypes: ["violations"]}).then((found) => found.violations
  .filter((v) => ["serious", "critical"].includes(v.impact))
  .map((v) => [v.id, v.nodes.slice(0, 3).map((n) => n.html.slice(0, 200) + n.failureSummary)]))"""


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_an_accessibility_checker_finds_nothing_serious(
    tab: Tab, address: str, scheme: str
) -> None:
    axe = pytest.importorskip("axe_core_python", reason="axe-core is not installed")
    tab.window(height=TALL, scheme=scheme)
    tab.open(address)
    tab.run(Path(axe.__file__).with_name("axe.min.js").read_text("utf-8") + ";null")
    for view in ("overview", SYSTEM, CASE, BOTH, DIAGNOSIS):
        tab.go(view)
        unfold(tab)
        assert tab.run(CHECK) == [], view


@pytest.mark.slow
def test_hostile_names_neither_run_nor_break_the_plots(
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
            unfold(tab)
        assert tab.run("document.querySelectorAll('img, b:not([class]) b').length") == 0
        text = tab.run("document.body.innerText")
        assert "<script>alert(1)</script>" in text
        assert "⟨U+202E⟩" in text
        sound(tab, path.as_uri())
