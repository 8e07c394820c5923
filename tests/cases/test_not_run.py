"""A case that could not be run says of which file."""

from __future__ import annotations

from pathlib import Path

import pytest

from physics_crosscheck.harness.checks.not_run import failed_case
from physics_crosscheck.harness.jobs.workers import Failure
from physics_crosscheck.harness.records.case import CaseId

ONE = CaseId(system="s", model="robot.urdf", scenario="free", engine="mujoco")


@pytest.mark.parametrize("reason", [
    "the process died (SIGKILL); other cases are not affected",
    "it used up its limit of 120 processor seconds; --limit raises it",
])  # fmt: skip
def test_a_reason_that_names_no_file_is_told_with_that_of_the_case(reason: str) -> None:
    told = failed_case(ONE, "folder", Failure(reason, "")).reason
    assert told == f"{Path('folder') / 'robot.urdf'}: {reason}"


def test_a_reason_that_names_the_file_is_told_as_it_is() -> None:
    reason = "folder/robot.urdf:7: <mass value> is 'a', where a finite number"
    assert failed_case(ONE, "folder", Failure(reason, "")).reason == reason
