"""Files of real robots, and small ones with the same traits: no false difference, one cause."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from physics_crosscheck import CompareError
from physics_crosscheck.engine import CompiledTree
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.commands.compare.actuators import _state
from physics_crosscheck.harness.commands.compare.candidate import candidate
from physics_crosscheck.harness.commands.compare.judge import judge, recorded_runs
from physics_crosscheck.harness.commands.compare.match import match
from physics_crosscheck.harness.commands.compare.prepared import prepare
from physics_crosscheck.harness.commands.compare.segments import Ends
from physics_crosscheck.harness.commands.compare.states import SampledStates
from physics_crosscheck.harness.jobs.executor import InThisProcess
from physics_crosscheck.harness.modelfiles.readers import RobotError
from physics_crosscheck.harness.numerics.ladder import ExtrapolatedLimit
from physics_crosscheck.harness.records.comparison import FileDifference
from physics_crosscheck.records import ComparisonResult, Outcome
from physics_crosscheck.reference.solving.segments import Segments
from tests.compare.arm import MJCF, URDF
from tests.compare.asking import compared, printed, result, sampled
from tests.compare.test_agreement import agrees
from tests.models import written
from tests.robots.files import TIPPED

TOUCHING = (
    '<collision><geometry><mesh filename="package://gone/link.stl"/></geometry></collision>',
    '<collision><geometry><sphere radius="0.4"/></geometry></collision>',
)
LIMITS = 'lower="-0.2" upper="0.3"'


def gymnasium(name: str) -> Path:
    module = pytest.importorskip("gymnasium")
    return Path(module.__file__).parent / "envs" / "mujoco" / "assets" / name


def with_effect(comparison: ComparisonResult) -> list[str]:
    return [one.message for one in result(comparison).properties if one.moves]


def without_effect(comparison: ComparisonResult) -> list[str]:
    return [one.message for one in result(comparison).properties if not one.moves]


def shaped(shape: str) -> tuple[tuple[str, str], ...]:
    """Return the edits that give a shape to the first two links of the arm."""
    return (
        ('<link name="ground"/>', f'<link name="ground">{shape}</link>'),
        ('<link name="upper">', f'<link name="upper">{shape}'),
        ('xyz="0 0 1.2"', 'xyz="0 0 0.2"'),
    )


def test_effect_of_a_stiff_damper_is_that_of_its_motion(tmp_path: Path) -> None:
    damped = 'name="elbow" damping="1e4"', 'name="elbow"'
    a, b = written(tmp_path, "a.xml", MJCF), written(tmp_path, "b.xml", MJCF, damped[::-1])
    comparison = result(compared(a, b))
    (row,) = [one for one in comparison.properties if one.kind == "damping"]
    assert row.effect == pytest.approx(comparison.discrepancy, rel=0.01)
    assert comparison.explained == pytest.approx(1, abs=1e-3)


def test_base_touching_its_first_link_is_no_difference(tmp_path: Path) -> None:
    path = written(tmp_path, "arm.urdf", URDF, *shaped(TOUCHING[1]))
    comparison = agrees(compared(path, path, "pybullet", "mujoco"))
    assert "not compared: limits of position, collision geometry (2)" in result(comparison).notes


def test_missing_meshes_are_not_needed(tmp_path: Path) -> None:
    path = written(tmp_path, "arm.urdf", URDF, *shaped(TOUCHING[0]))
    agrees(compared(path, path, "pybullet", "mujoco"))


def test_range_without_zero_is_no_difference(tmp_path: Path) -> None:
    """Use a range like that of the fourth joint of a Panda."""
    near = ('type="continuous">\n    <parent link="upper"/>',
            'type="revolute">\n    <limit lower="-3.07" upper="-0.07" effort="87" velocity="2"/>'
            '\n    <parent link="upper"/>')  # fmt: skip
    path = written(tmp_path, "arm.urdf", URDF, near)
    comparison = agrees(compared(path, path, "pybullet", "mujoco"))
    names = comparison.models[0].coordinates or ()
    elbow = sampled(path, path, "pybullet", "mujoco").runs.start[:, names.index("elbow")]
    assert elbow.min() > -3.07
    assert elbow.max() < -0.07


@pytest.mark.parametrize("include_constraints", [False, True])
def test_home_pose_at_a_limit_agrees(tmp_path: Path, include_constraints: bool) -> None:
    a = written(tmp_path, "arm.xml", MJCF, ('range="-0.2 0.3"', 'range="0 0.3"'))
    b = written(tmp_path, "arm.urdf", URDF, (LIMITS, 'lower="0" upper="0.3"'))
    comparison = compared(a, b, engine_b="mujoco", include_constraints=include_constraints)
    assert comparison.outcome is Outcome.AGREES, comparison.reason
    assert result(comparison).runs.count > 12


def test_starts_are_within_the_limits_of_both(tmp_path: Path) -> None:
    a = written(tmp_path, "arm.xml", MJCF)
    b = written(tmp_path, "arm.urdf", URDF, (LIMITS, 'lower="0.1" upper="0.4"'))
    comparison = compared(a, b, engine_b="mujoco")
    starts = sampled(a, b, engine_b="mujoco").runs.start[:, 2]
    assert starts.min() > 0.1
    assert starts.max() < 0.3
    assert comparison.outcome is Outcome.DIFFERS
    assert comparison.reason == "range of joint reach: (-0.2 0.3) in A, (0.1 0.4) in B"


def test_one_mass_across_formats_is_one_line(tmp_path: Path) -> None:
    mass = "0.90000123"  # six digits do not give it from 0.9
    a = written(tmp_path, "arm.xml", MJCF)
    b = written(tmp_path, "arm.urdf", URDF, ('mass value="0.9"', f'mass value="{mass}"'))
    comparison = compared(a, b, engine_b="mujoco")
    assert comparison.outcome is Outcome.DIFFERS
    assert with_effect(comparison) == [f"link fore: mass 0.9 in A, {mass} in B (+1.4e-06)"]
    line = MJCF[: MJCF.index('mass="0.9"')].count("\n") + 1
    difference = result(comparison).properties[0]
    assert str(difference.where_a) == f"{a}:{line}"
    assert str(difference.where_b).endswith("arm.urdf:6")
    assert result(comparison).terms == ()


@pytest.mark.parametrize(("form", "outcome"), [
    ("{:.8g}", Outcome.AGREES), ("{:.9g}", Outcome.AGREES), ("tool", Outcome.DIFFERS),
])  # fmt: skip
def test_rounding_by_a_writer_agrees_and_an_added_inertial_is_named(
    form: str, outcome: Outcome, tmp_path: Path
) -> None:
    """Let a writer round to eight digits, to 32 bits, or add an inertial to a massless link."""
    tool = '<link name="tool"/><joint name="weld" type="fixed"><parent link="hand"/>' \
           '<child link="tool"/></joint></robot>'  # fmt: skip
    exact = ("0.041", "0.04123456789"), ("0.35", "0.3512345678"), ("</robot>", tool)
    moments = 'ixx="1e-6" iyy="1e-6" izz="1e-6" ixy="0" ixz="0" iyz="0"'
    inertial = f'<inertial><mass value="1e-6"/><inertia {moments}/></inertial>'
    small = ('name="tool"/>', f'name="tool">{inertial}</link>')
    rounded = [
        (text, form.format(np.float32(text) if "9" in form else float(text)))
        for text in ("0.04123456789", "0.3512345678")
    ]
    a = written(tmp_path, "a.urdf", URDF, *exact)
    b = written(tmp_path, "b.urdf", URDF, *exact, *([small] if form == "tool" else rounded))
    comparison = compared(a, b, "mujoco", "mujoco")
    assert comparison.outcome is outcome, comparison.reason
    if form == "tool":
        assert with_effect(comparison) == [
            "link tool: inertial none in A, (mass 1e-06, moments 1e-06 1e-06 1e-06) in B"
        ]


def test_link_frames_welds_and_joint_zeros_are_conventions(tmp_path: Path) -> None:
    """Split the hand into two links, turn the frame of the forearm, and move the elbow's zero."""
    a = written(tmp_path, "arm.xml", MJCF, ('stiffness="2.5" springref="0.4"', ""))
    hand = '<mass value="0.35"/>'
    half = URDF[URDF.index('<link name="hand">') :].partition("</link>")[0] + "</link>"
    palm = half.replace('"hand"', '"palm"').replace(hand, '<mass value="0.15"/>')
    palm = palm.replace('ixx="0.0008" iyy="0.0009" izz="0.0005"', 'ixx="0" iyy="0" izz="0"')
    weld = (
        '<joint name="weld" type="fixed"><parent link="hand"/><child link="palm"/></joint>\n'
        '  <joint name="shoulder"'
    )
    spring = URDF[URDF.index('<gazebo reference="elbow">') :].partition("</gazebo>")[0]
    b = written(
        tmp_path,
        "arm.urdf",
        URDF,
        (spring + "</gazebo>", ""),
        ('<mass value="0.35"/>', '<mass value="0.2"/>'),
        ('<joint name="shoulder"', palm + weld),
        ('<origin xyz="0.01 0.05 -0.45"/>', turned()),
    )
    comparison = compared(a, b, engine_b="mujoco")
    (message,) = with_effect(comparison)
    assert message.startswith("zero of joint elbow: 0.3 rad from that of A")
    remedy = message.partition("--joints=")[2].rstrip(")")
    agrees(compared(a, b, engine_b="mujoco", joints=remedy))


