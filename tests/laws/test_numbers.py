"""Numbers that whole steps depend on: the diagnosis of a step that differs from its law."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.diagnosis.law_problem import law_problem
from physics_crosscheck.harness.diagnosis.robot_task import diagnose_robot
from physics_crosscheck.records import Diagnosis
from tests.coverage.test_robot import STOP
from tests.laws.scenes import LIMITS, URDF_ARM, URDF_BOX

BOX = """<mujoco><option {}/><worldbody>
<geom name="floor" type="plane" size="3 3 .1" friction=".7 .02 .003"/>
<body pos="0 0 .05"><freejoint/>
<geom type="box" size=".1 .07 .05" mass="1" friction=".5 .05 .001"/></body></worldbody></mujoco>"""
OPTIONS = 'integrator="implicitfast" cone="elliptic"'
OTHER_ROWS = "range, where other rows act"
FAULTS = {
    "range": (STOP, "-60 40", "-60 40.00004", "joint[a]@range[1]", 40.00004),
    OTHER_ROWS: (STOP, "-60 40", "-60.6 40", "joint[a]@range[0]", -60.6),
    "frictionloss": (STOP, 'loss="0.3"', 'loss="0.303"', "joint[a]@frictionloss", 0.303),
    "solimp": (LIMITS, ".97 .05", ".9700097 .05", "joint[a]@solimplimit[1]", 0.9700097),
    "friction": (BOX, 'friction=".7', 'friction=".7000007', "geom[floor]@friction[0]", 0.7000007),
    "solref": (LIMITS, '"-800', '"-808', "joint[a]@solreflimit[0]", -808),
}  # fmt: skip


def diagnosed(tmp_path: Path, text: str, loaded: str) -> Diagnosis:
    """Diagnose an engine that acts by another text."""
    file, copy = tmp_path / "scene.xml", tmp_path / "copy.xml"
    file.write_text(text)
    copy.write_text(loaded)
    task = model_task(prepare_tree(file, states=4), "mujoco")
    return diagnose_robot(task.with_file(copy), is_reference=True)


@pytest.mark.parametrize("fault", FAULTS)
def test_wrong_number_and_its_value_are_named(
    tmp_path: Path, request: pytest.FixtureRequest, fault: str
) -> None:
    """Catch a cause without a line, another number, or another value."""
    if fault != OTHER_ROWS:
        request.getfixturevalue("few_states")
    scene, right, wrong, address, value = FAULTS[fault]
    scene = scene.format(OPTIONS)
    assert right in scene
    diagnosis = diagnosed(tmp_path, scene, scene.replace(right, wrong, 1))
    assert diagnosis.explained
    (cause,) = diagnosis.explanations[0].causes
    assert cause.subject[0].endswith(address)
    assert cause.estimate == pytest.approx(value, rel=1e-7)
    (place,) = cause.locations
    assert place.line == scene[: scene.index(right)].count("\n") + 1 + ("\n" in right)
    assert place.span is not None


def test_steps_that_agree_have_no_cause(tmp_path: Path) -> None:
    """Catch a diagnosis that names a number although nothing differs."""
    assert diagnosed(tmp_path, STOP, STOP).explanations == ()


HARD_FAULTS = {
    "limit": (URDF_ARM, 'upper=".7"', 'upper=".71"', "joint[shoulder]/limit@upper", 0.71),
    "effort": (URDF_ARM, 'effort="7"', 'effort="7.00001"', "joint[shoulder]/limit@effort", 7.00001),
    "restitution": (URDF_BOX, 'restitution value=".6"', 'restitution value=".6000006"',
                    "link[body]/contact/restitution@value", 0.6000006),
}  # fmt: skip


@pytest.mark.parametrize(
    "fault", ["limit", "effort", pytest.param("restitution", marks=pytest.mark.slow)]
)
def test_number_of_impulses_and_its_value_are_named(tmp_path: Path, fault: str) -> None:
    """Catch a cause without a line, another number, or another value."""
    pytest.importorskip("pybullet")
    text, right, wrong, address, value = HARD_FAULTS[fault]
    file, copy = tmp_path / "robot.urdf", tmp_path / "copy.urdf"
    file.write_text(text)
    copy.write_text(text.replace(right, wrong, 1))
    floating = text == URDF_BOX
    task = model_task(prepare_tree(file, states=4, floating=floating), "pybullet")
    diagnosis = diagnose_robot(task.with_file(copy), is_reference=True)
    assert diagnosis.explained
    (cause,) = diagnosis.explanations[0].causes
    assert cause.subject == (address,)
    assert cause.estimate == pytest.approx(value, rel=1e-7)
    (place,) = cause.locations
    assert place.line == text[: text.index(right)].count("\n") + 1


@pytest.mark.parametrize(
    ("text", "floating"), [(URDF_ARM, False), pytest.param(URDF_BOX, True, marks=pytest.mark.slow)]
)
def test_cached_effect_equals_a_new_solution(tmp_path: Path, text: str, floating: bool) -> None:
    """Catch a known solution that is kept although a number changes it."""
    pytest.importorskip("pybullet")
    file = tmp_path / "robot.urdf"
    file.write_text(text)
    task = model_task(prepare_tree(file, states=4, floating=floating), "pybullet")
    problem: Any = law_problem(task)
    acted = 0
    evaluated = problem.evaluated[::2]
    before = problem.comparison.expected_by(problem.comparison.laws, evaluated)
    for i in problem.numbers.law_numbers:
        laws = problem.numbers.laws({i: (0.5, 1.01)[i % 2] * problem.numbers.numerals[i].value})
        assert laws is not None
        kept = problem.comparison.expected_by(laws, evaluated)
        # A new tree is solved from the start.
        solved = problem.comparison.expected_by(replace(laws, tree=replace(laws.tree)), evaluated)
        assert kept == pytest.approx(solved, rel=1e-11, abs=1e-11)
        acted += not np.allclose(kept, before, rtol=1e-9, atol=1e-9)
    assert acted >= 4
