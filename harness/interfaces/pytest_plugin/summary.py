"""The plugin's lines at the end of a pytest run."""

from __future__ import annotations

from collections import Counter
from typing import Any

import pytest

from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.render.terminal.styles import WORDS
from physics_crosscheck.harness.results.messages import explain_hint
from physics_crosscheck.harness.results.status import counted


def summarize(reporter: pytest.TerminalReporter) -> None:
    """Write counts of outcomes, accepted differences and skipped tests, from pytest's reports."""
    reports = _reports(reporter)
    if not reports:
        return
    reporter.ensure_newline()
    reporter.section("crosscheck")
    report_properties = [(report, dict(report.user_properties)) for report in reports]
    counts = Counter(facts["outcome"] for _, facts in report_properties if "outcome" in facts)
    parts = [f"{counts[one]} {WORDS[one]}" for one in Outcome if counts[one]]
    agreeing = [facts for _, facts in report_properties if facts.get("outcome") == Outcome.AGREES]
    worst = max((float(facts["largest"]) for facts in agreeing if "largest" in facts), default=None)
    size = "" if worst is None else f"; largest difference of the ok cases: {worst:.1e}"
    reporter.write_line(", ".join(parts) + size)
    for report, facts in report_properties:
        if report.passed and "accepted" in facts:
            outcome = facts.get("outcome", "audit")
            reporter.write_line(f"accepted: {outcome} {report.nodeid}: {facts['accepted']}")
    skipped = Counter(report.longrepr[2] for report, _ in report_properties if report.skipped)
    for reason, number in skipped.items():
        reporter.write_line(
            f"skipped: {counted(number, 'test')}: {reason.removeprefix('Skipped: ')}"
        )
    if untested(reporter.config):
        reporter.write_line(
            "nothing was tested: no engine of these models is installed."
            " Run pip install 'physics-crosscheck[engines]'."
        )
    codes = [
        facts["code"] for report, facts in report_properties if report.failed and "code" in facts
    ]
    if hint := explain_hint(codes):
        reporter.write_line(hint, light=True)


def untested(config: pytest.Config) -> bool:
    """Return whether there were cases, and all of them were skipped."""
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    reports = [] if reporter is None else _reports(reporter)
    return bool(reports) and all(report.skipped for report in reports)


def _reports(reporter: pytest.TerminalReporter) -> list[Any]:
    """Return the reports of cases and audits, in any order."""
    return [
        report
        for kind in ("passed", "failed", "skipped")
        for report in reporter.stats.get(kind, ())
        if report.when == "call" and "crosscheck" in report.keywords
    ]
