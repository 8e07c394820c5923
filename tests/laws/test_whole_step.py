"""Whole steps of MuJoCo and PyBullet against their laws: agreement, and planted faults."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from campaigns.laws import plant_faults
from campaigns.scenes import mujoco_result, mujoco_scene
from physics_crosscheck.engine import ModelSpec
from physics_crosscheck.harness.checks.acting import acting_quantities
from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.findings import STANDALONE_SETTINGS
from physics_crosscheck.harness.checks.law_comparison import Evaluated, LawComparison
from physics_crosscheck.harness.checks.law_states import KeptSteps
from physics_crosscheck.harness.checks.prepare import prepare
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.checks.whole_step import WholeStepCheck, check_whole_step
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.engines.urdf import SETTINGS
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.records import Outcome
from physics_crosscheck.reference.laws.soft import Part
from physics_crosscheck.reference.laws.step import LawModel, LawSolution
from tests.laws.scenes import CONNECT, DRIVES, LIMITS, PAIR, TOUCH, URDF_ARM, URDF_BOX, WELD
from tests.models import written

pytest.importorskip("mujoco")

use_few_states = pytest.mark.usefixtures("few_states")

SCENES = {
    "drives": DRIVES, "limits": LIMITS, "connect": CONNECT, "weld": WELD, "pair": PAIR,
    **{f"touch {dimension}": scene for dimension, scene in TOUCH.items()},
}  # fmt: skip
OPTIONS = (
    'integrator="Euler"',
    'integrator="implicitfast" cone="elliptic" impratio="10"',
    'integrator="implicit"',
    'density="900" viscosity="2" wind="1 2 0" integrator="implicitfast"',
    'density="900" viscosity="2" wind="1 2 0" integrator="implicit"',
)


def checked(tmp_path: Path, text: str, loaded: str = "") -> WholeStepCheck:
    """Compare the law of a text with its engine on the same text or another one."""
    urdf = text.startswith("<robot")
    if urdf:
        pytest.importorskip("pybullet")
    suffix, engine = (".urdf", "pybullet") if urdf else (".xml", "mujoco")
    file, copy = tmp_path / f"scene{suffix}", tmp_path / f"copy{suffix}"
    file.write_text(text)
    copy.write_text(loaded or text)
    settings = {**SETTINGS, **STANDALONE_SETTINGS, "floating": "box" in text} if urdf else {}
    check = check_whole_step(file, ModelSpec(copy, settings=settings), engine, 1e-9)
    assert check is not None
    return check


# Integrators act on drives, cones on contacts; random scenes cross all.
PAIRS = [
    *(("drives", options) for options in OPTIONS),
    ("limits", OPTIONS[0]), ("connect", OPTIONS[1]), ("weld", OPTIONS[2]), ("touch 1", OPTIONS[0]),
    ("pair", OPTIONS[2]), ("touch 4", OPTIONS[1]), ("touch 3", OPTIONS[0]), ("touch 6", OPTIONS[1]),
]  # fmt: skip


@use_few_states
@pytest.mark.parametrize(("scene", "options"), PAIRS)
def test_every_row_and_drive_follows_its_law(tmp_path: Path, scene: str, options: str) -> None:
    """Catch a row, a mixing rule, a cone or a drive that is stated wrong; and false alarms."""
    check = checked(tmp_path, SCENES[scene].format(options))
    assert check.judgement is not None
    assert check.record.outcome is Outcome.AGREES
    assert check.judgement.largest_discrepancy < 1e-11
    assert check.record.next_state
    assert check.record.acted


PENDULUM = """<mujoco><option integrator="Euler"/><worldbody><body><joint name="j" axis="0 1 0"
 stiffness="8 1" damping=".3"/><joint name="k" axis="1 0 0" damping=".1"/>
