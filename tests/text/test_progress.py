"""Progress in a log: what is amiss, and a count."""

from __future__ import annotations

import pytest

from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.text.progress import Progress
from tests.records.made import case


def told(capsys: pytest.CaptureFixture[str], *, every: bool) -> list[str]:
    with Progress(every=every) as progress:
        for i in range(1, 41):
            wrong = i == 7
            progress(i, 40, case(Outcome.DIFFERS if wrong else Outcome.AGREES))
    return capsys.readouterr().err.splitlines()


def test_a_log_has_a_line_a_tenth_and_one_for_what_does_not_agree(
    capsys: pytest.CaptureFixture[str],
) -> None:
    lines = told(capsys, every=False)
    assert [line for line in lines if line.startswith("[7/40] DIFFERS")]
    assert len(lines) == 11
    assert lines[-1] == "40 of 40 cases (100 %)"


def test_it_has_a_line_a_case_where_that_is_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    lines = told(capsys, every=True)
    assert len(lines) == 40
    assert sum("AGREES" in line for line in lines) == 39
