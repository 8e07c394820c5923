"""Wrong couplings of joints are named with their line."""

from pathlib import Path

import pytest

from physics_crosscheck.harness.checks.case import judge
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.diagnosis.robot_task import diagnose_robot
from physics_crosscheck.harness.modelfiles.numbers import copy_with_texts
from physics_crosscheck.harness.modelfiles.readers import robot_numbers
from physics_crosscheck.records import Outcome
from tests.models import written
from tests.robots.files import joint, link

MJCF = """<mujoco><compiler angle="radian"/><worldbody>
<body pos="0 0 1"><joint name="a" axis="0 1 0" damping="0.1"/>
<inertial pos="0.1 0.02 -0.2" mass="1.5" diaginertia="0.02 0.03 0.015"/>
<body pos="0 0 -0.5"><joint name="b" axis="0 1 0"/>
<inertial pos="0.05 0 -0.2" mass="0.8" diaginertia="0.01 0.012 0.008"/>
<body pos="0 0.1 -0.4"><joint name="c" axis="1 0 0"/>
<inertial pos="0.02 0.03 -0.1" mass="0.5" diaginertia="0.004 0.005 0.003"/>
</body></body></body></worldbody>
<tendon><fixed name="t"><joint joint="c" coef="2"/><joint joint="b" coef="0.3"/></fixed></tendon>
<equality>
{}
</equality></mujoco>
"""

URDF = "\n".join(
    [
        '<robot name="follows">',
        link("base", ""),
        joint("a", "base", "one", '<origin xyz="0 0 0.25"/><axis xyz="0 1 0"/>'),
        link("one"),
        joint("b", "one", "two", '<origin xyz="0 0 -1"/><dynamics damping="0.5"/>'),
        link("two"),
        joint("c", "two", "three", '<axis xyz="0 1 0"/><mimic joint="a" multiplier="0.7"/>'),
        link("three"),
        "</robot>",
    ]
)


def check_named(file: Path, engine: str, address: str, share: float) -> None:
    """Change a number of a file for the engine only, and check the diagnosis."""
    prepared = prepare_tree(file, states=8)
    numbers = robot_numbers(file, prepared.settings)
    (index,) = (i for i, one in enumerate(numbers.numerals) if one.address == address)
    entry = numbers.numerals[index]
    (file.parent / "wrong").mkdir()
    copy = copy_with_texts(file, numbers.texts({index: entry.value + share}), file.parent / "wrong")
    task = model_task(prepared, engine).with_file(copy)
    assert judge(task).outcome is Outcome.DIFFERS
    diagnosis = diagnose_robot(task, is_reference=False)
    assert diagnosis.explained
    (cause,) = diagnosis.explanations[0].causes
    assert cause.subject == (address,)
    assert [where.line for where in cause.locations] == [entry.line]
    assert cause.estimate == pytest.approx(entry.value, abs=1e-3 * share)


@pytest.mark.slow
def test_wrong_number_of_an_equality_is_named(tmp_path: Path) -> None:
    file = written(tmp_path, "r.xml", MJCF.format('<tendon tendon1="t" polycoef="0.2 0 0 0 0"/>'))
    check_named(file, "mujoco", "mujoco/equality/tendon@polycoef[0]", 1e-6)


def test_wrong_multiplier_of_a_mimic_is_named(tmp_path: Path) -> None:
    file = written(tmp_path, "r.urdf", URDF)
    check_named(file, "mujoco", "mimic[a]@multiplier", 1e-6)
