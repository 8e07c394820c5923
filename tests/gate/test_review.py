"""Interactive review of changes: accepted cases are written, and no others."""

from __future__ import annotations

import io
import os
import pty
import subprocess
import sys
from collections.abc import Iterator

import pytest

from physics_crosscheck.harness.commands.gate.accept import accept_each
from physics_crosscheck.harness.commands.gate.result import GateResult
from physics_crosscheck.harness.commands.gate.review import Decisions, Review
from physics_crosscheck.harness.interfaces.cli.exit_codes import DIFFER, USAGE
from physics_crosscheck.harness.records.diff import Status
from tests.commands import crosscheck
from tests.faults.known_folder import environment
from tests.gate.conftest import SYSTEM, Repository


class Person:
    """A reviewer who gives answers in turn and then ends the input."""

    def __init__(self, *answers: str) -> None:
        self._answers: Iterator[str] = iter(answers)
        self.heard: list[str] = []

    def ask(self, question: str) -> str:
        self.heard.append(question)
        answer = next(self._answers, None)
        if answer is None:
            raise EOFError
        return answer

    def review(self, result: GateResult) -> Decisions:
        return Review(result, self.ask, self.heard.append).walk()


@pytest.fixture
def changed(damped: tuple[Repository, GateResult]) -> GateResult:
    """Return a gate with two changed cases, due to another damper in `space.py`."""
    return damped[1]


def test_each_case_is_decided_and_its_files_are_shown_once(changed: GateResult) -> None:
    person = Person("?", "a", "", "a new  damper", "r")
    decided = person.review(changed)
    first, second = changed.with_status(Status.CHANGED)
    assert decided.reasons == {first.id: "a new damper"}
    assert (decided.rejected, decided.undecided) == ([second], [])
    skipped = Person("s", "r").review(changed)
    assert (skipped.rejected, skipped.undecided) == ([second], [first])
    text = "\n".join(person.heard)
    assert text.count(f"changed in {SYSTEM}: space.py") == 1
    assert "DAMPING 0.9 -> 0.91" in text
    assert "1 of 2  changed" in text
    assert "2 of 2  changed" in text


def test_all_cases_of_a_file_can_be_accepted_at_once(changed: GateResult) -> None:
    decided = Person("A", "a new damper").review(changed)
    assert len(decided.reasons) == 2
    assert set(decided.reasons.values()) == {"a new damper"}
    assert decided.rejected == decided.undecided == []


def test_quitting_keeps_earlier_decisions(changed: GateResult) -> None:
    first, *rest = changed.with_status(Status.CHANGED)
    for answers in (["a", "right", "q"], ["a", "right"]):
        decided = Person(*answers).review(changed)
        assert (list(decided.reasons), decided.undecided) == ([first.id], rest)


def test_empty_reason_repeats_the_last_one(changed: GateResult) -> None:
    decided = Person("a", "a new damper", "a", "").review(changed)
    assert list(decided.reasons.values()) == ["a new damper"] * 2


def test_unchanged_motions_are_asked_about_once_and_keep_their_reasons(
    repository: Repository,
) -> None:
    repository.edit("space.py", "DAMPING = 0.9 ", "DAMPING = 0.90 ")
    result = repository.gate("pymunk")
    decided = Person("a").review(result)
    assert len(decided.reasons) == len(decided.kept) == 2
    named = decided.reasons.keys() - decided.kept
    accept_each(result, decided.reasons, named, repository.baseline)
    again = repository.gate("pymunk")
    assert {change.status for change in again.changes} == {Status.SAME}
    assert {change.entry.reason for change in again.changes if change.entry} == {"first baseline"}
    assert not Person("s").review(result).reasons


def test_review_needs_a_terminal(repository: Repository, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO())
    for ci in ("1", ""):
        done = crosscheck("review", cwd=repository.root, CI=ci)
        assert (done.returncode, done.stdout) == (USAGE, "")
        assert "review needs a person at a terminal" in done.stderr


@pytest.mark.slow
def test_review_at_a_terminal_writes_accepted_cases(repository: Repository) -> None:
    repository.edit("space.py", "DAMPING = 0.9 ", "DAMPING = 0.91 ")
    code, output = _at_a_terminal(repository, "a\na new damper\nr\n")
    assert code == DIFFER, output
    assert "1 accepted, 1 rejected" in output
    assert f"models/{SYSTEM}/space.py:7 DAMPING 0.9 -> 0.91" in output
    statuses = [change.status for change in repository.gate("pymunk").changes]
    assert sorted(statuses) == sorted([Status.EXPECTED, Status.CHANGED])


def _at_a_terminal(repository: Repository, typed: str) -> tuple[int, str]:
    ours, theirs = pty.openpty()
    try:
        os.write(ours, typed.encode())
        done = subprocess.run(
            [sys.executable, "-m", "physics_crosscheck", "review", "--engine", "pymunk"],
            cwd=repository.root,
            stdin=theirs,
            capture_output=True,
            text=True,
            check=False,
            timeout=600,
            env={key: value for key, value in environment().items() if key != "CI"},
        )
    finally:
        os.close(ours)
        os.close(theirs)
    return done.returncode, done.stdout + done.stderr