def turned() -> str:
    """Return the origin of the elbow, turned about its axis (0.6, 0.8, 0) by 0.3 rad."""
    axis, angle = np.array([0.6, 0.8, 0.0]), 0.3
    cross = np.cross(np.eye(3), axis)
    m = np.eye(3) - np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    roll, pitch = np.arctan2(m[2, 1], m[2, 2]), -np.arcsin(m[2, 0])
    yaw = np.arctan2(m[1, 0], m[0, 0])
    return f'<origin xyz="0.01 0.05 -0.45" rpy="{roll!r} {pitch!r} {yaw!r}"/>'.replace(
        "np.float64(", ""
    ).replace(")", "")


RENAMED = tuple((f'"{name}"', f'"{name}_x"') for name in ("shoulder", "elbow", "reach"))


def test_renamed_joints_are_paired_by_order(tmp_path: Path) -> None:
    motor = '<actuator><motor joint="elbow"/></actuator></mujoco>'
    a = written(tmp_path, "arm.xml", MJCF, ("</mujoco>", motor))
    b = written(tmp_path, "arm.urdf", URDF, *RENAMED)
    comparison = agrees(compared(a, b, engine_b="mujoco"))
    assert result(comparison).map == tuple(
        f"joint {name} of A is {name}_x of B: by order" for name in ("shoulder", "elbow", "reach")
    )
    left_out = "not compared: actuators (1) of A, since the other file's format has none"
    assert left_out in result(comparison).notes


