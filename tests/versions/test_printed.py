"""Output of a comparison of two versions: in the terminal, on the page, in the record."""

from __future__ import annotations

import html
import io
from pathlib import Path

import msgspec
import pytest
from rich.console import Console

from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.read import decoded
from physics_crosscheck.harness.records.versions import EngineVersion, Upgrade, Versions
from physics_crosscheck.harness.records.write import encoded
from physics_crosscheck.harness.render.html.versions import render_versions
from physics_crosscheck.harness.render.terminal.versions import print_versions
from tests.baseline.samples import case, measurement
from tests.report.page import Page
from tests.versions.samples import between, failed, model, remark, run


def versions(*upgrades: Upgrade) -> Versions:
    numbers = [upgrades[0].before, *(one.after for one in upgrades)]
    return Versions(
        created="2026-01-01T00:00:00+00:00",
        engine="e",
        resolution=1e-9,
        seconds=1.0,
        versions=tuple(
            EngineVersion(version=one, python="python", report=f"out/e-{one}") for one in numbers
        ),
        upgrades=upgrades,
        left_out=("arm: no model of it names e; left out",),
    )


def printed(changes: Versions) -> list[str]:
    file = io.StringIO()
    print_versions(Console(file=file, width=160), changes)
    return [line.rstrip() for line in file.getvalue().splitlines()]


SAME = versions(between(run("1.0"), run("2.0")))
MOVED = versions(
    between(
        run("1.0", case(), models=(model(),)),
        run(
            "2.0",
            case(Outcome.DIFFERS, global_error=0.01),
            motion=measurement(move=1e-3),
            models=(model(audit=(remark("a limit is ignored"),)),),
        ),
    )
)


def test_unchanged_results_allow_the_upgrade() -> None:
    lines = printed(SAME)
    assert lines == [
        "ok  e 2.0 can replace 1.0 for these models: no result changes",
        "",
        "e 1.0 -> 2.0",
        "1 case: 1 unchanged (identical to the last bit)",
    ]


def test_differences_within_uncertainty_are_printed() -> None:
    changes = versions(between(run("1.0"), run("2.0", motion=measurement(move=4e-13))))
    assert "1 case: 1 unchanged (differ by at most 4.0e-13, uncertainty 1e-12)" in printed(changes)


def test_changed_case_is_a_row_with_both_verdicts_and_the_error_ratio() -> None:
    lines = printed(MOVED)
    (row,) = [line for line in lines if line.startswith("spring/m.xml/free [e]")]
    for text in ("verdict, limit", "AGREES -> DIFFERS", "1.0e-03 ±", "0.5 % -> 1 % (x 2)"):
        assert text in row
    assert "  the verdict changed from AGREES to DIFFERS" in lines
    assert "spring/m.xml [e]: remark gained, remark lost" in lines
    assert "1 case: 1 changed; 1 model changed" in lines
    assert " ".join(" ".join(lines[:2]).split()).startswith(
        "FAIL e 1.0 -> 2.0 changes results. Check them before you upgrade. Reports:"
        " out/e-1.0/index.html out/e-2.0/index.html"
    )


def test_failed_cases_are_reported_as_not_compared() -> None:
    lines = printed(versions(between(run("1.0", failed()), run("2.0", failed()))))
    assert "1 case: 1 not compared" in lines
    assert lines[0].startswith("ERROR  e: not everything could be compared. Fix the errors below")


def test_page_shows_the_changes_and_runs_no_script() -> None:
    text = render_versions(MOVED, Path("out"))
    assert "script-src 'none'" in html.unescape(text)
    assert "<script" not in text
    assert 'href="e-1.0/index.html"' in text
    for word in ("AGREES", "DIFFERS", "remark gained, remark lost", "arm: no model of it names e"):
        assert word in text
    Page(text)


@pytest.mark.parametrize(
    "name", ["<script>alert(1)</script>", '"><b onclick=x>', "a\u202eb\x1b[31m"]
)
def test_names_are_escaped_on_the_page_and_in_the_terminal(name: str) -> None:
    bad = msgspec.structs.replace(failed(), model=name, reason=name)
    changes = versions(between(run("1.0", bad), run("2.0")))
    text = render_versions(changes, Path("out"))
    assert name not in text
    assert "<script" not in text
    assert "\x1b" not in "".join(printed(changes))


def test_record_round_trips() -> None:
    assert decoded(encoded(MOVED).encode(), Versions) == MOVED
