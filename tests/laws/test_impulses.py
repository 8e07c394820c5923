"""Whole steps of PyBullet against the law of its impulses: agreement, and planted faults."""

from __future__ import annotations

from pathlib import Path

import pytest

from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.findings import STANDALONE_SETTINGS
from physics_crosscheck.harness.checks.prepare import prepare
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.checks.whole_step import WholeStepCheck, check_whole_step
from physics_crosscheck.harness.engines.protocol import ModelSpec
from physics_crosscheck.harness.engines.urdf import SETTINGS
from physics_crosscheck.harness.records.outcome import Outcome

pytest.importorskip("pybullet")

_INERTIAL = (
    '<inertial><origin xyz="{}"/><mass value="{}"/>'
    '<inertia ixx=".03" iyy=".02" izz=".025" ixy="0" ixz="0" iyz="0"/></inertial>'
)
_SHAPE = (
    '<collision><origin xyz="{}"/><geometry><{}/></geometry></collision>'
    '<contact><lateral_friction value="{}"/><restitution value=".6"/>{}</contact>'
)

ARM = f"""<robot name="arm"><link name="base">{_INERTIAL.format("0 0 0", 1)}</link>
<link name="upper">{_INERTIAL.format(".15 0 .02", 1.5)}
{_SHAPE.format(".3 0 0", 'sphere radius=".1"', 0.1, "")}</link>
<link name="lower">{_INERTIAL.format(".1 0 0", 0.8)}
{_SHAPE.format(".2 0 0", 'sphere radius=".08"', 0.03, "")}</link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
<axis xyz="0 1 0"/><limit lower="-1" upper=".7" effort="7" velocity="9"/>
<dynamics damping=".2" friction=".1"/></joint>
<joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/>
<origin xyz=".3 0 0"/><axis xyz="0 1 0"/><limit lower="-.4" upper=".4" effort="900" velocity="9"/>
</joint></robot>"""
"""The elbow has no limit, but PyBullet moves the targets of its motor into this range."""

BOX = f"""<robot name="box"><link name="body">{_INERTIAL.format(".01 0 .02", 2)}
{_SHAPE.format("0 0 0", 'box size=".3 .2 .1"', 0.7, "")}</link>
<link name="wheel">{_INERTIAL.format("0 0 0", 0.3)}
{
    _SHAPE.format(
        "0 0 0", 'sphere radius=".07"', 0.9, '<stiffness value="30000"/><damping value="500"/>'
    )
}</link>
<joint name="axle" type="continuous"><parent link="body"/><child link="wheel"/>
<origin xyz=".3 0 0"/><axis xyz="0 1 0"/></joint></robot>"""


def checked(tmp_path: Path, text: str, loaded: str = "") -> WholeStepCheck:
    """Compare the law of a text with the engine on the same text or another one."""
    file, copy = tmp_path / "robot.urdf", tmp_path / "copy.urdf"
    file.write_text(text)
    copy.write_text(loaded or text)
    settings = {**SETTINGS, **STANDALONE_SETTINGS, "floating": "box" in text}
    check = check_whole_step(file, ModelSpec(copy, settings=settings), "pybullet", 1e-9)
    assert check is not None
    return check


@pytest.mark.parametrize(
    ("text", "kinds"),
    [(ARM, {"limits", "motors", "motors at a limit"}), (BOX, {"contacts"})],
    ids=["arm", "box"],
)
def test_impulses_follow_their_law(tmp_path: Path, text: str, kinds: set[str]) -> None:
    """Catch a target, a bound, a cone or an order of rows that is stated wrong."""
    check = checked(tmp_path, text)
    assert check.judgement is not None
    assert check.record.outcome is Outcome.AGREES
    assert check.judgement.largest_discrepancy < 1e-10
    assert check.record.states >= 20
    assert {term.name for term in check.record.acted} == kinds


FAULTS = {
    "lower limit": (ARM.replace("900", "0"), 'lower="-1"', 'lower="-1.000001"'),
    "upper limit": (ARM, 'upper=".7"', 'upper=".7000007"'),
    "effort": (ARM, 'effort="7"', 'effort="7.00001"'),
    "lost effort": (ARM, 'effort="900"', 'effort="0"'),
    "range of targets": (ARM, 'upper=".4"', 'upper=".400001"'),
    "friction of a floating body": (BOX, 'friction value="0.9"', 'friction value="0.9000009"'),
    "restitution": (BOX, 'restitution value=".6"', 'restitution value=".6000006"'),
    "shape": (BOX, 'damping value="500"', 'damping value="500.001"'),
    "stiffness": (BOX, 'stiffness value="30000"', 'stiffness value="30000.1"'),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_millionth_of_each_number_is_seen(tmp_path: Path, fault: str) -> None:
    """Catch a number of the law that the comparison does not depend on."""
    text, right, wrong = FAULTS[fault]
    assert right in text
    check = checked(tmp_path, text, text.replace(right, wrong, 1))
    assert check.record.outcome is Outcome.DIFFERS


def test_a_case_differs_where_only_its_limit_does(tmp_path: Path) -> None:
    """Catch a case whose smooth motion agrees and that hides a limit that differs."""
    file, copy = tmp_path / "arm.urdf", tmp_path / "copy.urdf"
    file.write_text(ARM)
    copy.write_text(ARM.replace('upper=".7"', 'upper=".71"'))
    assert run_case(model_task(prepare(file, states=4), "pybullet")).outcome is Outcome.AGREES
    whole = run_case(model_task(prepare(file, states=4), "pybullet").with_file(copy))
    assert (whole.outcome, whole.code) == (Outcome.DIFFERS, "XC305")
    smooth = run_case(model_task(prepare(file, states=4, smooth=True), "pybullet").with_file(copy))
    assert (smooth.outcome, smooth.whole_step) == (Outcome.AGREES, None)


def test_full_runs_follow_whole_steps(tmp_path: Path) -> None:
    """Catch whole steps that unload the model before its full runs."""
    file = tmp_path / "arm.urdf"
    file.write_text(ARM.replace("900", "0"))
    case = run_case(model_task(prepare(file, states=4, motion=0.05), "pybullet"))
    assert case.outcome is Outcome.AGREES
    assert case.full_run is not None
    assert case.whole_step is not None
