"""Audits report how the numbers of a file act."""

from __future__ import annotations

from pathlib import Path

import pytest

from physics_crosscheck.harness.checks.audit import audit_acting
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.records.survey import ActingQuantity

ROBOT = """<mujoco><compiler angle="radian"/><option cone="{cone}"/><worldbody>
<geom name="floor" type="plane" size="5 5 1" friction="0.4"/>
<body name="base" pos="0 0 0.3"><freejoint/><geom name="pad" size="0.1" mass="2" friction="0.9"/>
<geom name="shell" size="0.2" mass="0" contype="0" conaffinity="0"/>
<body name="arm" pos="0 0 0.2"><joint name="lift" axis="0 1 0" range="-1 1" solreflimit="0.02 0.3"/>
<geom name="bar" type="capsule" fromto="0 0 0 0.4 0 0" size="0.02" mass="1" priority="1"
 friction="0.2"/></body></body></worldbody>
<actuator><position name="servo" joint="lift" kp="50" kv="1" forcerange="-4 4"/></actuator>
</mujoco>"""


def acting(folder: Path, cone: str = "pyramidal") -> dict[tuple[str, str], ActingQuantity]:
    file = folder / "robot.xml"
    file.write_text(ROBOT.format(cone=cone))
    result = audit_acting(model_task(prepare_tree(file), "mujoco"))
    return {(one.subject, one.quantity): one for one in result.acting}


def test_each_pair_has_its_friction_and_its_rule(tmp_path: Path) -> None:
    """Catch a lost rule: the larger of two, a higher priority, no contact, a pyramid."""
    rows = acting(tmp_path)
    pad, bar = rows["floor with pad", "friction"], rows["floor with bar", "friction"]
    assert (pad.value, pad.rule) == (0.9, "the larger of 0.4 and 0.9")
    assert (bar.value, bar.rule) == (0.2, "of the higher priority, of 0.4 and 0.2")
    assert not [one for one in rows if "shell" in one[0]]
    across = rows["floor with pad", "friction at 45 degrees"].value
    assert across == pytest.approx(0.9 / 2**0.5)
    elliptic = acting(tmp_path, "elliptic")
    assert ("floor with pad", "friction at 45 degrees") not in elliptic
    assert elliptic["floor with pad", "restitution"].value == pytest.approx(0.135335, rel=1e-4)


def test_limits_and_drives_report_their_dynamics(tmp_path: Path) -> None:
    rows = acting(tmp_path)
    assert rows["limits of lift", "damping ratio"].value == pytest.approx(0.3)
    assert rows["limits of lift", "time constant"].value == pytest.approx(0.02)
    weight = rows["drive of lift", "share of force for weight"].value
    assert weight == pytest.approx(9.81 * 0.2 / 4)
    assert rows["drive of lift", "sag"].value == pytest.approx(9.81 * 0.2 / 50)
    assert (rows["drive of lift", "gain over unstable gain"].value or 1) < 1e-2


def test_limit_without_damping_has_no_time_constant(tmp_path: Path) -> None:
    file = tmp_path / "robot.xml"
    text = ROBOT.format(cone="elliptic")
    file.write_text(text.replace('solreflimit="0.02 0.3"', 'solreflimit="-400 0"'))
    result = audit_acting(model_task(prepare_tree(file), "mujoco"))
    rows = {(one.subject, one.quantity): one.value for one in result.acting}
    assert rows["limits of lift", "damping ratio"] == 0
    assert ("limits of lift", "time constant") not in rows


def test_command_prints_a_line_for_each_subject(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    acting(tmp_path)
    assert main(["audit", str(tmp_path / "robot.xml"), "--engine", "mujoco"]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "acts as floor with pad: friction 0.9 (the larger of 0.4 and 0.9)," in out
    assert "acts as drive of lift: largest force 4 N m (the drive is clamped, before" in out
    assert " share of force for weight 0.4905 (as drawn)," in out
