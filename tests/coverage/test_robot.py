"""Numbers of a robot's file that its motions depend on, counted by the equations."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock
from xml.parsers import expat

import pytest

from physics_crosscheck.harness.checks.audit import audit_terms
from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.findings import negative_findings
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.diagnosis.coverage import (
    NumberEffect,
    count_robot,
    counted_numbers,
    summarized,
)
from physics_crosscheck.harness.diagnosis.robot_task import diagnose_bodies
from physics_crosscheck.harness.documents import reading
from physics_crosscheck.harness.engines.registry import engines, engines_reading
from physics_crosscheck.harness.jobs.limits import Limits
from physics_crosscheck.harness.jobs.workers import Failure, Workers
from physics_crosscheck.harness.modelfiles.mjcf.numbers import CompiledNumbers
from physics_crosscheck.harness.modelfiles.readers import robot_numbers
from tests.models import written
from tests.robots.files import joint, link

CASES = Path(__file__).parents[2] / "docs" / "cases"
PLACE = '<origin xyz="0 0 0.25"/><axis xyz="0 1 0"/>'
LIMIT = '<limit lower="-1" upper="1" effort="5" velocity="2"/>'
TEXT = "\n".join(
    [
        '<robot name="written">',
        link("base"),
        joint("a", "base", "one", PLACE + LIMIT, "revolute"),
        link("one"),
        "</robot>",
    ]
)


@pytest.mark.parametrize(("name", "engine"), [("arm.urdf", "pybullet"), ("arm.xml", "mujoco")])
def test_process_opens_and_parses_a_file_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, engine: str
) -> None:
    """Catch a reader that parses by itself, and lines of bodies that the page reads again."""
    if engines()[engine].version() is None:
        pytest.skip(f"{engine} is not installed")
    create, read, opened = Mock(side_effect=expat.ParserCreate), Path.read_bytes, list[Path]()
    monkeypatch.setattr(expat, "ParserCreate", create)

    def counted(path: Path) -> bytes:
        opened.append(path)
        return read(path)

    monkeypatch.setattr(Path, "read_bytes", counted)
    monkeypatch.setattr(reading, "SETTLED_SECONDS", -1.0)
    file = written(tmp_path, name, (CASES / name).read_text())
    task = model_task(prepare_tree(file), engine)
    assert [*negative_findings(file)] == []
    for step in (run_case, audit_terms, count_robot, diagnose_bodies):
        step(task)
    assert (create.call_count, opened.count(file)) == (1, 1)


@pytest.mark.parametrize("engine", [one.name for one in engines_reading(".urdf")])
def test_numbers_without_effect_are_listed_by_name(tmp_path: Path, engine: str) -> None:
    file = written(tmp_path, "r.urdf", TEXT)
    counted = count_robot(model_task(prepare_tree(file), engine))
    assert counted.numbers == 3 + 1 + 6 + 3 + 3 + 4 + 3 + 1 + 6
    assert counted.seen + sum(one.count for one in counted.untested) == counted.numbers
    by_reason = {one.reason: one for one in counted.untested}
    counts = {reason: one.count for reason, one in by_reason.items()}
    # Whole steps of these engines have a law for a URDF; PyBullet alone has drives.
    in_steps = engine in ("mujoco", "mjx", "pybullet", "drake")
    in_steps &= engines()[engine].version() is not None
    assert counts.get("joint limits", 0) == (0 if in_steps else 2)
    assert counts.get("actuator limits", 0) == (0 if engine == "pybullet" else 1)
    assert counts["velocity limits"] == 1
    # All ten numbers of the fixed link, each by its name.
    still = by_reason[NumberEffect.FIXED.value].examples
    assert len(still) == counts[NumberEffect.FIXED.value] == 10
    assert "link[base]/inertial/mass@value" in still
    untested = by_reason[NumberEffect.NONE.value].examples
    assert len(untested) == counts[NumberEffect.NONE.value]
    # Moments about other axes have no effect; position, rotation and axis sign of the joint show
    # only in poses.
    assert "link[one]/inertial/inertia@ixx" in untested
    assert counted.frames == 5
    assert not {"link[one]/inertial/mass@value", "joint[a]/origin@xyz[2]",
                "link[one]/inertial/inertia@iyy", "link[one]/inertial/origin@xyz[2]",
                "joint[a]/axis@xyz[2]"} & set(untested)  # fmt: skip


SDF = """<sdf version="1.9"><world name="w">{}</world></sdf>"""
MODEL = """<model name="{}">
<joint name="weld" type="fixed"><parent>world</parent><child>base</child></joint>
<link name="base"><inertial><mass>2</mass></inertial></link>
<joint name="q" type="revolute"><parent>base</parent><child>arm</child>
<axis><xyz>0 1 0</xyz></axis></joint>
<link name="arm"><inertial><pose>0.2 0 0 0 0 0</pose><mass>3</mass></inertial></link></model>"""


@pytest.mark.parametrize("engine", [one.name for one in engines_reading(".sdf")])
def test_fixed_links_are_those_of_the_chosen_model(tmp_path: Path, engine: str) -> None:
    file = written(tmp_path, "r.sdf", SDF.format(MODEL.format("one") + MODEL.format("two")))
    counted = count_robot(model_task(prepare_tree(file, model="two"), engine))
    counts = {one.reason: one.count for one in counted.untested}
    assert counts[NumberEffect.FIXED.value] == 1


MJCF = """<mujoco><size memory="400M" nkey="1"/><option timestep="0.001"/>
<default><geom friction="0.8"/></default>
<worldbody><camera pos="0 0 3"/>
<body name="a"><joint name="a" axis="0 1 0" range="-1 1" frictionloss="0.2"/>
<geom size="0.1" pos="0 0 -0.3" contype="1" mass="1.3"/><site name="s" pos="0 0 -0.6"/>
<body name="b" pos="0 0 -0.6"><joint name="b" axis="0 1 0" solreflimit="0.02 1"/>
<geom size="0.1" pos="0 0 -0.3" mass="0.7" rgba="1 0 0 1"/></body></body></worldbody>
<equality><connect body1="b" anchor="0 0 -0.3" solref="0.01 1"/></equality>
<actuator><motor joint="a" ctrlrange="-1 1"/></actuator>
<sensor><jointpos joint="a" noise="0.1"/></sensor>
<custom><numeric name="n" data="1 2"/></custom>
<keyframe><key qpos="0.1 0.2"/></keyframe></mujoco>"""


def test_each_kind_of_number_has_its_own_reason(tmp_path: Path) -> None:
    file = written(tmp_path, "r.xml", MJCF)
    counted = count_robot(model_task(prepare_tree(file), "mujoco"))
    counts = {one.reason: one.count for one in counted.untested}
    # Along the axis of the joint above: the body, two geoms; the site; signs of two axes.
    assert counted.frames == 6 + 2
    # As compiled: two contact parameters and an anchor that act at no state.
    assert (counted.audit, counted.read) == (0, 3)
    assert counts == {
        "visual geometry": 3 + 4,
        "joint limits": 2,
        "sensors": 1,
        "user data": 2,
        "keyframes": 2,
        "memory sizes": 1,
    }


def test_memory_shortage_fails_the_count(tmp_path: Path) -> None:
    file = written(tmp_path, "r.xml", MJCF)
    task = model_task(prepare_tree(file), "mujoco")
    limits = Limits(memory=0.2)
    with Workers(1, limits=limits) as workers:
        outcome = workers.outcome(workers.submit(count_robot, task))
    assert isinstance(outcome, Failure)
    assert outcome.reason == limits.full


def test_number_that_cannot_change_is_not_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = written(tmp_path, "r.xml", MJCF)
    task = model_task(prepare_tree(file), "mujoco")
    compiled = CompiledNumbers._compile
    monkeypatch.setattr(
        CompiledNumbers, "_compile", lambda self, values: None if values else compiled(self, {})
    )
    counted = count_robot(task)
    assert counted.motion == 0
    reasons = {one.reason: one.count for one in counted.untested}
    assert set(reasons) == {NumberEffect.REFUSED.value, "memory sizes"}


STOP = """<mujoco><option timestep="0.002"/><worldbody><body><joint name="a" axis="0 1 0"
 range="-60 40" frictionloss="0.3" damping="0.1"/>
<geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03" mass="1"/></body></worldbody></mujoco>"""


def test_numbers_that_act_in_whole_steps_count_as_tested(tmp_path: Path) -> None:
    """Catch a limit or dry friction that acts and is listed, or is counted with --smooth."""
    file = written(tmp_path, "r.xml", STOP)
    whole = count_robot(model_task(prepare_tree(file), "mujoco"))
    smooth = count_robot(model_task(replace(prepare_tree(file), smooth=True), "mujoco"))
    assert whole.motion == smooth.motion + 2 + 1 + 1  # range, frictionloss, time step
    assert {one.reason for one in smooth.untested} > {one.reason for one in whole.untested}


READ = """<mujoco><default><geom friction=".8 .1"/><joint damping=".1"/></default><worldbody>
<geom type="plane" size="3 3 .1" priority="1" solmix="2"/><body pos="0 0 1">
<joint name="a" axis="0 2 0" damping=".2" margin=".01"/><geom size=".1" friction=".5"/></body>
</worldbody></mujoco>"""


def test_numbers_of_the_text_and_directions_of_axes_count(tmp_path: Path) -> None:
    """Catch numbers that only the reading of the text, or a reversed axis, would show."""
    pytest.importorskip("mujoco")
    file = written(tmp_path, "r.xml", READ)
    task = model_task(prepare_tree(file), "mujoco")
    counted = counted_numbers(task, robot_numbers(file, task.spec.settings))
    by_address = {one.address: one for one in counted}
    read = {address for address, one in by_address.items() if one.read}
    assert "mujoco/default/geom@friction[1]" in read, read
    assert "mujoco/default/joint@damping" not in read  # overwritten
    whole = summarized(counted, {})
    assert whole.read
    assert whole.seen + whole.read + sum(one.count for one in whole.untested) == whole.numbers
    axis = by_address["joint[a]@axis[1]"]
    assert axis.effect is NumberEffect.FRAMES
    smooth = {address for address, one in by_address.items() if one.smooth}
    assert "joint[a]@damping" in smooth
    assert axis.address in smooth
    assert by_address["mujoco/default/joint@damping"].effect is NumberEffect.NONE


SHARED = """<mujoco><default><geom solref=".02 .9"/></default><worldbody>
<geom type="plane" size="3 3 .1" solref=".02 1"/><body pos="0 0 .1"><freejoint/>
<geom type="box" size=".1 .1 .1"/>{}</body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("more", "effect"),
    [("", NumberEffect.MOTION), ('<geom size=".001" mass="1"/>', NumberEffect.PARTLY)],
)
def test_default_counts_if_it_acts_at_each_element(
    tmp_path: Path, more: str, effect: NumberEffect
) -> None:
    """Catch a default that counts as tested though a shape that takes it never touches."""
    pytest.importorskip("mujoco")
    file = written(tmp_path, "r.xml", SHARED.format(more))
    task = model_task(prepare_tree(file), "mujoco")
    counted = counted_numbers(task, robot_numbers(file, task.spec.settings))
    assert {one.effect for one in counted if "/default" in one.path} == {effect}