def two_arms(first: str, second: str) -> str:
    """Return two pendulums on one base, in a given order."""
    bodies = {
        name: f'<body name="{name}" pos="0 {y} 1"><joint name="{name}_{first}" axis="0 1 0"/>'
        f'<inertial pos="0 0 -{far}" mass="{mass}" diaginertia="0.01 0.02 0.03"/></body>'
        for name, y, far, mass in (("left", 0.4, 0.3, 1.0), ("right", -0.4, 0.5, 2.0))
    }
    inner = "".join(bodies[name] for name in second.split())
    return f"<mujoco><worldbody>{inner}</worldbody></mujoco>"


def test_renamed_and_reordered_joints_are_paired_by_geometry(tmp_path: Path) -> None:
    a = written(tmp_path, "a.xml", two_arms("hip", "left right"))
    b = written(tmp_path, "b.xml", two_arms("joint", "right left"))
    comparison = agrees(compared(a, b))
    assert set(result(comparison).map) == {
        "joint left_hip of A is left_joint of B: by geometry",
        "joint right_hip of A is right_joint of B: by geometry",
    }


def test_unmatched_joint_is_named_and_held(tmp_path: Path) -> None:
    a = written(tmp_path, "arm.xml", MJCF)
    spring = URDF[URDF.index('<gazebo reference="reach">') :].partition("</robot>")[0]
    locked = ('"reach" type="prismatic"', '"reach" type="fixed"'), (spring, "")
    b = written(tmp_path, "arm.urdf", URDF, *locked)
    for first, second, engines in ((a, b, (None, "mujoco")), (b, a, ("mujoco", None))):
        comparison = agrees(compared(first, second, *engines))
        label, other = ("A", "B") if first == a else ("B", "A")
        assert (
            f"joint reach of {label} has no partner in {other}: held at 0"
            in result(comparison).notes
        )
        assert with_effect(comparison) == []