<inertial pos=".1 0 -.2" mass="1" diaginertia=".02 .02 .01"/></body></worldbody></mujoco>"""
CURVED = PENDULUM.replace('damping=".3"', 'damping="0 .2 .1"').replace(
    "</mujoco>", '<actuator><motor joint="k" gear="2" damping=".2 .3"/></actuator></mujoco>'
)
OVERRIDE = 'o_friction=".5 .6 .01 .001 .002"><flag override="enable"/></option><option'
RIGHT = {
    "damper beside a polynomial spring": PENDULUM,
    "the same, implicit": PENDULUM.replace("Euler", "implicitfast"),
    **{
        f"damper of three powers, {integrator}": CURVED.replace("Euler", integrator)
        for integrator in ("Euler", "implicitfast", "implicit")
    },
    "two sliding coefficients": TOUCH[6].format(OVERRIDE),
    "undamped contact": TOUCH[3].replace("-3000 -60", "-3000 0"),
    "undamped limit": LIMITS.replace("-800 -30", "-800 0"),
    "limit without stiffness": LIMITS.replace("-800 -30", "0 -30"),
    "time constant below two steps": LIMITS.replace("-800 -30", ".003 1"),
    "the same, not raised to them": LIMITS.replace("-800 -30", ".003 1").format(
        '><flag refsafe="disable"/></option><option'
    ),
    "controls that nothing limits": DRIVES.format("><flag clampctrl='disable'/></option><option"),
}


CENTERED = """<mujoco><option integrator="Euler" cone="elliptic" impratio="10"/><worldbody>
<geom type="box" size="1 1 .1" pos="0 0 -.1"/><body pos="0 0 .05"><joint axis="3 2 6"/>
<geom type="box" size=".1 .12 .06" mass="1"/></body></worldbody></mujoco>"""


@use_few_states
def test_contacts_of_a_body_that_turns_about_its_center_follow_their_law(tmp_path: Path) -> None:
    """Catch the ratio of friction before the lower bound of R: no force moves the center."""
    judgement = checked(tmp_path, CENTERED).judgement
    assert judgement is not None
    assert judgement.largest_discrepancy < 1e-11


@use_few_states
@pytest.mark.parametrize("name", RIGHT)
def test_right_file_agrees(tmp_path: Path, name: str) -> None:
    """Catch a law, a division or a reading that fails at numbers which are rare, but right."""
    file = written(tmp_path, "scene.xml", RIGHT[name].format(""))
    check = check_whole_step(file, ModelSpec(file), "mujoco", 1e-9)
    assert check is not None
    assert check.record.outcome is Outcome.AGREES
    assert check.record.next_state
    assert not check.record.misread
    compiled = engines()["mujoco"].compiled(file)
    assert acting_quantities(compiled) or name.startswith(("damper", "the same"))


@use_few_states
@pytest.mark.parametrize(
    ("text", "kinds"),
    [(URDF_ARM, {"limits", "motors", "motors at a limit"}), (URDF_BOX, {"contacts"})],
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


UNSTABLE = """<mujoco><worldbody><body pos="0 0 1"><freejoint/>
<geom type="box" size=".01 .01 .01" mass="1"/><site name="s"/></body></worldbody>
<actuator><motor site="s" gear="0 0 0 1 0 0" ctrlrange="-1e9 1e9"/></actuator></mujoco>"""


def test_unstable_draws_leave_no_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Catch a MUJOCO_LOG.TXT in the user's folder."""
    monkeypatch.chdir(tmp_path)
    checked(tmp_path, UNSTABLE)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["copy.xml", "scene.xml"]


LONE = """<mujoco><compiler angle="radian"/>
<option timestep="0.003" gravity="0 0 0" integrator="RK4"/><worldbody><body>
<joint name="q" axis="-0.1684 0.6545 0.737" pos="-0.005 -0.05 -0.087"/>
<inertial pos="0.32 0.16 -0.16" quat="0.28 -0.4 -0.35 0.8" mass="0.29"
 diaginertia="0.009 0.0064 0.0056"/>
</body></worldbody></mujoco>"""


def test_rounding_agrees_without_accelerations(tmp_path: Path) -> None:
    """Catch differences relative to accelerations that are rounding errors."""
    check = checked(tmp_path, LONE)
    assert check.judgement is not None
    assert check.record.outcome is Outcome.AGREES
    assert check.judgement.largest_discrepancy < 1e-12


