"""The law of soft rows for URDFs in MuJoCo; scenes of `test_whole_step.py` cover its parts."""

from dataclasses import replace
from pathlib import Path

import pytest

from physics_crosscheck.engine import ModelSpec
from physics_crosscheck.harness.checks.acting import urdf_quantities
from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.findings import STANDALONE_SETTINGS
from physics_crosscheck.harness.diagnosis.law_problem import diagnose_laws
from physics_crosscheck.harness.engines.urdf import SETTINGS
from physics_crosscheck.records import Outcome
from tests.compare.asking import compared, laws
from tests.engines.whole_steps import checked, problem_of
from tests.laws.scenes import URDF_ARM, URDF_BOX, URDF_LEG
from tests.models import robot_task, written

FIXED_BALL = """<link name="ball"><collision><geometry><sphere radius=".05"/></geometry></collision>
</link><joint name="weld" type="fixed"><parent link="lower"/><child link="ball"/>
<origin xyz=".2 0 0"/></joint></robot>"""
BARE = URDF_ARM.replace("</robot>", FIXED_BALL)
"""A link without `<inertial>` that MuJoCo gives the mass of its sphere."""


@pytest.mark.parametrize(
    ("text", "floating", "kinds"),
    [
        pytest.param(URDF_ARM, False, {"limits", "dry friction"}, id="arm"),
        pytest.param(URDF_LEG, True, {"limits", "contacts"}, id="leg"),
        pytest.param(URDF_BOX, True, {"contacts"}, id="box"),
        pytest.param(BARE, True, {"limits", "dry friction", "contacts"}, id="bare"),
    ],
)
def test_urdf_follows_the_soft_law(
    tmp_path: Path, text: str, floating: bool, kinds: set[str]
) -> None:
    """Catch another softness, weight, mixing or body of a shape, and a free root's next state."""
    check = checked("mujoco", tmp_path, text, floating=floating)
    assert check.judgement is not None
    assert check.record.outcome is Outcome.AGREES
    assert check.judgement.largest_discrepancy < 1e-12
    assert check.record.next_state
    assert not check.record.uncovered
    assert {term.name for term in check.record.acted} == kinds


@pytest.mark.parametrize(
    ("right", "wrong"),
    [('upper=".7"', 'upper=".7000007"'), ('friction=".1"', 'friction=".1000001"'),
     ('damping=".2"', 'damping=".2000002"'), ('lower="-1" upper=".7" ', ""),
     ('friction=".1"', "")],
)  # fmt: skip
def test_wrong_number_is_detected(tmp_path: Path, right: str, wrong: str) -> None:
    """Catch a number of a URDF that the soft law does not depend on, or takes from MuJoCo."""
    assert URDF_ARM.count(right) == 1
    check = checked("mujoco", tmp_path, URDF_ARM, URDF_ARM.replace(right, wrong))
    assert check.record.outcome is Outcome.DIFFERS


@pytest.mark.parametrize(
    ("right", "wrong"), [('upper=".4"', 'upper=".1"'), ('effort="7"', 'effort="70"')]
)
def test_number_without_effect_agrees(tmp_path: Path, right: str, wrong: str) -> None:
    """Catch limits of a continuous joint, or of an effort that nothing exerts."""
    assert URDF_ARM.count(right) == 1
    check = checked("mujoco", tmp_path, URDF_ARM, URDF_ARM.replace(right, wrong))
    assert check.record.outcome is Outcome.AGREES


def test_equal_bounds_are_no_limit(tmp_path: Path) -> None:
    """Catch a law that locks a joint whose limits MuJoCo ignores."""
    text = URDF_ARM.replace('lower="-1" upper=".7"', 'lower="0" upper="0"')
    check = checked("mujoco", tmp_path, text)
    assert check.record.outcome is Outcome.AGREES
    assert "limits" not in {term.name for term in check.record.acted}