@pytest.mark.parametrize(("other", "outcome"), [("1e16", "AGREES"), ("1e11", "DIFFERS"),
                                                ("1.3", "DIFFERS")])  # fmt: skip
def test_joint_that_damping_locks_is_held_and_its_damping_compared(
    tmp_path: Path, other: str, outcome: str
) -> None:
    motor = (
        "</mujoco>",
        '<actuator><motor joint="reach"/><motor joint="elbow"/></actuator></mujoco>',
    )
    a, b = (
        written(tmp_path, name, MJCF, ('damping="1.3"', f'damping="{damping}"'), motor)
        for name, damping in (("a.xml", "1e16"), ("b.xml", other))
    )
    for first, second in ((a, b), (b, a)):
        comparison = compared(first, second)
        assert comparison.outcome is Outcome[outcome]
        assert "is locked by its damping, 1e+16: held" in " ".join(result(comparison).notes)
        assert [one.about for one in result(comparison).properties] == ["reach"] * (
            outcome == "DIFFERS"
        )


def test_lone_joint_that_damping_locks_is_named(tmp_path: Path) -> None:
    text = (
        "<mujoco><worldbody><body><joint name='j' damping='1e11'/><inertial pos='0 0 1'"
        " mass='1' diaginertia='1 1 1'/></body></worldbody></mujoco>"
    )
    file = written(tmp_path, "a.xml", text)
    with pytest.raises(CompareError, match=r"no joint moves: joint j of A is locked by its damp"):
        compared(file, file)
    with pytest.raises(RobotError, match="no other joint moves: damping 1e\\+11 stops joint 'j'"):
        prepare_tree(file)


def test_objects_without_joints_are_free_and_compared(tmp_path: Path) -> None:
    light, heavy = (
        written(tmp_path, f"{mass}.urdf", f'<robot name="box"><link name="box"><inertial>'
                f'<mass value="{mass}"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0"'
                ' iyz="0"/></inertial></link></robot>')
        for mass in (1, 2)
    )  # fmt: skip
    agrees(compared(light, light))
    assert compared(light, heavy).outcome is Outcome.DIFFERS


# PyBullet gives 1 kg to a link without <inertial>.
MASSLESS = (
    '<inertial><mass value="0"/>'
    '<inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial>'
)


def test_frames_of_the_same_name_are_compared(tmp_path: Path) -> None:
    site = ('<inertial pos="0.015 -0.01 -0.06"', '<site name="tip" pos="0 0 -0.1"/>'
            '<inertial pos="0.015 -0.01 -0.06"')  # fmt: skip
    a = written(tmp_path, "arm.xml", MJCF, site)
    for z, turn, engine in (("-0.1", "0", "pybullet"), ("-0.12", "0.1", "mujoco")):
        tip = (
            f'<link name="tip">{MASSLESS}</link>'
            '<joint name="weld" type="fixed"><parent link="hand"/>'
            f'<child link="tip"/><origin xyz="0 0 {z}" rpy="0 0 {turn}"/></joint>'
            '<joint name="shoulder"'
        )
        b = written(tmp_path, "arm.urdf", URDF, ('<joint name="shoulder"', tip))
        comparison = compared(a, b, engine_b=engine)
        if z == "-0.1":
            agrees(comparison)
        else:
            row = result(comparison).decisive
            assert comparison.outcome is Outcome.DIFFERS
            assert row is not None
            assert "in B 0.02 m away" in row.message
            assert "turned by 0.1 rad" in row.message
            assert str(row.where_a).startswith(f"{a}:")
            assert str(row.where_b).startswith(f"{b}:")


def test_actuators_are_compared(tmp_path: Path) -> None:
    motor = '<actuator><motor name="drive" joint="elbow" gear="{}"/></actuator></mujoco>'
    a, b = (
        written(tmp_path, f"{gear}.xml", MJCF, ("</mujoco>", motor.format(gear)))
        for gear in ("20", "21")
    )
    comparison = compared(a, b)
    assert comparison.outcome is Outcome.DIFFERS
    assert "actuators (1), each held at a control within its range" in result(comparison).notes
    assert with_effect(comparison) == ["gear of actuator drive: 20 in A, 21 in B"]
    assert (result(comparison).explained or 0.0) > 1 - 1e-6
    assert single(comparison).explained == 1.0