SLIDE = """<mujoco><option {}/><worldbody><body><joint name="a" type="slide" axis="1 0 0"
 range="-1 1" damping="1"/><geom size=".1" mass="1" contype="0" conaffinity="0"/></body>
<body pos="0 0 3"><joint name="b" type="ball" range="0 40" damping=".2"/>
<geom type="capsule" size=".04 .15" pos="0 0 -.2" contype="0" conaffinity="0"/></body></worldbody>
<tendon><fixed name="t" range="-90 90"><joint joint="a" coef="1"/></fixed></tendon>
<actuator><motor joint="a" ctrlrange="-3 3"/><intvelocity joint="a" kp="2" actrange="-5 5"/>
</actuator></mujoco>"""

EXPLODES = """<robot name="stiff"><link name="base"/>
<joint name="a" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="50" velocity="5"/><dynamics damping="9"/></joint>
<link name="upper"><inertial><mass value=".5"/><origin xyz="0 0 -.1"/>
<inertia ixx="2e-4" ixy="0" ixz="0" iyy="2e-4" iyz="0" izz="2e-4"/></inertial></link></robot>"""


def test_engine_recovers_from_a_motion_that_explodes(tmp_path: Path) -> None:
    """Catch numbers that are not finite and stay in PyBullet, so that no later state is usable."""
    check = checked(tmp_path, EXPLODES)
    assert check.record.outcome is Outcome.AGREES
    assert check.record.states > 12


def test_elements_that_never_act_are_named(tmp_path: Path) -> None:
    """Catch a kind of force that counts as compared since another one of its kind acted."""
    record = checked(tmp_path, SLIDE.format("")).record
    assert record.covered == ("saturation of actuators (2)", "limits of position (3)")
    assert record.inactive == ("limits of position (1 of 3 never acted: tendon 1)",)


FAULTS = {
    "range of a ball": (SLIDE, 'range="0 40"', 'range="0 40.0001"'),
    "lost range of a control": (SLIDE, ' ctrlrange="-3 3"', ""),
    "actrange": (SLIDE, 'actrange="-5 5"', 'actrange="-5 5.00001"'),
    "torsional friction": (TOUCH[4], ".02 .003", ".02000002 .003"),
    "solref": (PAIR, 'solref=".03 .9"', 'solref=".03000003 .9"'),
    "margin": (TOUCH[3], 'margin=".001"', 'margin=".001000001"'),
    "tendon range": (LIMITS, 'range="-.02 .02"', 'range="-.02 .02000002"'),
    "polycoef": (CONNECT, 'polycoef=".1 .5', 'polycoef=".1 .5000005'),
    "anchor": (CONNECT, 'anchor=".3 0 0"', 'anchor=".300001 0 0"'),
    "torquescale": (WELD, 'torquescale="1.7"', 'torquescale="1.7000017"'),
    "forcerange": (DRIVES, 'forcerange="-3 3"', 'forcerange="-3 3.000003"'),
    "ctrlrange": (DRIVES, 'ctrlrange="-1 1"', 'ctrlrange="-1 1.000001"'),
    "kp": (DRIVES, 'kp="40"', 'kp="40.00004"'),
    "time constant": (DRIVES, 'dynprm=".03"', 'dynprm=".03000003"'),
    "muscle": (DRIVES, 'force="30"', 'force="30.00003"'),
    "joint's force range": (DRIVES, 'actuatorfrcrange="-6 5"', 'actuatorfrcrange="-6 5.000005"'),
    "PyBullet, lower limit": (URDF_ARM.replace("900", "0"), 'lower="-1"', 'lower="-1.000001"'),
    "PyBullet, lost effort": (URDF_ARM, 'effort="900"', 'effort="0"'),
    "PyBullet, range of targets": (URDF_ARM, 'upper=".4"', 'upper=".400001"'),
    "PyBullet, friction of a floating body": (
        URDF_BOX,
        'friction value="0.9"',
        'friction value="0.9000009"',
    ),
    "PyBullet, shape": (URDF_BOX, 'damping value="500"', 'damping value="500.001"'),
    "PyBullet, stiffness": (URDF_BOX, 'stiffness value="30000"', 'stiffness value="30000.1"'),
}


