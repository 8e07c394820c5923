"""Compare the terms that an engine compiles from a robot file with its equations."""

from __future__ import annotations

from pathlib import Path

import pybullet_data
import pytest

from physics_crosscheck.harness.audits import audits
from physics_crosscheck.harness.checks.audit import audit_terms
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.interfaces.cli.main import main
from tests.cases.test_robot_linearization import ARM
from tests.models import written
from tests.robots.files import TIPPED

DATA = Path(pybullet_data.getDataPath())


@pytest.mark.parametrize(("old", "new", "expected"), [
    ('damping="0.7"', 'damping="0.75"', "damping of lift is 0.75 in the model and 0.7 in the"),
    ('iyy="0.018"', 'iyy="0.02"', "inertia of lift is 0.1375 in the model and 0.1355 in the"),
    ("0.02 0 -0.3", "0.12 0 -0.3", "a force of -1.67832 acts on lift at rest where lift = 0.8"),
])  # fmt: skip
def test_wrong_number_is_reported_by_its_term(
    tmp_path: Path, old: str, new: str, expected: str
) -> None:
    file, copy = tmp_path / "arm.urdf", tmp_path / "copy.urdf"
    file.write_text(ARM)
    copy.write_text(ARM.replace(old, new))
    task = model_task(prepare_tree(file, states=8), "mujoco")
    assert not [one for one in audit_terms(task).findings if one.severity == "finding"]
    findings = audit_terms(task.with_file(copy)).findings
    messages = [one.message for one in findings if one.severity == "finding"]
    assert any(message.startswith(expected) for message in messages), messages


def test_audit_command_reports_massless_inertia_in_mujoco(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = written(tmp_path, "arm.urdf", TIPPED)
    assert main(["audit", str(file), "--engine", "mujoco", "--jobs", "1"]) == 1
    out = " ".join(capsys.readouterr().out.split())
    assert "inertia of hinge is" in out
    assert "in the model and" in out


@pytest.mark.slow
def test_large_robot_is_compared_by_accelerations_only() -> None:
    (note,) = audit_terms(
        model_task(prepare_tree(DATA / "a1" / "a1.urdf", floating=True, states=4), "mujoco")
    ).findings
    assert note.severity == "note"
    assert "18 coordinates are not compared one by one" in note.message


def test_file_rejected_by_an_engine_keeps_its_reading_findings(tmp_path: Path) -> None:
    """Use an inertia that no body can have, which MuJoCo rejects."""
    file = written(tmp_path, "arm.urdf", ARM.replace('iyy="0.018"', 'iyy="0.028"'))
    (result,) = audits([file], engines=("mujoco",))
    assert not result.failure
    inertia, note = (row for row in result.findings if row.severity != "advice")
    assert inertia.code == "XC107"
    assert note.severity == "note"
    assert note.message.startswith("its compiled terms are not compared: ")
