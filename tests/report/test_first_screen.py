"""The first screen: the verdict and the proposed change, as a reader sees them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from msgspec.structs import replace

from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.finding import AuditFinding
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.render.html import render, write_report
from physics_crosscheck.harness.render.html.view import Report
from tests.report.chromium import Browser, Tab
from tests.report.page import facts_of
from tests.report.samples import (
    STIFFNESS,
    changed_model,
    diagnosis,
    judged,
    located,
    planted,
    results,
)
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


def test_cause_is_one_issue_for_all_engines_and_scenarios(
    eight: Results,
) -> None:
    (issue,) = Report(eight).issues
    assert (issue.count, len(issue.cases)) == ("24 cases", 24)
    assert render(eight).count("and 18 more") == 1
    assert issue.name == f"system_0/robot.urdf [{', '.join(EIGHT)}]"
    assert list(map(str, issue.remedy.changes)) == ["robot.urdf:21 from 38.25 to 39.5"]


def test_all_wrong_literals_of_the_audit_are_fixed() -> None:
    """List all findings if the motions agree or no single cause explains them."""
    sample = results(1)
    text = "<a>\n  <b mass='2' size='0.1 0.2'/>\n  <c mass='4.5'/>\n</a>\n"
    findings = tuple(
        AuditFinding(
            kind="literal", subject=(f"{name}@mass",), message=f"{name}@mass is wrong", actual=old,
            expected=new, location=located(SourceLine(file="robot.urdf", line=line), text, spelled),
            replacement=repr(new), severity="finding",
        )
        for name, line, spelled, old, new in (
            ("b", 2, "2", 2.0, 3.0), ("c", 3, "4.5", 4.5, 0.1 + 0.2),
        )
    )  # fmt: skip
    agreeing = changed_model(sample, 1, audit=findings, text=text)
    (issue,) = Report(agreeing).issues
    assert issue.outcome == "AUDIT"
    assert [str(change) for change in issue.remedy.changes] == [
        "robot.urdf:2 from 2 to 3.0",
        "robot.urdf:3 from 4.5 to 0.30000000000000004",
    ]
    assert "+  <b mass='3.0' size='0.1 0.2'/>\n" in issue.remedy.patch
    suggested = diagnosis(sample.cases[3])
    differs = judged(sample.cases[3], Outcome.DIFFERS, "off", discrepancy=0.1)
    unexplained = replace(
        changed_model(agreeing, 1, diagnosis=replace(suggested, explained=False)),
        cases=(*sample.cases[:3], differs, *sample.cases[4:]),
    )
    (issue,) = Report(unexplained).issues
    assert issue.outcome == "DIFFERS"
    assert len(issue.remedy.changes) == 2
    assert issue.sentence.startswith("No single cause or pair of causes explains the motions")


def test_partly_fixable_cause_has_no_patch() -> None:
    """Report a reversed axis too, which no number expresses, without a patch."""
    sample = planted(("mujoco",))
    original = sample.models[1].diagnosis
    assert original is not None
    best = original.explanations[0]
    turned = replace(best.causes[0], kind="axis", subject=("x",), locations=())
    both = replace(best, causes=(*best.causes, turned))
    sample = changed_model(sample, 1, diagnosis=replace(original, explanations=(both,)))
    (issue,) = Report(sample).issues
    assert (len(issue.remedy.changes), issue.remedy.patch) == (1, "")
    assert issue.remedy.words == "robot.urdf:21 from 38.25 to 39.5"
    assert 'data-copy="robot.urdf:21 from 38.25 to 39.5"' in render(sample)
    assert "axis of x reversed explains the motion" in issue.sentence


def test_accepted_difference_is_not_counted_again() -> None:
    sample = results(2)
    cases = list(sample.cases)
    cases[0] = replace(judged(cases[0], Outcome.DIFFERS, "off"), accepted="within its own 3e-08")
    sample = replace(sample, cases=tuple(cases))
    assert Report(sample).verdict.startswith("1 difference accepted.")
    page = render(sample)
    assert "✓ <b>as accepted</b>" in page
    assert "1 of 3 DIFFERS, within its own 3e-08" in page


def test_agreeing_page_lists_outliers() -> None:
    seen = render(results(2))
    assert "Every motion matches the equations. Nothing to change." in seen
    assert 'class="again"' not in seen
    assert facts_of(seen.split('class="standing"')[1].split("</dl>")[0]) == {
        "fewest agreeing digits": "11.9 system_0/mujoco.xml/free [mujoco]",
        "largest error at dt (0.002 s)": "0.911 % system_0/mujoco.xml/free [mujoco]",
    }