@use_few_states
@pytest.mark.parametrize("fault", FAULTS)
def test_relative_change_of_1e_6_is_detected(tmp_path: Path, fault: str) -> None:
    """Catch a number of the law that the comparison does not depend on."""
    scene, right, wrong = FAULTS[fault]
    scene = scene.replace("{}", OPTIONS[1])
    assert right in scene
    check = checked(tmp_path, scene, scene.replace(right, wrong, 1))
    assert check.record.outcome is Outcome.DIFFERS


ARM = """<mujoco><option timestep="0.002"/><worldbody>
<body><joint name="a" axis="0 1 0" range="-60 60" damping=".1"/>
<geom type="capsule" fromto="0 0 0 .3 0 0" size=".03" mass="1"/></body></worldbody></mujoco>"""


@use_few_states
@pytest.mark.parametrize(
    ("engine", "text", "right", "wrong"),
    [
        ("mujoco", ARM, 'range="-60 60"', 'range="-61 60"'),
        ("pybullet", URDF_ARM, 'upper=".7"', 'upper=".71"'),
    ],
    ids=["mujoco", "pybullet"],
)
def test_case_with_a_wrong_limit_differs(
    tmp_path: Path, engine: str, text: str, right: str, wrong: str
) -> None:
    """Catch a case whose smooth motion agrees and that hides a limit that differs."""
    pytest.importorskip(engine)
    suffix = ".urdf" if engine == "pybullet" else ".xml"
    file, copy = tmp_path / f"arm{suffix}", tmp_path / f"copy{suffix}"
    file.write_text(text)
    copy.write_text(text.replace(right, wrong))
    whole = run_case(model_task(prepare(file, states=4), engine).with_file(copy))
    assert (whole.outcome, whole.code) == (Outcome.DIFFERS, "XC305")
    assert "_ddot" in whole.reason
    smooth = run_case(model_task(prepare(file, states=4, smooth=True), engine).with_file(copy))
    assert (smooth.outcome, smooth.whole_step) == (Outcome.AGREES, None)


@use_few_states
def test_forces_without_a_law_are_named(tmp_path: Path) -> None:
    """Catch a comparison that passes although something without a law acts."""
    text = ARM.replace(
        "</mujoco>", '<actuator><general joint="a" dyntype="user" actdim="1"/></actuator></mujoco>'
    )
    record = checked(tmp_path, text).record
    assert record.outcome is None
    assert record.uncovered == ("actuators of other laws or transmissions",)
    noslip = ARM.replace('timestep="0.002"', 'timestep="0.002" noslip_iterations="3"')
    record = checked(tmp_path, noslip).record
    assert record.outcome is Outcome.AGREES
    assert record.uncovered == ("noslip iterations",)
    assert "noslip_iterations=0" in record.edits


def test_no_error_exceeds_its_uncertainty(tmp_path: Path) -> None:
    """Catch rounding of forces, arms and inertias that is not bounded, and a bound of solvers."""
    file = tmp_path / "scene.xml"
    rng = np.random.default_rng(52)
    for _ in range(13):
        mujoco_scene(rng)
    file.write_text(mujoco_scene(rng))
    result = mujoco_result(file)
    assert result.outcome == Outcome.AGREES
    assert max(result.ratios.values()) <= 1
    assert result.ratios["own"] > 0.01  # the file's own solver stops early


def test_nearly_rigid_rows_have_small_uncertainty(tmp_path: Path) -> None:
    """Catch rounding in pyramids with little friction that is taken as an error of the solver."""
    scene = """<mujoco><option timestep="0.001" integrator="implicit"/><worldbody>
    <geom type="plane" size="5 5 .1" condim="4" friction="2e-5 .016 .012" priority="1"
     solref="0.0226 1.09" solimp="0.764 0.844 0.0028 0.423 3.4"/>
    <body pos="0.055 -0.023 0.0757"><freejoint/>
    <geom type="box" size=".079 .073 .077" mass="1.44"/></body></worldbody></mujoco>"""
    check = checked(tmp_path, scene)
    assert check.record.outcome is Outcome.AGREES
    assert check.judgement is not None
    assert check.judgement.largest_uncertainty < 1e-9


