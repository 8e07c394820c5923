"""Every number of a model's files is counted once: by what sees it, or by why nothing does."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace as replace_fields

from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import SystemTask, model_task
from physics_crosscheck.harness.diagnosis import coverage as trials
from physics_crosscheck.harness.diagnosis.coverage import (
    NumberEffect,
    count_numbers,
    count_robot,
    counted_numbers,
    summarized,
)
from physics_crosscheck.harness.engines.registry import engines, engines_reading
from physics_crosscheck.harness.jobs.workers import Failure, Limits, Workers
from physics_crosscheck.harness.modelfiles.locations import literals
from physics_crosscheck.harness.modelfiles.mjcf.numbers import CompiledNumbers
from physics_crosscheck.harness.modelfiles.readers import robot_numbers
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.harness.numerics.coordinates import coordinate_map
from physics_crosscheck.harness.records.coverage import Coverage, Untested
from physics_crosscheck.harness.records.finding import BEYOND
from physics_crosscheck.harness.records.poses import FramePose, Poses
from physics_crosscheck.harness.render.html import overview
from physics_crosscheck.harness.results.coverage import coverage_line, coverage_lines, unread_line
from physics_crosscheck.records import AuditFinding, Model
from tests.models import written
from tests.poses.arm import SWING
from tests.robots.files import joint, link

MJCF = """<mujoco><option timestep="0.002" gravity="0 0 0"/><visual><global fovy="30"/></visual>
<worldbody><light pos="0 0 3"/>
<body name="rod" pos="0 0 2"><joint name="a" type="hinge" axis="0 -1 0" damping="0.3"/>
<inertial pos="0 0 -0.4" mass="1" diaginertia="1 1.5 2"/>
<geom size="0.2" contype="0" conaffinity="0" mass="0"/><site name="end" pos="0 0 -0.8"/></body>
</worldbody></mujoco>"""
SIDECAR = """engines = ["mujoco"]
[settings.mujoco]
integrator = "Euler"
[bindings]
"body[rod]/inertial@diaginertia[0]" = "2*J/0.6"
[frames]
world = { origin = [0, 0, 2] }
rod = "body:rod"
end = "site:end"
"""


@pytest.fixture
def task(tmp_path: Path) -> SystemTask:
    (tmp_path / "rod.xml").write_text(MJCF)
    (tmp_path / "rod.xml.toml").write_text(SIDECAR)
    states = np.random.default_rng(0).uniform(-1, 1, (30, 2))
    target: Any = SimpleNamespace(system=SWING, visited=states)
    target.spec = lambda sidecar, engine: sidecar.spec(engine)
    target.under_laws = lambda sidecar: target
    target.coordinates = lambda sidecar, file, engine, there: coordinate_map(SWING, sidecar, there)
    return model_task(target, "mujoco", read_sidecar(tmp_path / "rod.xml.toml"))


def test_numbers_are_counted_by_check(task: SystemTask) -> None:
    counts = count_numbers(task)
    assert counts.numbers == len(literals(task.declared.model)) == 29
    # Gravity along x and z, two entries of the axis, the damper; centre, mass and moment about y.
    assert (counts.motion, counts.audit) == (9, 1)
    # Positions of the body and the site, and the axis's sign, which no motion shows.
    assert counts.frames == 7
    assert counts.seen + sum(one.count for one in counts.untested) == counts.numbers
    reasons = {one.reason: one.count for one in counts.untested}
    assert reasons["visual geometry"] == 4
    assert reasons["contact parameters"] == 2
    assert reasons["collision and visual shapes"] == 2
    assert reasons["time step"] == 1


def test_numbers_of_a_family_are_tried_together(
    task: SystemTask, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried: list[int] = []
    each = trials.Trials._tried

    def record(self: trials.Trials, words: dict[int, str]) -> trials.NumberEffect:
        tried.append(len(words))
        return each(self, words)

    monkeypatch.setattr(trials.Trials, "_tried", record)
    count_numbers(task)
    # Lights, sizes and the step are tried together, switches separately.
    assert tried[0] == 6


def test_numbers_not_tried_in_time_are_reported(
    task: SystemTask, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trials, "PATIENCE", -1.0)
    (first, *_) = count_numbers(task).untested
    assert first.reason == "not counted: out of time"


def test_model_settings_in_the_sidecar_are_counted(task: SystemTask) -> None:
    path = Path(f"{task.declared.model}.toml")
    path.write_text(SIDECAR.replace('"Euler"\n', '"Euler"\ngravity = [0, 0, 0]\nstep = 0.001\n'))
    more = count_numbers(task.with_sidecar(read_sidecar(path)))
    assert more.numbers == 33
    assert "time step" in {one.reason for one in more.untested}


def test_included_files_are_counted_and_not_changed(
    task: SystemTask,
) -> None:
    """Compare with counts of the same numbers in one file, and of a robot's file."""
    whole = count_numbers(task)
    path = task.declared.model
    outer, _, rest = MJCF.partition('<body name="rod"')
    inner, _, end = rest.rpartition("</body>")
    part = path.parent / "parts" / "rod.xml"
    part.parent.mkdir()
    text = f'<mujoco><body name="rod"{inner}</body></mujoco>'
    part.write_text(text)
    path.write_text(f'{outer}<include file="parts/rod.xml"/>{end}')
    sidecar = Path(f"{path}.toml")
    sidecar.write_text(SIDECAR.replace('"body[rod]', "#"))
    split = count_numbers(replace(task, sidecar=read_sidecar(sidecar)))
    assert (split.numbers, split.motion) == (whole.numbers, whole.motion)
    assert split.frames == whole.frames
    assert part.read_text() == text
    robot = count_robot(model_task(replace(prepare_tree(path), smooth=True), "mujoco"))
    assert (robot.numbers, robot.motion) == (split.numbers, split.motion)