DYNAMICS = '<general name="drive" joint="elbow" gear="2" {}/>'
MOTOR = '<motor name="drive" joint="elbow" gear="2" {}/>'
TENDON = '<tendon><fixed name="cord" stiffness="30" springlength="{}">{}</fixed></tendon>'
MIXED = '<joint joint="elbow" coef="0.1"/><joint joint="reach" coef="1"/>'


def driven(folder: Path, name: str, actuators: str, *replaced: tuple[str, str]) -> Path:
    whole = f"<actuator>{actuators}</actuator></mujoco>"
    return written(folder, f"{name}.xml", MJCF, *replaced, ("</mujoco>", whole))


@pytest.mark.parametrize(
    ("actuators_a", "actuators_b", "message"),
    [
        (DYNAMICS.format('dyntype="filter" dynprm="0.01"'),
         DYNAMICS.format('dyntype="filter" dynprm="9"'),
         "dynamics of actuator drive: 0.01 in A, 9 in B"),
        ('<position name="drive" joint="elbow" kp="3"/>', "", "actuator drive: in A alone"),
    ],
)  # fmt: skip
def test_different_or_missing_actuators_differ(
    tmp_path: Path, actuators_a: str, actuators_b: str, message: str
) -> None:
    a, b = driven(tmp_path, "a", actuators_a), driven(tmp_path, "b", actuators_b)
    comparison = compared(a, b)
    assert comparison.outcome is Outcome.DIFFERS
    assert with_effect(comparison) == [message]
    assert max(trial.explained or 0 for trial in result(comparison).differences) == 1.0


def test_exact_filter_agrees_with_itself_under_rk4(tmp_path: Path) -> None:
    """Catch a claim of order 4: RK4 has order 1 there."""
    filtered = DYNAMICS.format('dyntype="filterexact" dynprm="0.01"')
    path = driven(tmp_path, "a", filtered, ('integrator="Euler"', 'integrator="RK4"'))
    assert result(agrees(compared(path, path))).runs.lost == 0


def test_actuators_are_paired_by_name_then_by_joint(tmp_path: Path) -> None:
    servo = '<position name="{}" joint="reach" kp="300"/>'
    a = driven(tmp_path, "a", MOTOR.format("") + servo.format("push"))
    third = '<motor name="lift" joint="shoulder" gear="3"/><motor name="low" joint="shoulder"/>'
    a = driven(tmp_path, "a", MOTOR.format("") + servo.format("push") + third)
    turned = third.partition("/>")[2] + third.partition("/>")[0] + "/>"
    others = servo.format("other") + MOTOR.format("").replace("drive", "turn")
    comparison = agrees(compared(a, driven(tmp_path, "b", turned + others)))
    assert [note for note in result(comparison).notes if note.startswith("actuator ")] == [
        "actuator drive of A is turn of B: by joint",
        "actuator push of A is other of B: by joint",
    ]


def test_two_actuators_on_one_site_agree(tmp_path: Path) -> None:
    """Use actuators on one site, as the Crazyflie of MuJoCo Menagerie does."""
    thrust = '<motor name="{}" site="tip" gear="{}"/>'
    hand = ('<joint name="reach"', '<site name="tip"/><joint name="reach"')
    both = thrust.format("lift", "0 0 1 0 0 0") + thrust.format("turn", "0 0 0 1 0 0")
    path = driven(tmp_path, "a", both, hand)
    assert result(agrees(compared(path, path))).properties == ()


def test_spring_with_play_is_stretched(tmp_path: Path) -> None:
    rest_a, rest_b = "-1 4", "-1 5"
    a, b = (
        written(tmp_path, f"{i}.xml", MJCF, ("</mujoco>", TENDON.format(rest, MIXED) + "</mujoco>"))
        for i, rest in enumerate((rest_a, rest_b))
    )
    comparison = compared(a, b)
    assert comparison.outcome is Outcome.DIFFERS
    assert with_effect(comparison) == [f"rest of tendon cord: {rest_a} in A, {rest_b} in B"]
    assert single(comparison).explained == 1.0


