"""Past runs on the page: digits and global error over time, by version."""

from __future__ import annotations

import base64
import gzip
import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from physics_crosscheck.harness.records.history import Past, past_of
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.render.html import render, write_report
from physics_crosscheck.harness.render.html.past_charts import past_runs
from physics_crosscheck.harness.render.html.view import Content
from tests.report.chromium import Browser
from tests.report.page import Page
from tests.report.samples import changed_case, results
from tests.report.steps import BUILT, CASE, PLOTS, needs_browser, sound


def past(recorded: Results) -> tuple[Past, ...]:
    """Return three daily runs, the last with a newer version and fewer digits."""
    lines: list[Past] = []
    for day, version in ((19, "3.9"), (20, "3.9"), (21, "4.0")):
        run = replace(
            recorded, created=f"2026-11-{day}T02:00:00+00:00", versions={"mujoco": version}
        )
        lines += [
            replace(one, digits=one.digits and one.digits - (day == 21)) for one in past_of(run, "")
        ]
    return tuple(lines)


DATES = [1e3 * datetime(2026, 11, day, 2, tzinfo=UTC).timestamp() for day in (19, 20, 21)]


def charts(run: Results, lines: tuple[Past, ...], pack: str) -> Any:
    packs = Content(run, lines).packs()
    if pack not in packs:
        return {}
    content = json.loads(gzip.decompress(base64.b64decode(packs[pack])))
    selected = [chart for chart in content["charts"] if chart["part"] == "History"]
    return {
        chart["title"]: {
            curve["label"]: [content["columns"][curve[axis]] for axis in ("x", "y")]
            for curve in chart["curves"]
        }
        for chart in selected
    }


def test_case_shows_digits_and_errors_of_each_version(agreeing: Results) -> None:
    drawn = charts(agreeing, past(agreeing), "pack-case-0")
    first, second, third = DATES
    assert drawn["Agreeing digits"] == {
        "mujoco 3.9": [[first, second], [11.9, 11.9]],
        "mujoco 4.0": [[third], [10.9]],
    }
    errors = drawn["Error at dt"]
    assert errors["mujoco 4.0"] == [[third], [0.00911]]


def test_overview_shows_the_worst_case_of_each_engine(
    agreeing: Results,
) -> None:
    lines = past(agreeing)
    worst = replace(lines[0], time="2026-11-22T02:00:00+00:00", digits=1.0)
    drawn = charts(agreeing, (*lines, worst), "pack-history")
    assert drawn["Agreeing digits"]["pybullet"] == [DATES, [11.9, 11.9, 10.9]]
    assert drawn["Agreeing digits"]["mujoco"] == [DATES, [11.9, 11.9, 10.9]]
    assert set(drawn["Agreeing digits"]) == {"mujoco", "pybullet"}


def test_error_of_a_chaotic_motion_hides_no_other(agreeing: Results) -> None:
    full_run = agreeing.cases[0].full_run
    assert full_run is not None
    lost = changed_case(agreeing, 0, full_run=replace(full_run, global_error=0.944))
    drawn = charts(lost, past(lost), "pack-history")
    assert drawn["Error at dt"]["mujoco"][1] == [0.00911] * 3
    case_charts = charts(lost, past(lost), "pack-case-0")
    assert case_charts["Error at dt"]["mujoco 4.0"][1] == [0.944]


def test_past_run_has_its_commit_and_changed_cases(agreeing: Results) -> None:
    lines = list(past(agreeing))
    last = len(lines) - 1
    lines[last] = replace(lines[last], outcome=Outcome.DIFFERS, commit="0123456789abcdef")
    first, second, third = past_runs(agreeing.cases, lines)
    assert (first.time, first.changes, second.changes) == (DATES[0], (), ())
    assert first.name == "2026-11-19 02:00 · mujoco 3.9"
    assert third.name == "2026-11-21 02:00 · 012345678 · mujoco 4.0"
    count = len(agreeing.cases)
    assert third.summary == f"{count} cases: {count - 1} AGREES, 1 DIFFERS"
    assert len(third.changes) == count
    assert third.changes[-1] == f"{lines[last].id}: AGREES → DIFFERS"
    assert third.changes[0] == f"{lines[0].id}: 11.9 → 10.9 digits"


def test_single_run_has_no_history(agreeing: Results, page: Page) -> None:
    single = past_of(agreeing, "")
    broken = tuple(replace(line, time="yesterday") for line in single)
    for lines in ((), single, (*single, *broken)):
        assert charts(agreeing, lines, "pack-history") == {}
        assert charts(agreeing, lines, "pack-case-0") == {}
    assert page.source == render(agreeing, history=single), "one run adds nothing"


def test_same_history_gives_the_same_page(agreeing: Results) -> None:
    lines = past(agreeing)
    assert render(agreeing, history=lines) == render(agreeing, history=lines)


@needs_browser
def test_past_runs_are_drawn_on_overview_and_case(browser: Browser, tmp_path: Path) -> None:
    sample = results(1)
    path = tmp_path / "index.html"
    write_report(path, sample, past(sample))
    with browser.tab() as tab:
        tab.window(1440, 2500)
        tab.open(path.as_uri())
        tab.until("document.querySelectorAll('#overview figure[data-drawn]').length === 2")
        assert tab.run(f"{PLOTS}.map((plot) => plot.x.kind)") == ["date", "date"]
        labels = tab.run("[...document.querySelectorAll('.plot text')].map((t) => t.textContent)")
        assert {"20 Nov 00:00", "21 Nov 00:00"} <= set(labels)
        picker = "document.querySelector('#overview .picker')"
        assert tab.run(f"{picker}.querySelector('select').value") == "2", "the last run"
        assert "11.9 → 10.9 digits" in tab.run(f"{picker}.textContent")
        tab.run(f"""(() => {{ const choice = {picker}.querySelector("select");
          choice.value = 1; choice.dispatchEvent(new Event("change")); }})()""")
        assert "no change since the run before" in tab.run(f"{picker}.textContent")
        assert tab.run(f"{PLOTS}.map((plot) => plot.time)") == [DATES[1]] * 2
        tab.go(CASE)
        tab.until(BUILT)
        titles = tab.run(
            "[...document.querySelectorAll('.view.current h4')].map(h => h.textContent)"
        )
        assert "Agreeing digits" in titles
        sound(tab, path.as_uri())