TURNTABLE = """<mujoco><worldbody><geom type="plane" size="3 3 .1"/>
<body pos="0 0 .1"><joint axis="0 0 1"/><geom type="sphere" size=".12" mass="2"/>
<body pos="0 0 .5"><joint axis="0 1 0"/>
<geom type="capsule" size=".05" fromto="0 0 0 .4 0 0" mass="1"/></body></body>
</worldbody></mujoco>"""


def test_contact_on_the_axis_of_a_joint_leaves_no_uncertainty(tmp_path: Path) -> None:
    """Catch rounding of an arm that is exactly zero: nothing moves, and the force is 1e16 N."""
    check = checked(tmp_path, TURNTABLE)
    assert check.record.outcome is Outcome.AGREES
    assert check.judgement is not None
    assert check.judgement.largest_uncertainty < 1e-9


GAP = """<mujoco><worldbody><geom type="plane" size="3 3 .1" margin=".001" gap=".0005"/>
<body pos="0 0 .05"><freejoint/><geom type="box" size=".1 .07 .05"/></body></worldbody></mujoco>"""


@use_few_states
def test_wrong_gap_agrees(tmp_path: Path) -> None:
    """Catch a gap that shifts rows: MuJoCo 4 reports contacts within it, which exert no force."""
    file = written(tmp_path, "scene.xml", GAP)
    faults = [fault for *_, fault in plant_faults(file, 1, np.random.default_rng(1), ("gap",))]
    assert [(fault.acts, fault.outcome) for fault in faults] == [(0.0, "AGREES")] * 2


TETRAHEDRON = "v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.mark.parametrize(
    ("form", "name"),
    [
        ('mesh filename="bad.obj"', "bad.obj"),
        ('box size="2e6 1 1"', "its collision geometry"),
        ('plane normal="0 0 1"', "its plane"),
    ],
)
def test_shape_that_stops_its_link_is_the_cause(tmp_path: Path, form: str, name: str) -> None:
    """Catch a lost limit as the cause: PyBullet stops links whose boxes are not finite."""
    file = tmp_path / "arm.urdf"
    (tmp_path / "bad.obj").write_text(TETRAHEDRON.replace("v 0 .1 0", "v 1e20 .1 0"))
    inertial = '<inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1"/></inertial>'
    file.write_text(
        f'<robot name="r"><link name="base">{inertial}</link>\n'
        f'<link name="arm">{inertial}<collision><geometry>\n<{form}/>'
        '</geometry></collision></link><joint name="j" type="revolute"><parent link="base"/>'
        '<child link="arm"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1"/></joint>'
        "</robot>"
    )
    case = run_case(model_task(prepare(file), "pybullet"))
    assert (case.outcome, case.kind) == (Outcome.DIFFERS, "compiled number")
    line = 2 if name == "its collision geometry" else 3
    assert case.reason.startswith(f"arm.urdf:{line}: the shape of link 'arm' is larger than")
    assert f"check {name};" in case.reason
    # A base at rest is not stopped.
    swapped = {"base": "arm", "arm": "base"}
    words = r'(?<=link name=")(base|arm)'
    file.write_text(re.sub(words, lambda one: swapped[one[0]], file.read_text()))
    assert run_case(model_task(prepare(file), "pybullet")).outcome is not Outcome.DIFFERS


MESHED = """<mujoco><asset><mesh file="absent.stl"/></asset><worldbody><body>
<joint name="hinge" axis="0 1 0" range="-60 60"/><inertial pos="0 0 -.5" mass="2"
 diaginertia=".1 .06 .05"/><geom type="mesh" mesh="absent"/></body></worldbody></mujoco>"""
ABSENT = '<collision><geometry><mesh filename="package://arm/absent.stl"/></geometry></collision>'
MESHED_ARM = URDF_ARM.replace("</link>", f"{ABSENT}</link>")