def test_spring_that_stays_within_its_play_is_not_compared(tmp_path: Path) -> None:
    slide = '<joint joint="reach" coef="1"/>'
    a, b = (
        written(tmp_path, f"{i}.xml", MJCF, ("</mujoco>", TENDON.format(rest, slide) + "</mujoco>"))
        for i, rest in enumerate(("-0.2 0.5", "-0.2 0.6"))
    )
    comparison = agrees(compared(a, b))
    assert "rest of tendon cord: -0.2 0.5 in A, -0.2 0.6 in B" in result(comparison).untested


def test_free_bodies_are_compared(tmp_path: Path) -> None:
    hinge = '<joint name="shoulder" type="hinge" axis="0 1 0" damping="0.07"/>'
    text = MJCF.replace(hinge, '<freejoint name="base"/>')
    a = written(tmp_path, "a.xml", text)
    b = written(tmp_path, "b.xml", text, ('mass="1.7"', 'mass="1.7000017"'))
    comparison = compared(a, b)
    assert comparison.outcome is Outcome.DIFFERS
    assert with_effect(comparison) == ["link upper: mass 1.7 in A, 1.7000017 in B (+1.0e-06)"]
    assert result(comparison).terms == ()


def test_servo_much_faster_than_the_step_locks_no_joint(tmp_path: Path) -> None:
    """Use a servo like those of the KUKA iiwa 14 in MuJoCo Menagerie: 2e5 1/s at dt = 2 ms."""
    light = ('mass="0.9" fullinertia="0.017 0.016 0.003 0 0.0004 0"',
             'mass="0.001" diaginertia="1e-7 1e-7 1e-7"')  # fmt: skip
    hand = ('mass="0.35" diaginertia="0.0008 0.0009 0.0005"',
            'mass="0.01" diaginertia="1e-6 1e-6 1e-6"')  # fmt: skip
    servo = '<actuator><position joint="elbow" kp="2000" kv="200"/></actuator></mujoco>'
    path = written(tmp_path, "arm.xml", MJCF, light, hand, ("</mujoco>", servo))
    comparison = agrees(compared(path, path))
    assert sampled(path, path).independent == (0, 1, 2)
    assert result(comparison).runs.lost == 0


def test_free_body_at_half_a_turn_rotates_about_every_axis(tmp_path: Path) -> None:
    hinge = '<joint name="shoulder" type="hinge" axis="0 1 0" damping="0.07"/>'
    text = MJCF.replace(hinge, '<freejoint name="base"/>').replace(
        'euler="0.3 0 0"', 'quat="0 0 0 1"'
    )
    path = written(tmp_path, "arm.xml", text)
    agrees(compared(path, path))
    assert sampled(path, path).independent == tuple(range(8))


@pytest.mark.slow
def test_coupling_of_one_file_is_a_difference_with_a_note(tmp_path: Path) -> None:
    mimic = ('<axis xyz="0.6 0.8 0"/>', '<axis xyz="0.6 0.8 0"/><mimic joint="shoulder"/>')
    a, b = written(tmp_path, "a.urdf", URDF, mimic), written(tmp_path, "b.urdf", URDF)
    comparison = compared(a, b, "pybullet", "mujoco")
    assert comparison.outcome is Outcome.DIFFERS
    assert (
        "not compared: joints that follow others, limits of position, in A"
        in result(comparison).notes
    )
    assert comparison.reason == "coupling of joint elbow: (shoulder 1 0) in A, none in B"
    constrained = compared(a, b, "pybullet", "pybullet", include_constraints=True)
    assert constrained.outcome is Outcome.DIFFERS


def single(comparison: ComparisonResult) -> FileDifference:
    (trial,) = (one for one in result(comparison).differences if len(one.edits) == 1)
    return trial


def test_mass_far_off_is_named(tmp_path: Path) -> None:
    """Plant a mass off by a factor of six in PyBullet; tests above plant smaller faults."""
    a = written(tmp_path, "a.urdf", URDF)
    b = written(tmp_path, "b.urdf", URDF, ('mass value="0.9"', 'mass value="0.15"'))
    comparison = compared(a, b, "pybullet", "pybullet")
    assert comparison.outcome is Outcome.DIFFERS
    (message,) = with_effect(comparison)
    assert message.startswith("link fore: mass 0.9 in A, 0.15 in B")
    assert result(comparison).terms == ()
    (edit,) = single(comparison).edits
    assert (edit.where_a.line, single(comparison).explained) == (6, 1.0)


