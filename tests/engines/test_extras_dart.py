"""Whole steps of DART: dry friction of joints by its law, and planted faults."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from physics_crosscheck.harness.checks.audit import audit_terms
from physics_crosscheck.harness.checks.case import judge
from physics_crosscheck.harness.checks.law_comparison import LawEngine
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.diagnosis.law_problem import diagnose_laws
from physics_crosscheck.harness.diagnosis.robot_task import diagnose_robot
from physics_crosscheck.records import Outcome
from physics_crosscheck.reference.laws.near_rigid import NearRigidModel
from tests.engines.extras import need
from tests.engines.whole_steps import checked, problem_of
from tests.laws.scenes import URDF_ARM
from tests.models import written

STICKING = 'friction="9"'
"""More than gravity."""

RIGHT, WRONG = 'friction=".1"', 'friction=".1000001"'


@pytest.mark.parametrize("floating", [False, True])
def test_dry_friction_follows_its_law(tmp_path: Path, floating: bool) -> None:
    """Catch another softness, dampers in the mass matrix, or friction that is not a force."""
    check = checked("dart", tmp_path, floating=floating)
    assert check.judgement is not None
    assert check.record.outcome is Outcome.AGREES
    assert check.judgement.largest_discrepancy < 1e-12
    assert check.record.next_state is not floating
    assert {term.name for term in check.record.acted} == {"dry friction"}
    assert check.record.covered == ("dry friction",)
    assert check.record.uncovered == ("contacts",)
    wrong = checked("dart", tmp_path, URDF_ARM, URDF_ARM.replace(RIGHT, WRONG), floating=floating)
    assert wrong.record.outcome is Outcome.DIFFERS


@pytest.mark.parametrize("change", [{"dry_friction_share": 1e-8}, {"damped_mass": True}], ids=str)
def test_other_rules_are_detected(tmp_path: Path, change: dict[str, Any]) -> None:
    """Catch a setting that the law does not depend on."""
    problem = problem_of("dart", tmp_path, URDF_ARM.replace(RIGHT, STICKING))
    laws = problem.comparison.laws
    assert isinstance(laws, NearRigidModel)
    other = replace(laws, rules=replace(laws.rules, **change))
    engine = LawEngine(problem.comparison.under(other))
    assert problem.of_model(engine).judge(1e-12).outcome is Outcome.DIFFERS


def test_wrong_friction_is_named_with_its_line(tmp_path: Path) -> None:
    """Catch a diagnosis that does not try dry friction, or its mistakes."""
    problem = problem_of("dart", tmp_path)
    copy = written(tmp_path, "wrong.urdf", URDF_ARM.replace(RIGHT, WRONG))
    ranking = diagnose_laws(problem.in_engine(replace(problem.spec, path=copy)))
    assert ranking.explained
    assert "dynamics@friction" in str(ranking.fits[0].causes[0])
    name = "dry friction of joint shoulder is ignored"
    ranking = diagnose_laws(problem.mistaken(name))
    assert ranking.explained
    assert name in [str(cause) for fit in ranking.fits[:1] for cause in fit.causes]


TUMBLING = """<robot name="r"><link name="l0"><inertial>
<origin xyz="0.062380318630556236 0.0016536311734647426 0.025592201384041148"/>
<mass value="0.573376142967912"/><inertia ixx="0.009347127449845" ixy="0" ixz="0"
iyy="0.007607447957258102" iyz="0" izz="0.009942865331375225"/></inertial></link></robot>"""

CRATE = """<sdf version="1.9"><model name="crate"><pose>0 0 0.6 0 0 0</pose><link name="link">
<inertial><mass>1</mass><inertia><ixx>0.01</ixx><iyy>0.01</iyy><izz>0.01</izz></inertia>
</inertial></link></model></sdf>"""


def test_turns_that_some_steps_lose_are_in_the_uncertainty(tmp_path: Path) -> None:
    """Cover a floating root, whose steps below 1e-3 rad lose a cubic term: no difference."""
    need("dart")
    file = written(tmp_path, "r.urdf", TUMBLING)
    task = model_task(prepare_tree(file, floating=True), "dart")
    verdict = judge(task)
    assert (verdict.outcome, verdict.decided_by) == (Outcome.AGREES, "accelerations")
    file.write_text(TUMBLING.replace("0.0093471", "0.0093472"))
    assert judge(task).outcome is Outcome.DIFFERS


def test_audit_takes_lost_turns_for_no_difference(tmp_path: Path) -> None:
    need("dart")
    file = written(tmp_path, "crate.sdf", CRATE)
    findings = audit_terms(model_task(prepare_tree(file), "dart")).findings
    assert {one.severity for one in findings} == {"note"}


ROTOR = """<robot name="r" xmlns:drake="http://drake.mit.edu"><link name="base"/>
<joint name="j" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
</joint>{link}{more}</robot>"""
LINK = """<link name="{}"><inertial><origin xyz="0.1 0 -0.2"/><mass value="1"/>
<inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"/></inertial></link>"""
GEARED = """<transmission><type>SimpleTransmission</type><joint name="j"/><actuator name="m">
<drake:rotor_inertia value="0.0001"/><drake:gear_ratio value="20"/></actuator></transmission>"""
FOLLOWS = """<joint name="k" type="continuous"><parent link="a"/><child link="b"/>
<origin xyz="0 0.1 0.2"/><axis xyz="1 0 0"/><mimic joint="j" multiplier="-1"/></joint>"""


def test_own_behaviour_is_named(tmp_path: Path) -> None:
    need("dart")
    file = tmp_path / "r.urdf"
    file.write_text(ROTOR.format(link=LINK.format("a"), more=LINK.format("b") + FOLLOWS))
    task = model_task(prepare_tree(file, states=8), "dart")
    (explanation,) = diagnose_robot(task, is_reference=True).explanations
    assert "without a reaction on the leader (k)" in str(explanation.causes[0])


@pytest.mark.parametrize(("effort", "acts"), [
    ("", True), ('<limit effort="9" velocity="1"/>', True),
    ('<limit effort="0" velocity="1"/>', False),
])  # fmt: skip
def test_rotors_of_a_transmission_act_in_drake(effort: str, acts: bool, tmp_path: Path) -> None:
    need("drake")
    file = tmp_path / "r.urdf"
    robot = ROTOR.format(link=LINK.format("a"), more=GEARED)
    file.write_text(robot.replace("</joint>", f"{effort}</joint>", 1))
    task = model_task(prepare_tree(file, states=8), "drake")
    assert judge(task).outcome is Outcome.AGREES
    assert (judge(task.with_settings(rotors=False)).outcome is Outcome.DIFFERS) is acts