def test_change_below_the_resolution_does_not_count(task: SystemTask) -> None:
    assert count_numbers(replace(task, resolution=10.0)).motion == 0


def test_every_number_of_each_format_is_listed(tmp_path: Path) -> None:
    texts = {
        "a.xml": '<a b="1 2" c="x1"><!-- 3 --><d>4</d><e f="1.5"/><e f="&#52;"/></a>',
        "a.py": "A = -1\n\ndef f():\n    return 2.5 * A, True, 'x3'\n",
        "a.toml": 'a = 1\nb = [2, 3.5, "4"]\n[c.d]\ne = { f = 6 }\n',
    }
    numbers = {}
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
        numbers[name] = [(one.path, one.location.text) for one in literals(tmp_path / name)]
    assert numbers == {
        "a.xml": [("a@b", "1"), ("a@b", "2"), ("a/d", "4"), ("a/e@f", "1.5")],
        "a.py": [("A", "1"), ("", "2.5")],
        "a.toml": [("a", "1"), ("b[0]", "2"), ("b[1]", "3.5"), ("c.d.e.f", "6")],
    }


def model(**fields: object) -> Model:
    defaults: dict[str, object] = {
        "system": "arm", "model": "a.xml", "engine": "known", "folder": "f", "text": "",
        "sidecar": "",
    }  # fmt: skip
    return Model(**{**defaults, **fields})  # type: ignore[arg-type]  # fields of tests


COVERAGE = Coverage(
    numbers=31,
    motion=18,
    audit=4,
    frames=1,
    untested=(Untested(reason="visual geometry", count=8, examples=("geom@rgba", "site@size")),),
)


def test_line_lists_tested_and_untested_numbers() -> None:
    poses = Poses(
        frames=(FramePose(name="rod", place="body:rod", position=0.0, rotation=0.0, agrees=True),),
        states=3,
        unchecked=("tip",),
    )
    stop = AuditFinding(
        kind=BEYOND, subject=("a", "limits"), message="a is limited to [-3, 3]", location=None,
        expected=None, actual=None, severity="note",
    )  # fmt: skip
    record = model(coverage=COVERAGE, poses=poses, audit=(stop,))
    assert coverage_line(record) == (
        "23 of 31 numbers tested (18 by motion, 4 by audit, 1 by frames); untested: 8 (visual"
        " geometry); 1 pose compared, not tip (not in the sidecar's [frames]); not reached: a"
        " is limited to [-3, 3]"
    )
    assert "untested: 8 (visual geometry: geom@rgba, site@size, ...)" in coverage_line(
        record, examples=True
    )


def test_line_names_the_engine_whose_checks_are_counted() -> None:
    counted = replace_fields(COVERAGE, engine="other")
    assert coverage_line(model(coverage=counted)).startswith("23 of 31 numbers tested in other (")
    other = model(engine="other", coverage=counted)
    assert coverage_line(other).startswith("23 of 31 numbers tested (")
    ((best, _),) = overview.tested_numbers([model(coverage=counted), other])
    assert best.engine == "other"


def test_equal_models_share_a_line_and_unchecked_poses_are_noted() -> None:
    bare = Poses(note="the system declares no frames")
    models = [model(poses=bare), model(engine="other", poses=bare), model(engine="third")]
    assert coverage_lines(models) == [
        "arm/a.xml [known], arm/a.xml [other]: poses not compared: the system declares no frames"
    ]


def test_what_no_engine_reads_is_one_line() -> None:
    """Catch the ratio of a transmission that is lost among the numbers without effect."""
    ratios = Untested(reason="transmissions", count=2, examples=("motorInertia", "reduction"))
    parts = ("<contact> of <link>", "<mu1> of <gazebo>", "<static> of <gazebo> (2)", "dry friction")
    models = [model(coverage=Coverage(numbers=2, untested=(ratios,), left_out=parts))] * 2
    assert unread_line(models) == (
        "no engine reads <motorInertia> of <transmission>; <mu1>, <static> of <gazebo>"
    )
    assert unread_line([model(coverage=Coverage(left_out=parts[:1]))]) == ""


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


ROBOT = """<mujoco><size memory="400M" nkey="1"/><option timestep="0.001"/>
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
    file = written(tmp_path, "r.xml", ROBOT)
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
    file = written(tmp_path, "r.xml", ROBOT)
    task = model_task(prepare_tree(file), "mujoco")
    limits = Limits(memory=0.2)
    with Workers(1, limits=limits) as workers:
        outcome = workers.outcome(workers.submit(count_robot, task))
    assert isinstance(outcome, Failure)
    assert outcome.reason == limits.full


def test_number_that_cannot_change_is_not_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = written(tmp_path, "r.xml", ROBOT)
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
    file = written(tmp_path, "r.xml", SHARED.format(more))
    task = model_task(prepare_tree(file), "mujoco")
    counted = counted_numbers(task, robot_numbers(file, task.spec.settings))
    assert {one.effect for one in counted if "/default" in one.path} == {effect}
