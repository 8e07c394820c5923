"""The reason of a case that could not run names its file."""

from __future__ import annotations

from pathlib import Path

import pytest

from physics_crosscheck.harness.checks.not_run import failed_case
from physics_crosscheck.harness.jobs.workers import Failure
from physics_crosscheck.records import CaseId

CASE = CaseId(system="s", model="robot.urdf", scenario="free", engine="mujoco")


@pytest.mark.parametrize("reason", [
    "the process died (SIGKILL); other cases are not affected",
    "it used up its limit of 120 processor seconds; --limit raises it",
])  # fmt: skip
def test_reason_without_a_file_gets_the_file_of_the_case(reason: str) -> None:
    actual = failed_case(CASE, "folder", Failure(reason, "")).reason
    assert actual == f"{Path('folder') / 'robot.urdf'}: {reason}"


def test_reason_with_a_file_is_unchanged() -> None:
    reason = "folder/robot.urdf:7: <mass value> is 'a', where a finite number"
    assert failed_case(CASE, "folder", Failure(reason, "")).reason == reason
