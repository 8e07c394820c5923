"""The first screen: the verdict and the proposed change, as a reader sees them."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from msgspec.structs import replace

from physics_crosscheck.harness.render.html import render, write_report
from physics_crosscheck.harness.render.html.view import Report
from physics_crosscheck.records import Results
from tests.report.chromium import Browser, Tab
from tests.report.page import Page
from tests.report.samples import STIFFNESS, planted, results
from tests.report.steps import needs_browser, sound
from tests.report.test_looks import CHECK

EIGHT = ("mujoco", "pybullet", "mjx", "dart", "drake", "newton", "pinocchio", "pymunk")

VISIBLE = """(() => {
  const found = [];
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  const inside = (r) => r.width > 1 && r.top >= 0 && r.left >= 0
    && r.bottom <= innerHeight && r.right <= document.documentElement.clientWidth;
  while (walk.nextNode()) {
    const node = walk.currentNode, range = document.createRange();
    if (!node.data.trim() || !node.parentElement.checkVisibility()) continue;
    if (["SCRIPT", "STYLE"].includes(node.parentElement.tagName)) continue;
    range.selectNodeContents(node);
    if ([...range.getClientRects()].every(inside)) found.push(node.data.trim());
  }
  return found.join("\\n");
})()"""
"""Script that returns the text visible without scrolling."""


@pytest.fixture(scope="module")
def eight() -> Results:
    """Return a fault that eight engines show; agreeing cases have no series."""
    sample = planted(EIGHT)
    bare = (
        replace(case, series=None) if case.outcome == "AGREES" else case for case in sample.cases
    )
    return replace(sample, cases=tuple(bare))


@pytest.fixture(scope="module")
def reports(tmp_path_factory: pytest.TempPathFactory, eight: Results) -> Path:
    folder = tmp_path_factory.mktemp("planted") / "reports"
    write_report(folder / "index.html", eight)
    return folder


@pytest.fixture
def planted_tab(browser: Browser, reports: Path) -> Iterator[Tab]:
    address = (reports / "index.html").as_uri()
    with browser.tab() as tab:
        tab.window(1440, 900)
        tab.open(address)
        yield tab
        sound(tab, address)


@needs_browser
def test_first_screen_shows_planted_fault_and_fix(planted_tab: Tab, reports: Path) -> None:
    text = planted_tab.run(VISIBLE)
    for wanted in (
        "72 of 96 cases agree",
        "24 differ. 1 number to change.",
        "robot.urdf:21",
        "38.25",
        "39.5",
        f"- {STIFFNESS.strip()}",
        f"crosscheck run --last-failed --out {reports}",
        "Copy patch",
    ):
        assert wanted in text, wanted
    # The whole matrix is next to it, with each engine's column and the outcome in words.
    for engine in EIGHT:
        assert engine in text
    assert "≠ DIFFERS" in text
    assert "11.9" in text
    wide = "[document.documentElement, document.querySelector('.scroll:has(.matrix)')]"
    assert planted_tab.run(f"{wide}.map((e) => e.scrollWidth - e.clientWidth)") == [0, 0]


@needs_browser
def test_buttons_copy_the_patch_and_the_command(planted_tab: Tab) -> None:
    """Check the copied text with and without access to the clipboard."""
    planted_tab.run("""(() => { window.kept = [];
      navigator.clipboard.writeText = async (text) => { kept.push(text); }; })()""")
    for place in (0, 1):
        planted_tab.run(f"document.querySelectorAll('button[data-copy]')[{place}].click()")
    planted_tab.until("kept.length === 2")
    patch, command = planted_tab.run("kept")
    assert patch.startswith("--- a/robot.urdf\n+++ b/robot.urdf\n@@ -18,7 +18,7 @@\n")
    assert f"-{STIFFNESS}\n+{STIFFNESS.replace('38.25', '39.5')}\n" in patch
    assert command.startswith("crosscheck run --last-failed")
    planted_tab.until("document.querySelector('button[data-copy]').textContent === 'Copied'")
    planted_tab.run("""(() => { navigator.clipboard.writeText = async () => { throw new Error(); };
      document.execCommand = () => { kept.push(getSelection().toString()
        || document.activeElement.value); return true; };
      document.querySelector("button[data-copy]").click(); })()""")
    planted_tab.until("kept.length === 3")
    assert planted_tab.run("kept[2]") == patch


@pytest.mark.slow
@needs_browser
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_patch_is_accessible(planted_tab: Tab, scheme: str) -> None:
    axe = pytest.importorskip("axe_core_python", reason="axe-core is not installed")
    planted_tab.window(1440, 900, scheme=scheme)
    planted_tab.run(Path(axe.__file__).with_name("axe.min.js").read_text("utf-8") + ";null")
    # Check only the first screen: the whole page of eight engines is too slow.
    assert planted_tab.run(CHECK.replace("(document,", "('#act, .titled',")) == []


def test_cause_is_one_issue_for_all_engines_and_scenarios(eight: Results) -> None:
    (issue,) = Report(eight).issues
    assert (issue.count, len(issue.cases)) == ("24 cases", 24)
    assert render(eight).count("and 18 more") == 1
    assert issue.name == f"system_0/robot.urdf [{', '.join(EIGHT)}]"
    assert list(map(str, issue.remedy.changes)) == ["robot.urdf:21 from 38.25 to 39.5"]


def test_agreeing_page_lists_outliers() -> None:
    lines = Page(render(results(2))).lines("overview")
    assert lines[1] == "Every engine follows all 4 files to 11.9 digits."
    (start,) = (i for i, line in enumerate(lines) if line.endswith(" Nothing to change."))
    case = "system_0/mujoco.xml/free [mujoco] (#case-system_0/mujoco.xml/mujoco/free)"
    assert lines[start + 2 : start + 5] == [
        "Outliers",
        f"fewest agreeing digits | 11.9 {case}",
        f"largest error at dt (0.002 s) | 0.911 % {case}",
    ]