@pytest.mark.slow
def test_literal_of_a_default_class_is_named(tmp_path: Path) -> None:
    text, old = gymnasium("reacher.xml").read_text(), 'damping="1" limited'
    a = written(tmp_path, "a.xml", text)
    b = written(tmp_path, "b.xml", text, (old, 'damping="1.000001" limited'))
    comparison = compared(a, b)
    assert comparison.outcome is Outcome.DIFFERS
    assert len(with_effect(comparison)) == 2
    (edit,) = single(comparison).edits
    assert edit.what.startswith("default/joint@")
    assert edit.where_a.line == text[: text.index(old)].count("\n") + 1
    assert single(comparison).explained == 1.0


@pytest.mark.slow
def test_engine_effects_are_separated_from_file_differences(tmp_path: Path) -> None:
    """Use a link without mass: MuJoCo drops its inertia."""
    path = written(tmp_path, "tipped.urdf", TIPPED)
    comparison = compared(path, path, "pybullet", "mujoco", own_files=True)
    assert comparison.outcome is Outcome.DIFFERS
    assert result(comparison).properties == ()
    assert result(comparison).explained is not None
    here, there = result(comparison).off or ()
    assert (here or 0.0) < 1e-9 < (there or 0.0)
    assert any("link 'tip' has inertia" in one for one in result(comparison).impossible)
    mine, its = comparison.models
    assert mine.case is not None
    assert its.case is not None
    assert its.diagnosis is not None
    assert (mine.case.outcome, its.case.outcome) == (Outcome.AGREES, Outcome.DIFFERS)
    (cause,) = its.diagnosis.explanations[0].causes
    assert cause.kind == "dropped"
    assert "link[tip]/inertial" in str(cause)
    assert {term.kind for term in result(comparison).terms} <= {"inertia"}


ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_equations_are_compared_with_runs_without_a_limit() -> None:
    """Leave PyBullet's motors on, so that no run has a limit; the sidecar is named."""
    cases = ROOT / "docs" / "cases"
    comparison = compared(cases / "pendulum.urdf", cases / "pendulum_with_motors.urdf", "pybullet")
    assert result(comparison).explained is not None
    here, there = result(comparison).off or ()
    assert (here or 0.0) < 1e-9 < (there or 0.0)
    text = printed(comparison)
    assert "no joint of B moves under a force; 1 joint of A can" in text
    assert "sidecar:settings.motors: nothing, pendulum_with_motors.urdf.toml: True" in text


def test_urdf_floats_if_the_mjcf_floats(tmp_path: Path) -> None:
    hinge = '<joint name="shoulder" type="hinge" axis="0 1 0" damping="0.07"/>'
    a = written(tmp_path, "arm.xml", MJCF.replace(hinge, '<freejoint name="root"/>'))
    start, end = URDF.index('<joint name="shoulder"'), URDF.index('<joint name="elbow"')
    floating = URDF[:start].replace('<link name="ground"/>', "") + URDF[end:]
    b = written(tmp_path, "arm.urdf", floating)
    comparison = agrees(compared(a, b, engine_b="pybullet"))
    assert "the root link of B moves freely, as that of A" in result(comparison).notes
    assert len(result(comparison).joints) == 8


@pytest.mark.parametrize("held", [True, False])
def test_quadruped_is_held_if_the_other_file_holds_it(held: bool, tmp_path: Path) -> None:
    """Let both roots move if neither file states it, also if one robot has lost its legs."""
    moments = 'ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"'
    inertial = f'<inertial><mass value="1"/><inertia {moments}/></inertial>'
    legs = "".join(
        f'<joint name="j{i}" type="continuous"><origin xyz="{i} 0 -0.1"/><parent link="trunk"/>'
        f'<child link="leg{i}"/><axis xyz="0 1 0"/></joint><link name="leg{i}">{inertial}'
        '<collision><geometry><sphere radius="0.1"/></geometry></collision></link>'
        for i in range(2)
    )
    trunk = f'{inertial}<collision><geometry><box size="1 1 0.1"/></geometry></collision>'
    text = f'<robot name="a"><link name="trunk">{trunk}</link>{legs}</robot>'
    a = written(tmp_path, "a.urdf", text)
    b = written(tmp_path, "b.urdf", text, ('sphere radius="0.1"', 'sphere radius="0.01"'))
    other = candidate("B", b, "mujoco", floating=False if held else None)
    models = candidate("A", a, "mujoco"), other
    prepared = prepare(InThisProcess(), *models, ({}, {}), False)
    assert [len(one.coordinates) for one in prepared.facts] == ([2, 2] if held else [8, 8])
    assert any("the root link of A is held, as that of B" in one for one in prepared.notes) == held