@use_few_states
@pytest.mark.parametrize(("name", "text", "engine"), [
    ("meshed.xml", MESHED, "mujoco"), ("arm.urdf", MESHED_ARM, "mujoco"),
    ("arm.urdf", MESHED_ARM, "pybullet"),
])  # fmt: skip
def test_missing_mesh_costs_its_shape_only(
    name: str, text: str, engine: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Catch whole steps that are lost since a shape has no file."""
    pytest.importorskip(engine)
    file = written(tmp_path, name, text)
    case = run_case(model_task(prepare(file), engine))
    assert case.outcome is Outcome.AGREES
    assert case.whole_step is not None
    assert case.whole_step.outcome is Outcome.AGREES
    assert "limits" in {term.name for term in case.whole_step.acted}
    assert main(["run", str(file), "--engine", engine, "--out", str(tmp_path / "out")]) == 0
    assert capsys.readouterr().out.count("absent.stl is missing; these shapes are left out") == 1


@use_few_states
def test_full_runs_follow_whole_steps(tmp_path: Path) -> None:
    """Catch whole steps that unload the model before its full runs."""
    pytest.importorskip("pybullet")
    file = written(tmp_path, "arm.urdf", URDF_ARM.replace("900", "0"))
    case = run_case(model_task(prepare(file, states=4, motion=0.05), "pybullet"))
    assert case.outcome is Outcome.AGREES
    assert case.full_run is not None
    assert case.whole_step is not None


STIFF = """<mujoco><option gravity="0 0 -3"/><worldbody><body pos="0 0 1">
<joint name="a" axis="0 1 0" range="-20 70" armature=".01" damping=".5"/>
<geom type="capsule" fromto="0 0 0 .4 0 0" size=".04" mass="1"/><body pos=".4 0 0">
<joint name="b" axis="0 1 0" frictionloss=".3" solreffriction=".01 .7"/>
<geom type="capsule" fromto="0 0 0 .3 0 0" size=".03" mass=".5"/></body></body></worldbody>
<actuator><position joint="a" kp="3000" ctrlrange="-.3 1.2" forcerange="-2 3"/>
<position joint="b" kp="900" kv="9" ctrlrange="-1 .5" forcerange="-3 3"/></actuator></mujoco>"""


HELD = """<mujoco><compiler angle="radian"/><worldbody><body pos="0 0 1">
<joint name="a" axis="0 1 0" range="-.5 .7" solimplimit=".7 .95 .002 .4 3"/>
<geom type="capsule" fromto="0 0 0 .4 0 0" size=".04" mass="1"/><body pos=".4 0 0">
<joint name="b" axis="0 1 0"/><site name="tip" pos=".3 0 0"/>
<geom type="capsule" fromto="0 0 0 .3 0 0" size=".03" mass=".5"/></body></body>
<site name="eye" pos="-.1 .2 1.3"/><body pos="0 1 1"><joint name="c"/>
<geom size=".1" pos=".1 0 0"/></body></worldbody>
<tendon><spatial range="0 .9"><site site="tip"/><site site="eye"/></spatial></tendon>
<equality><joint joint1="b" joint2="c" solimp=".8 .95 .003"/></equality></mujoco>"""


def missing_parts(comparison: LawComparison, evaluated: Sequence[Evaluated]) -> set[Part]:
    assert isinstance(comparison.laws, LawModel)
    solutions = (sample.solution for sample in evaluated)
    return comparison.laws.missing_parts(s for s in solutions if isinstance(s, LawSolution))


@use_few_states
def test_softening_limits_and_equalities_act(tmp_path: Path) -> None:
    """Catch widths of impedances, and limits of tendons, that no drawn state shows."""
    file, steps = tmp_path / "held.xml", KeptSteps()
    file.write_text(HELD)
    check_whole_step(file, ModelSpec(file), "mujoco", 1e-9, steps)
    comparison, evaluated = steps.kept("mujoco")
    assert comparison is not None
    assert missing_parts(comparison, evaluated) <= {Part("limit", 1, -1)}  # no length is below 0


@use_few_states
def test_states_are_added_for_parts_that_never_act(tmp_path: Path) -> None:
    """Catch ends of ranges, and friction that holds, which no state shows."""
    file = written(tmp_path, "stiff.xml", STIFF)
    faults = list(plant_faults(file, 1, np.random.default_rng(1), ("ctrlrange", "solreffriction")))
    assert len(faults) == 4
    for key, size, address, fault in faults:
        if address.endswith("solreffriction[1]"):  # friction has no violation
            assert (fault.acts, fault.outcome) == (0.0, "AGREES")
            continue
        assert fault.acts > 1e-9, address
        assert (fault.outcome, fault.named) == ("DIFFERS", True), (key, size, address)
