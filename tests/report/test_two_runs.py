"""The page of two runs: changes with links to both reports."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from physics_crosscheck.harness.baseline.diff import diff_runs
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.render.html import write_report
from physics_crosscheck.harness.render.html.two_runs import render_two_runs, write_two_runs
from tests.report.chromium import Browser
from tests.report.page import Page
from tests.report.samples import judged, results
from tests.report.steps import needs_browser
from tests.report.test_looks import CHECK
from tests.report.test_page import HOSTILE, hostile

ROWS = """[...document.querySelectorAll("main > section .moves tbody tr")]
  .map((row) => [...row.cells].map((cell) => cell.innerText.trim()))"""


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> str:
    tmp_path = tmp_path_factory.mktemp("runs")
    before = results(1)
    worse = judged(
        before.cases[4], Outcome.DIFFERS, "q0 ends 3.1e-06 off", discrepancy=3.1e-6,
        largest_discrepancy=3.1e-6,
    )  # fmt: skip
    cases = (*before.cases[:4], worse, *before.cases[5:8])
    after = replace(before, cases=cases, versions={**before.versions, "mujoco": "4.1.0"})
    for name, run in (("old", before), ("new", after)):
        write_report(tmp_path / name / "index.html", run)
    page = tmp_path / "new" / "changes.html"
    write_two_runs(page, diff_runs(before, after), (tmp_path / "old", tmp_path / "new"))
    return page.as_uri()


@needs_browser
def test_changes_are_shown_with_links_to_both_reports(browser: Browser, address: str) -> None:
    with browser.tab() as tab:
        tab.window(1440, 900)
        tab.send("Page.navigate", url=address)
        tab.until("document.querySelectorAll('footer').length === 1")
        text = tab.run("document.body.innerText")
        assert "2 of 9 cases changed" in text
        assert "4.0.0 → 4.1.0" in text
        worse, gone = tab.run(ROWS)
        name = "system_0/robot.urdf/driven [mujoco]"
        assert worse[:5] == [
            name, "verdict, discrepancy, digits worse", "✓ AGREES", "≠ DIFFERS", "11.9 → 5.5",
        ]  # fmt: skip
        assert gone[1:4] == ["gone", "✓ AGREES", "none"]
        links = tab.run("[...document.querySelectorAll('tr.worse a')].map((a) => a.href)")
        for folder, link in zip(("old", "new"), links, strict=True):
            assert f"/{folder}/index.html#case-system_0/robot.urdf/mujoco/driven" in link
            tab.open(link)
            tab.until("document.querySelector('.view.current.case')")
        tab.window(390, 844)
        tab.send("Page.navigate", url=address)
        tab.until("document.querySelectorAll('footer').length === 1")
        assert tab.run("document.documentElement.scrollWidth") <= 390
        assert tab.problems == []


@pytest.mark.slow
@needs_browser
def test_accessibility_checker_finds_nothing_serious(browser: Browser, address: str) -> None:
    axe = pytest.importorskip("axe_core_python", reason="axe-core is not installed")
    with browser.tab() as tab:
        tab.send("Page.navigate", url=address)
        tab.until("document.querySelectorAll('footer').length === 1")
        tab.run(Path(axe.__file__).with_name("axe.min.js").read_text("utf-8") + ";null")
        for scheme in ("light", "dark"):
            tab.window(scheme=scheme)
            assert tab.run(CHECK) == [], scheme


def test_run_without_report_is_not_linked_and_names_are_escaped(tmp_path: Path) -> None:
    before = results(1)
    after = hostile("".join(HOSTILE), before)
    diff = diff_runs(before, after)
    page = Page(render_two_runs(diff, tmp_path, (tmp_path / "a", tmp_path / "b")))
    assert {str(attrs["href"]) for tag, attrs in page.elements if tag == "a"} == {"#main"}
    assert not {"script", "img"} & {tag for tag, _ in page.elements}
    assert "<script>alert(1)</script>" in page.text
