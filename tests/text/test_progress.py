"""Progress in a log: a line every few seconds, with the right percentage."""

from __future__ import annotations

import pytest

from physics_crosscheck.harness.render.terminal.progress import LOG_SECONDS, Progress
from physics_crosscheck.records import Outcome
from tests.records.made import case


def logged(capsys: pytest.CaptureFixture[str], seconds: float, *, every: bool) -> list[str]:
    """Return the lines of 40 cases that take so many seconds each."""
    now = [0.0]
    with Progress(every=every, clock=lambda: now[0]) as progress:
        for i in range(1, 41):
            now[0] += seconds
            progress(i, 40, case(Outcome.DIFFERS if i == 7 else Outcome.AGREES))
    return capsys.readouterr().err.splitlines()


def test_log_has_a_line_every_few_seconds(capsys: pytest.CaptureFixture[str]) -> None:
    assert logged(capsys, 0.01, every=False) == []
    lines = logged(capsys, LOG_SECONDS / 2, every=False)
    assert lines[0] == "running: 2 of 40 cases done (5 %)"
    assert len(lines) == 20
    assert lines[-1].startswith("diagnosing ")


def test_progress_stays_below_100_percent_until_done(capsys: pytest.CaptureFixture[str]) -> None:
    """Leave time for the diagnoses and the report after the last case."""
    assert not [line for line in logged(capsys, LOG_SECONDS, every=False) if "100 %" in line]


def test_total_appears_once_all_cases_are_counted(capsys: pytest.CaptureFixture[str]) -> None:
    """Omit the total until every system's scenarios are derived."""
    now = [0.0]
    with Progress(clock=lambda: now[0]) as progress:
        for i in range(1, 41):
            now[0] += LOG_SECONDS
            progress(i, 0 if i < 20 else 40, case(Outcome.AGREES))
    lines = capsys.readouterr().err.splitlines()
    assert lines[18] == "deriving and running: 19 cases done"
    assert lines[19] == "running: 20 of 40 cases done (50 %)"
    assert lines[-1] == "checking coverage"


def test_log_has_one_line_per_case_on_request(
    capsys: pytest.CaptureFixture[str],
) -> None:
    lines = logged(capsys, LOG_SECONDS, every=True)
    assert len(lines) == 41
    assert lines[6].startswith("[7/40] FAIL ")
    assert sum("] ok " in line for line in lines) == 39
