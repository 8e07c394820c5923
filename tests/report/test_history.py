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
from physics_crosscheck.harness.records.results import Results
from physics_crosscheck.harness.render.html import render, write_report
from physics_crosscheck.harness.render.html.view import Content
from tests.report.chromium import Browser
from tests.report.samples import changed_case, results
from tests.report.steps import CASE, PLOTS, needs_browser, sound, unfold


def past(found: Results) -> tuple[Past, ...]:
    """Three runs, a day apart, the last with another version and fewer digits."""
    lines: list[Past] = []
    for day, version in ((19, "3.9"), (20, "3.9"), (21, "4.0")):
        run = replace(found, created=f"2026-11-{day}T02:00:00+00:00", versions={"mujoco": version})
        lines += [
            replace(one, digits=one.digits and one.digits - (day == 21)) for one in past_of(run, "")
        ]
    return tuple(lines)


DATES = [1e3 * datetime(2026, 11, day, 2, tzinfo=UTC).timestamp() for day in (19, 20, 21)]


def charts(found: Results, lines: tuple[Past, ...], pack: str) -> Any:
    packs = Content(found, lines).packs()
    if pack not in packs:
        return {}
    content = json.loads(gzip.decompress(base64.b64decode(packs[pack])))
    kept = [one for one in content["charts"] if one["part"] == "Over time"]
    return {
        one["title"]: {
            curve["label"]: [content["columns"][curve[axis]] for axis in ("x", "y")]
            for curve in one["curves"]
        }
        for one in kept
    }


def test_a_case_shows_its_digits_and_errors_of_each_version(agreeing: Results) -> None:
    found = charts(agreeing, past(agreeing), "pack-case-0")
    first, second, third = DATES
    assert found["Agreeing digits"] == {
        "mujoco 3.9": [[first, second], [11.9, 11.9]],
        "mujoco 4.0": [[third], [10.9]],
    }
    errors = found["Error at dt"]
    assert errors["mujoco 4.0"] == [[third], [0.00911]]


def test_the_overview_shows_the_worst_of_each_engine_in_runs_of_most_cases(
    agreeing: Results,
) -> None:
    lines = past(agreeing)
    one = replace(lines[0], time="2026-11-22T02:00:00+00:00", digits=1.0)
    found = charts(agreeing, (*lines, one), "pack-history")
    assert found["Agreeing digits"]["pybullet"] == [DATES, [11.9, 11.9, 10.9]]
    assert found["Agreeing digits"]["mujoco"] == [DATES, [11.9, 11.9, 10.9]]
    assert set(found["Agreeing digits"]) == {"mujoco", "pybullet"}


def test_an_error_of_a_motion_that_no_step_follows_hides_no_other(agreeing: Results) -> None:
    full_run = agreeing.cases[0].full_run
    assert full_run is not None
    lost = changed_case(agreeing, 0, full_run=replace(full_run, global_error=0.944))
    found = charts(lost, past(lost), "pack-history")
    assert found["Error at dt"]["mujoco"][1] == [0.00911] * 3
    own = charts(lost, past(lost), "pack-case-0")
    assert own["Error at dt"]["mujoco 4.0"][1] == [0.944]


def test_without_two_runs_there_is_no_history(agreeing: Results) -> None:
    alone = past_of(agreeing, "")
    broken = tuple(replace(one, time="yesterday") for one in alone)
    for lines in ((), alone, (*alone, *broken)):
        assert charts(agreeing, lines, "pack-history") == {}
        assert charts(agreeing, lines, "pack-case-0") == {}
    assert render(agreeing) == render(agreeing, history=alone), "one run adds nothing"


def test_the_same_history_gives_the_same_page(agreeing: Results) -> None:
    lines = past(agreeing)
    assert render(agreeing, history=lines) == render(agreeing, history=lines)


@needs_browser
def test_past_runs_are_drawn_on_the_overview_and_in_their_case(
    browser: Browser, tmp_path: Path
) -> None:
    found = results(1)
    path = tmp_path / "index.html"
    write_report(path, found, past(found))
    with browser.tab() as tab:
        tab.window(1440, 2500)
        tab.open(path.as_uri())
        tab.until("document.querySelectorAll('#overview figure[data-drawn]').length === 2")
        assert tab.run(f"{PLOTS}.map((plot) => plot.x.kind)") == ["date", "date"]
        labels = tab.run("[...document.querySelectorAll('.plot text')].map((t) => t.textContent)")
        assert {"19 Nov 2026", "20 Nov", "21 Nov"} <= set(labels)
        tab.go(CASE)
        unfold(tab)
        titles = tab.run("[...document.querySelectorAll('.view.current h4')].map(h => h.innerText)")
        assert "Agreeing digits" in titles
        sound(tab, path.as_uri())
