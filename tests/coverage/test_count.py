"""Every number of a model's files is counted once: by what sees it, or by why nothing does."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace as replace_fields

from physics_crosscheck.harness.checks.findings import robot_findings
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import SystemTask, model_task
from physics_crosscheck.harness.diagnosis import coverage as trials
from physics_crosscheck.harness.diagnosis.coverage import count_numbers, count_robot
from physics_crosscheck.harness.modelfiles.locations import literals
from physics_crosscheck.harness.modelfiles.readers import read_robot
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar
from physics_crosscheck.harness.numerics.coordinates import coordinate_map
from physics_crosscheck.harness.records.coverage import Coverage, Untested
from physics_crosscheck.harness.records.finding import BEYOND
from physics_crosscheck.harness.records.poses import FramePose, Poses
from physics_crosscheck.harness.render.html import overview
from physics_crosscheck.harness.results.coverage import coverage_line, coverage_lines, unread_line
from physics_crosscheck.records import AuditFinding, Model
from tests.poses.arm import SWING
from tests.records.made import case, printed, results

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


def test_included_files_are_counted_and_not_changed(task: SystemTask) -> None:
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
        numbers[name] = [(one.path, one.text) for one in literals(tmp_path / name)]
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


MOTOR = """<transmission name="t"><joint name="j"/><actuator name="m">
  <mechanicalReduction>{}</mechanicalReduction><motorInertia>6e-6</motorInertia>
</actuator></transmission>"""
URDF = """<robot name="r"><link name="base"/>
<joint name="j" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
  {}</joint><link name="a"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>
</link>{}</robot>"""
SDF = """<sdf version="1.7"><model name="m"><link name="a"/><link name="b"/>
<joint name="j" type="revolute"><parent>a</parent><child>b</child>
  <axis><xyz>0 1 0</xyz>{}</axis>{}</joint></model></sdf>"""


@pytest.mark.parametrize(("suffix", "text", "line", "expected"), [
    (".urdf", URDF.format("", MOTOR.format(113)), 0, "<mechanicalReduction>:5, <motorInertia>:5"),
    (".urdf", URDF.format("", MOTOR.format("1.0")), 0, "<motorInertia>:5"),
    (".urdf", URDF.format('<joint_properties damping="1"/>', ""), 0, "<joint_properties>:3"),
    (".urdf", URDF.format("", '<gazebo reference="a"><mu1>1</mu1>\n<mu2>1</mu2></gazebo>'), 0,
     "<mu1>:4, <mu2>:5"),
    (".urdf", URDF.format("", "<gazebo>" + "".join(f"<a{i}/>" for i in range(13)) + "</gazebo>"),
     0, ", ".join(f"<a{i}>:4" for i in range(8)) + " and 5 more"),
    (".urdf", URDF.format('<dynamics dampin="1"/>', ""), 3, "did you mean damping?"),
    (".urdf", URDF.format('<dynamcs damping="1"/>', ""), 3, "did you mean <dynamics>?"),
    (".urdf", URDF.format('<limit effort="1" friction="1"/>', ""), 0, "friction:3"),
    (".urdf", URDF.replace(' type="rev', ' damping="1" type="rev').format("", ""), 2,
     "it belongs in <dynamics> of <joint>"),
    (".sdf", SDF.format("", "<dynamics><damping>1</damping></dynamics>"), 3,
     "it belongs in <axis> of <joint>"),
    (".sdf", SDF.format("", "<damping>1</damping>"), 3, "it belongs in <axis>/<dynamics> of"),
    (".sdf", SDF.format("<dynamics><dampin>1</dampin></dynamics>", ""), 3, "mean <damping>?"),
])  # fmt: skip
def test_unread_names_are_one_line_and_misspelled_ones_findings(
    tmp_path: Path, suffix: str, text: str, line: int, expected: str
) -> None:
    """Catch a number that is lost, since engines skip names that their format does not have."""
    file = tmp_path / f"robot{suffix}"
    file.write_text(text)
    findings = robot_findings(read_robot(file))
    wrong = [one for one in findings if one.kind == "misspelled"]
    assert [one.location.line for one in wrong if one.location] == [line] * bool(line)
    shown = wrong[0].message if wrong else unread_line([model(audit=findings)])
    assert shown.endswith(expected) or (wrong and expected in shown)
    run = results(case(folder="f", model="a.xml"), models=(model(audit=tuple(wrong)),))
    assert not re.search(r"[.?]\.", printed(run, 200))