def test_arm_stays_fixed_if_the_other_file_has_a_free_body(tmp_path: Path) -> None:
    cube = '<body name="cube" pos="2 0 0"><freejoint/><geom size="0.1"/></body></worldbody>'
    a = written(tmp_path, "arm.xml", MJCF, ("</worldbody>", cube),
                ('inertiafromgeom="false"', 'inertiafromgeom="auto"'))  # fmt: skip
    b = written(tmp_path, "arm.urdf", URDF)
    models = candidate("A", a, None), candidate("B", b, "mujoco")
    prepared = prepare(InThisProcess(), *models, ({}, {}), False)
    assert prepared.facts[1].coordinates == ("shoulder", "elbow", "reach")


def test_keyframe_is_shortened_with_a_held_joint(tmp_path: Path) -> None:
    """Catch a keyframe of wrong length, as with held joints of Unitree's G1."""
    key = '<keyframe><key qpos="0.1 0.2 0.3"/></keyframe></mujoco>'
    a = written(tmp_path, "arm.xml", MJCF, ("</mujoco>", key))
    fixed = ('<joint name="reach" type="prismatic">', '<joint name="reach" type="fixed">')
    b = written(tmp_path, "arm.urdf", URDF, fixed, *(
        (text, "") for text in (URDF[URDF.index('<gazebo reference="reach">'):
                                     URDF.index("</robot>")],)))  # fmt: skip
    assert "joint reach of A has no partner in B: held at 0" in result(compared(a, b)).notes


def test_largest_difference_is_named_and_those_within_uncertainty_are_not() -> None:
    """Catch a choice by E/U, which depends on the last digits of U."""
    value = np.array([[0.0, 1.0], [1.0, 2.0]])
    runs = Segments.unsolved(np.array([[0.0, 1.0]] * 2), 1.0, np.zeros((2, 1)))
    states = SampledStates(runs=runs, fastest=1.0, unit=np.ones(1), typical=1.0, independent=(0,))
    limit = ExtrapolatedLimit(
        value=value, uncertainty=np.full((2, 2), 1e-12), rungs=(2, 3), increments=np.ones(1),
        order=1.0, order_confirmed=True, converges=True, rounding=np.zeros((2, 2)), epsilon=2.2e-16,
    )  # fmt: skip
    source = Ends(
        length=1.0, value=value, uncertainty=limit.uncertainty, finest=value, limit=limit, claimed=1
    )
    pair = match(("x",), ("x",), ({}, {}), ({}, {}))
    recorded = recorded_runs(states, source, pair, 1e-9)
    off = value + np.array([[0.3, 0.2], [0.0, 0.0]])
    target = replace(source, value=off, uncertainty=np.array([[1e-10, 1e-13]] * 2))
    judged = judge(recorded, target, pair, 1e-9)
    assert judged.verdict.component == "x"
    assert judged.verdict.discrepancy == pytest.approx(0.3)
    assert judged.verdict.discrepancy > judged.verdict.uncertainty
    near = replace(target, value=value + np.array([[0.3, 1e-13], [0.0, 0.0]]))
    assert judge(recorded, near, pair, 1e-9).certain.tolist() == [True, False]


@pytest.mark.parametrize(("low", "high"), [(0.0, 0.4), (-100.0, 100.0), (2.0, 2.1)])
def test_state_of_an_actuator_begins_within_its_range(low: float, high: float) -> None:
    ranges = (("state range", (low, high)),)
    owner = SimpleNamespace(states=tuple(range(8)), ranges=ranges)
    compiled = SimpleNamespace(actuators=(owner,))
    starts = [_state(cast(CompiledTree, compiled), index) for index in range(8)]
    assert all(low <= start <= high for start in starts)
    assert max(starts) - min(starts) > 0.5 * (high - low)