def test_parts_without_a_law_are_named(tmp_path: Path) -> None:
    """Catch a verdict on whole steps that hides contacts of meshes."""
    text = URDF_LEG.replace('sphere radius=".1"', 'mesh filename="no.obj"')
    check = checked("mujoco", tmp_path, text, floating=True)
    assert check.record.uncovered == ("contacts of meshes",)


@pytest.mark.parametrize(
    ("right", "wrong", "address"),
    [('upper=".7"', 'upper=".7000007"', "joint[shoulder]/limit@upper"),
     ('friction=".1"', 'friction=".1000001"', "joint[shoulder]/dynamics@friction")],
)  # fmt: skip
def test_wrong_number_is_named(tmp_path: Path, right: str, wrong: str, address: str) -> None:
    """Catch a diagnosis that does not try the numbers of a soft URDF."""
    problem = problem_of("mujoco", tmp_path)
    file = written(tmp_path, "wrong.urdf", URDF_ARM.replace(right, wrong))
    ranking = diagnose_laws(problem.in_engine(replace(problem.spec, path=file)))
    assert ranking.explained
    (cause,) = ranking.fits[0].causes
    assert cause.subject == (address,)


def test_masses_from_shapes_are_named(tmp_path: Path) -> None:
    """Catch a link without `<inertial>` whose mass in MuJoCo no check sees."""
    task = robot_task(tmp_path, "robot.urdf", BARE)
    assert run_case(task).outcome is Outcome.DIFFERS
    (cause, remedy), *others = task.load()[0].corrective_settings.items()
    assert cause == "MuJoCo's masses from the shapes of a link without <inertial> (ball, line 11)"
    assert remedy == {"shape_masses": False}
    assert not others
    without = run_case(task.with_settings(shape_masses=False))
    assert without.outcome is Outcome.AGREES


def test_numbers_act_as_stated(tmp_path: Path) -> None:
    """Catch quantities of a URDF that MuJoCo has without its numbers."""
    file = written(tmp_path, "leg.urdf", URDF_LEG)
    settings = {**SETTINGS, **STANDALONE_SETTINGS, "floating": True}
    rows = urdf_quantities(ModelSpec(file, settings=settings), "mujoco")
    values = {(row.subject, row.quantity): row.value for row in rows}
    assert values["ground with shin", "friction"] == 1.0
    assert values["limits of hip", "time constant"] == pytest.approx(0.02)


def test_limits_of_urdf_and_mjcf_are_compared(tmp_path: Path) -> None:
    """Catch limits that a conversion from URDF to MJCF loses, and a joint in another order."""
    swing = """<mujoco><worldbody><body><joint name="other" axis="0 1 0"/>
    <inertial mass="1" pos=".1 0 0" diaginertia=".01 .02 .02"/></body>
    <body><joint name="hip" axis="0 1 0"/>
    <inertial mass="1" pos=".1 0 0" diaginertia=".01 .02 .02"/></body></worldbody></mujoco>"""
    link = """<link name="{0}l"><inertial><origin xyz=".1 0 0"/><mass value="1"/><inertia ixx=".01"
    iyy=".02" izz=".02" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="{0}" type="{1}">
    <parent link="base"/><child link="{0}l"/><axis xyz="0 1 0"/>{2}</joint>"""
    limit = '<limit lower="-1" upper=".5" effort="1" velocity="1"/>'
    (tmp_path / "a.xml").write_text(swing)
    (tmp_path / "b.urdf").write_text(
        f'<robot name="r"><link name="base"/>{link.format("hip", "revolute", limit)}'
        f"{link.format('other', 'continuous', '')}</robot>"
    )
    (row,) = laws(tmp_path / "a.xml", tmp_path / "b.urdf", "mujoco", "mujoco")
    assert row.about == "joint hip"
    assert row.effect
    assert row.effect > 1e-3
    same = swing.replace('"hip" axis', '"hip" range="-1 .5" axis')
    (tmp_path / "a.xml").write_text(f'<mujoco><compiler angle="radian"/>{same[8:]}')
    same_files = compared(tmp_path / "a.xml", tmp_path / "b.urdf", "mujoco", "mujoco")
    assert same_files.outcome is Outcome.AGREES
