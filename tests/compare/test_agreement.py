"""Models of one mechanism agree in all formats and engines; a planted fault is named by line."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.harness.records.comparison import FileDifference
from physics_crosscheck.records import ComparisonResult, Outcome
from tests.compare.arm import MJCF, URDF
from tests.compare.asking import changed, compared, model, result, sampled
from tests.models import written


def chain(seed: int, joints: int) -> tuple[str, str]:
    """Return (MJCF, URDF) of a chain with random axes, offsets, inertias, springs and dampers."""
    random = np.random.default_rng(seed)
    bodies, links = "", '  <link name="ground"/>\n'
    for i in range(joints):
        hinge = i == 0 or random.uniform() < 0.7
        size, mass = random.uniform(0.1, 0.5), random.uniform(0.2, 3.0)
        place, centre = random.uniform(-1, 1, 3) * size, random.uniform(-1, 1, 3) * size / 2
        turn = random.uniform(-1, 1, 3) * [0.8, 0.8, 3.0]
        axis = random.normal(size=3)
        axis = axis / np.linalg.norm(axis)
        root = random.normal(size=(3, 3)) * size / 6
        inertia = mass * (np.trace(root @ root.T) * np.eye(3) - root @ root.T)
        damping, spring, rest = random.uniform(0, 1), random.uniform(0, 30), random.uniform(-1, 1)
        x, y, z = (inertia[a, a] for a in range(3))
        xy, xz, yz = inertia[0, 1], inertia[0, 2], inertia[1, 2]
        bodies += (
            f'<body name="b{i}" pos="{words(place)}" euler="{words(turn)}">\n'
            f'  <joint name="j{i}" type="{"hinge" if hinge else "slide"}" axis="{words(axis)}"'
            f' damping="{damping!r}" stiffness="{spring!r}" springref="{rest!r}"/>\n'
            f'  <inertial pos="{words(centre)}" mass="{mass!r}"'
            f' fullinertia="{words([x, y, z, xy, xz, yz])}"/>\n'
        )
        links += f"""  <link name="b{i}"><inertial>
    <origin xyz="{words(centre)}"/><mass value="{mass!r}"/>
    <inertia ixx="{x}" iyy="{y}" izz="{z}" ixy="{xy}" ixz="{xz}" iyz="{yz}"/>
  </inertial></link>
  <joint name="j{i}" type="{"continuous" if hinge else "prismatic"}">
    <parent link="{f"b{i - 1}" if i else "ground"}"/><child link="b{i}"/>
    <origin xyz="{words(place)}" rpy="{words(turn)}"/><axis xyz="{words(axis)}"/>
    <dynamics damping="{damping!r}"/>
    <limit lower="-100" upper="100" effort="1e6" velocity="1e6"/>
  </joint>
  <gazebo reference="j{i}"><springStiffness>{spring!r}</springStiffness>
    <springReference>{rest!r}</springReference></gazebo>
"""
    # A URDF's roll, pitch and yaw are about fixed axes: MuJoCo's XYZ in capitals.
    mjcf = (
        '<mujoco>\n<compiler angle="radian" eulerseq="XYZ" inertiafromgeom="false"/>\n'
        f"<worldbody>\n{bodies}{'</body>' * joints}\n</worldbody>\n</mujoco>\n"
    )
    return mjcf, f'<robot name="chain">\n{links}</robot>\n'


def words(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


ACROSS = "mujoco.xml", None, "robot.urdf", "pybullet"
IN_A_SPACE = "mujoco.xml", None, "space.py", None
PAIRS = (
    (*ACROSS, "drum_pendulum"), (*IN_A_SPACE, "free_pair"),
    ("robot.urdf", "mujoco", "robot.urdf", "pybullet", "torsional_disc"),
)  # fmt: skip


def agrees(comparison: ComparisonResult) -> ComparisonResult:
    judged = result(comparison)
    assert comparison.outcome is Outcome.AGREES, comparison.reason
    assert (judged.discrepancy or 0.0) < 1e-9
    assert (judged.uncertainty or 1.0) < 1e-9
    assert not judged.terms
    return comparison


# The drum has most of the terms, the pairs have tendons, a Space has no root.
@pytest.mark.parametrize(("a", "engine_a", "b", "engine_b", "system"), PAIRS)
def test_built_in_models_agree_across_formats_and_engines(
    system: str, a: str, engine_a: str | None, b: str, engine_b: str | None
) -> None:
    comparison = agrees(compared(model(system, a), model(system, b), engine_a, engine_b))
    # A free motion can't fix the overall scale: half of the runs or so are driven.
    assert result(comparison).runs.driven >= 12
    if (system, b) == ("drum_pendulum", "robot.urdf"):  # which has one more mimic joint
        assert (result(comparison).states_of, result(comparison).left_out) == ("B", ("phi",))


@pytest.mark.slow
def test_drum_rolling_by_an_equality_agrees_with_one_rolling_by_a_gear() -> None:
    drum = "drum_pendulum"
    comparison = agrees(compared(model(drum, "mujoco_rolling.xml"), model(drum, "robot.urdf")))
    assert result(comparison).joints == ("x", "phi", "theta")
    paths = model(drum, "mujoco_rolling.xml"), model(drum, "robot.urdf")
    assert len(sampled(*paths).independent) == 2


@pytest.mark.slow
def test_expression_defines_a_joint_without_a_match(tmp_path: Path) -> None:
    drum = "drum_pendulum"
    # The drum of the Space only slides; that of the URDF also turns.
    table = written(tmp_path, "map.toml", '[joints]\nphi = "drum.x / 0.18"\n')
    a, b = model(drum, "space.py"), model(drum, "robot.urdf")
    comparison = agrees(compared(a, b, None, "pybullet", table=table))
    assert result(comparison).map == (
        "x of B is drum.x of A",
        "phi of B is 50*drum.x/9 of A",
        "theta of B is rod.angle of A",
    )


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_arm_written_by_hand_in_both_formats_agrees(tmp_path: Path, engine: str) -> None:
    a, b = written(tmp_path, "arm.xml", MJCF), written(tmp_path, "arm.urdf", URDF)
    comparison = agrees(compared(a, b, engine_b=engine))
    assert "gravity (0, 0, -9.81) and a step of 0.002 s are assumed" in result(comparison).notes[0]


def test_joint_with_another_name_direction_and_zero_agrees_if_mapped(tmp_path: Path) -> None:
    path = model("simple_pendulum", "mujoco.xml")
    other = changed(
        tmp_path,
        path,
        (
            '<joint name="theta" type="hinge" axis="0 -1 0"/>',
            '<joint name="swing" type="hinge" axis="0 1 0" ref="0.3"/>',
        ),
    )
    agrees(compared(path, other, joints="theta=0.3-swing"))


def test_step_and_integrator_of_a_sidecar_are_differences_that_move_nothing(tmp_path: Path) -> None:
    """Catch a doubled step that ends with 0, since extrapolation removes it from all motions."""
    path = model("simple_pendulum", "robot.urdf")
    other = changed(tmp_path, path, ("step = 0.002", "step = 0.001"), ('"Euler"', '"RK4"'))
    comparison = compared(path, other, "mujoco", "mujoco")
    assert comparison.outcome is Outcome.DIFFERS
    assert comparison.reason.startswith("sidecar:settings.")
    moved = {
        t.edits[0].what: (str(t.edits[0].where_a).rpartition("/")[2], t.moved)
        for t in result(comparison).differences
        if len(t.edits) == 1
    }
    assert moved == {
        "sidecar:settings.step": ("robot.urdf.toml:5", 0.0),
        "sidecar:settings.integrator": ("robot.urdf.toml", 0.0),
    }


def test_given_start_state_is_run_too() -> None:
    path = model("simple_pendulum", "mujoco.xml")
    starts = ({"theta": 2.9, "theta_dot": 0.25},)
    assert result(agrees(compared(path, path, starts=starts))).runs.count > 12
    here = sampled(path, path, starts=starts).runs
    assert [2.9, 0.25] in here.start.tolist()


def test_random_chains_agree_across_formats(tmp_path: Path) -> None:
    mjcf, urdf = chain(3, 4)
    a, b = written(tmp_path, "a.xml", mjcf), written(tmp_path, "b.urdf", urdf)
    agrees(compared(a, b, engine_b="mujoco"))


@pytest.mark.slow
def test_rounding_of_turned_inertias_in_pybullet_is_noted(tmp_path: Path) -> None:
    mjcf, urdf = chain(1, 2)
    a, b = written(tmp_path, "a.xml", mjcf), written(tmp_path, "b.urdf", urdf)
    comparison = compared(a, b, engine_b="pybullet")
    assert (result(comparison).discrepancy or 1.0) < 1e-8
    assert "PyBullet finds their principal axes only to about 1e-9" in result(comparison).notes[-1]


@pytest.mark.usefixtures("usual_states")
def test_runs_that_touch_a_wall_are_left_out_with_a_note(tmp_path: Path) -> None:
    path = model("simple_pendulum", "mujoco.xml")
    wall = '<geom type="sphere" pos="0.6 0 0.55" size="0.1" contype="1" conaffinity="1"/>\n'
    bob = '<geom name="bob" type="sphere" pos="0 0 -0.75" size="0.05"'
    touching = changed(
        tmp_path,
        path,
        ('<body name="pendulum"', f"{wall}<body name='pendulum'"),
        (bob, f'{bob} contype="1" conaffinity="1"'),
    )
    comparison = agrees(compared(touching, touching, include_constraints=True))
    assert 0 < result(comparison).runs.lost < result(comparison).runs.count
    assert "runs left out" in result(comparison).notes[-1]


FAULTS = (
    # system, file, old, new, messages wanted among the terms, literal, line
    ("mass_spring_damper", "robot.urdf", ">47.0<", ">47.000047<",
     ("stiffness of joint x: 47 in A, 47.000047 in B (+1.0e-06)",), "gazebo[x]/springStiffness"),
    ("mass_spring_damper", "space.py", "DAMPING = 0.9", "DAMPING = 0.9000009",
     ("damping of mass.x:", "(+1.0e-06)"), "DAMPING"),
    ("drum_pendulum", "mujoco.xml", '"0 0 -0.3"', '"0 0 -0.3000003"',
     ("link rod: centre of mass (0, 0, 0.7) in A, (0, 0, 0.6999997) in B, 3e-07 m apart",),
     "body[rod]/inertial@pos[2]"),
    ("free_pair", "robot.urdf", "damping = 0.35", "damping = 0.35000035",
     ("damping of x1: 0.35 in A, 0.35000035 in B (+1.0e-06)",
      "damping between x1 and x2: -0.35 in A, -0.35000035 in B (+1.0e-06)"),
     "sidecar:spring[0]"),
    ("anchored_pair", "mujoco.xml", '<joint joint="x1" coef="-1"/>',
     '<joint joint="x1" coef="-1.000001"/>',
     ("damping between x1 and x2:",), "fixed[coupling]/joint[x1]@coef"),
)  # fmt: skip


def single(comparison: ComparisonResult) -> dict[str, FileDifference]:
    """Return the differences that were tried alone, by label."""
    return {t.edits[0].what: t for t in result(comparison).differences if len(t.edits) == 1}


@pytest.mark.parametrize(("system", "name", "old", "new", "messages", "literal"), FAULTS)
def test_one_literal_off_by_a_millionth_is_named(
    tmp_path: Path,
    system: str,
    name: str,
    old: str,
    new: str,
    messages: tuple[str, ...],
    literal: str,
) -> None:
    path = model(system, name)
    engine = {".urdf": "mujoco"}.get(path.suffix)
    other = changed(tmp_path, path, (old, new))
    comparison = compared(path, other, engine, engine)
    assert comparison.outcome is Outcome.DIFFERS
    # An error of a millionth is measured as such, not as rounding.
    assert 1e-9 < (result(comparison).discrepancy or 0.0) < 1e-5
    # Files that both declare bodies are compared directly, others by measured terms.
    moving = [one for one in result(comparison).properties if one.moves]
    reported = [one.message for one in moving or result(comparison).terms]
    assert bool(result(comparison).terms) != bool(moving)
    for message in messages:
        assert any(message in one for one in reported), reported
    # Nothing else is blamed: every reported term belongs to the fault.
    kinds = {message.partition(" ")[0] for message in messages} - {"(+1.0e-06)"}
    assert {one.partition(" ")[0] for one in reported} <= kinds
    assert len(reported) <= (1 if moving else 4)
    (trial,) = result(comparison).differences
    (edit,) = trial.edits
    assert trial.explained == 1.0
    assert edit.what == literal
    place = path if not literal.startswith("sidecar:") else path.with_name(f"{path.name}.toml")
    lines = place.read_text().splitlines()
    line = edit.where_a.line or 0
    near = lines[line - 1 : line + 3] if literal.startswith("sidecar:") else [lines[line - 1]]
    assert any(old.split("=")[0].strip('<"> ').split()[0] in one for one in near)


def test_each_of_several_differences_has_its_share(tmp_path: Path) -> None:
    path = model("drum_pendulum", "mujoco.xml")
    other = changed(
        tmp_path,
        path,
        ('stiffness="65.0"', 'stiffness="65.0065"'),
        ('mass="0.8"', 'mass="0.800001"'),
        ('size="0.18 0.1"', 'size="0.2 0.1"'),
        ('timestep="0.002" integrator="Euler"', 'timestep="0.004" integrator="RK4"'),
    )
    comparison = compared(path, other)
    differences = single(comparison)
    assert 0.9 < (differences["joint[x]@stiffness"].explained or 0) < 1.0
    assert abs(differences["body[rod]/inertial@mass"].explained or 0) < 0.1
    assert (differences["body[rod]/inertial@mass"].moved or 0) > 1e-7
    for name in ("option@timestep", "option@integrator", "body[drum]/geom@size[0]"):
        assert differences[name].moved == 0.0
    (together,) = [t for t in result(comparison).differences if len(t.edits) > 1]
    assert (len(together.edits), together.explained) == (5, 1.0)


def test_additional_element_is_tried_as_a_whole(tmp_path: Path) -> None:
    path = model("simple_pendulum", "mujoco.xml")
    extra = '<body name="knob" pos="0 0 -0.2"><inertial pos="0 0 0" mass="0.01"'
    extra += ' diaginertia="1e-6 1e-6 1e-6"/></body>\n    </body>\n  </worldbody>'
    other = changed(tmp_path, path, ("</body>\n  </worldbody>", extra))
    (trial,) = result(compared(path, other)).differences
    assert (trial.explained, trial.edits[0].what) == (1.0, "body[knob]")
    assert trial.edits[0].a == "nothing"


def test_additional_attribute_is_tried(tmp_path: Path) -> None:
    path = model("simple_pendulum", "mujoco.xml")
    other = changed(tmp_path, path, ('axis="0 -1 0"/>', 'axis="0 -1 0" armature="1e-5"/>'))
    comparison = compared(other, path)
    armature = single(comparison)["joint[theta]@armature"]
    assert (armature.explained, armature.edits[0].b) == (1.0, "nothing")
    assert [one.kind for one in result(comparison).properties] == ["armature"]


@pytest.mark.usefixtures("usual_states")
def test_friction_is_not_reported_as_a_force_at_rest(tmp_path: Path) -> None:
    path = model("drum_pendulum", "mujoco.xml")
    other = changed(tmp_path, path, ('axis="0 -1 0"/>', 'axis="0 -1 0" frictionloss="0.001"/>'))
    comparison = compared(path, other, include_constraints=True)
    assert comparison.outcome is Outcome.DIFFERS
    assert [t.message for t in result(comparison).terms] == [
        "friction on theta: 0 in A, 0.001 in B, whatever its speed"
    ]
    assert (result(comparison).differences[0].explained or 0) > 0.99
    # By default no motion shows it, but both files state it.
    comparison = compared(path, other)
    assert comparison.outcome is Outcome.DIFFERS
    assert comparison.reason == "friction of joint theta: none in A, 0.001 in B"
    assert (result(comparison).discrepancy or 0.0) < 1e-9


@pytest.mark.slow
def test_quadratic_drag_is_not_reported_as_damping(tmp_path: Path) -> None:
    path = model("mass_spring_damper", "robot.urdf")
    other = changed(tmp_path, path, ("step = 0.002", "step = 0.002\nlink_damping = 0.04"))
    comparison = compared(path, other, "pybullet", "pybullet")
    assert [t.kind for t in result(comparison).terms] == ["friction"]
    assert "depends on the velocity, not linearly" in result(comparison).terms[0].message
    assert result(comparison).differences[0].edits[0].what == "sidecar:settings.link_damping"
    assert result(comparison).differences[0].explained == 1.0


def test_different_gravity_is_reported(tmp_path: Path) -> None:
    path = model("simple_pendulum", "robot.urdf")
    other = changed(tmp_path, path, ("gravity = [0, 0, -9.81]", "gravity = [0, 0, -9.80665]"))
    comparison = compared(path, other, "mujoco", "pybullet")
    assert [one.message for one in result(comparison).properties] == [
        "gravity: (0, 0, -9.81) in A, (0, 0, -9.80665) in B"
    ]
    assert (result(comparison).explained or 0.0) > 1 - 1e-6
    assert not result(comparison).terms
    assert comparison.models[1].gravity == (0, 0, -9.80665)


def test_joint_with_reversed_axis_is_named(tmp_path: Path) -> None:
    old, new, joint = '<axis xyz="0.6 0.8 0"/>', '<axis xyz="-0.6 -0.8 0"/>', "elbow"
    a = written(tmp_path, "arm.xml", MJCF, ('springref="0.4"', 'springref="0"'))
    urdf = URDF.replace("Reference>0.4<", "Reference>0<")
    b = written(tmp_path, "arm.urdf", urdf, (old, new))
    comparison = compared(a, b, engine_b="mujoco")
    assert comparison.outcome is Outcome.DIFFERS
    assert result(comparison).turned == (joint,)
    assert (result(comparison).left_when_turned or 0.0) < 1e-9
    assert not result(comparison).terms
    mapped = compared(a, b, engine_b="mujoco", joints=f"{joint}=-{joint}")
    assert mapped.outcome is Outcome.AGREES


@pytest.mark.slow
def test_mirror_image_leaves_the_reversed_joint_ambiguous(tmp_path: Path) -> None:
    path = model("drum_pendulum", "mujoco.xml")
    b = changed(tmp_path, path, ('axis="0 -1 0"/>', 'axis="0 1 0"/>'))
    # A Space has no joints with distinguishable axes.
    assert result(compared(model("drum_pendulum", "space.py"), b)).turned == ("x or theta",)
    assert result(compared(path, b)).turned == ("theta",)


def test_product_of_inertia_differs_across_formats(tmp_path: Path) -> None:
    a = written(tmp_path, "arm.xml", MJCF)
    b = written(tmp_path, "arm.urdf", URDF, ('izz="0.003" ixy="0"', 'izz="0.003" ixy="0.00002"'))
    comparison = compared(a, b, engine_b="mujoco")
    assert comparison.outcome is Outcome.DIFFERS
    (difference,) = (one for one in result(comparison).properties if one.moves)
    assert (difference.kind, difference.about) == ("inertia", "fore")
    assert str(difference.where_b).endswith("arm.urdf:7")
    assert (result(comparison).explained or 0.0) > 1 - 1e-6


def test_constant_across_formats_names_both_lines(tmp_path: Path) -> None:
    a = changed(tmp_path, model("drum_pendulum", "mujoco.xml"), ('mass="0.8"', 'mass="0.8001"'))
    comparison = compared(a, model("drum_pendulum", "robot.urdf"), engine_b="mujoco")
    (trial,) = result(comparison).differences
    assert trial.explained == 1.0
    (edit,) = trial.edits
    assert edit.what.endswith("both m")
    assert 'mass="0.8001"' in a.read_text().splitlines()[(edit.where_a.line or 0) - 1]
    assert edit.where_b.file.endswith("robot.urdf")


@pytest.mark.slow
def test_released_mimic_joint_is_reported_as_a_constraint(tmp_path: Path) -> None:
    path = model("drum_pendulum", "robot.urdf")
    line = '<mimic joint="x" multiplier="5.555555555555555" offset="0"/>'
    other = changed(tmp_path, path, (line, ""))
    comparison = compared(path, other, "pybullet", "pybullet")
    assert comparison.outcome is Outcome.DIFFERS
    assert [t.kind for t in result(comparison).terms] == ["constraint"]
    assert "3 joints can move independently in B, 2 in A" in result(comparison).terms[0].message


def test_model_without_gravity_setting_names_the_stiffness(tmp_path: Path) -> None:
    text = """names = ["a", "b"]
M = [[2.0, 0.3], [0.3, 1.0]]
C = [[0.5, 0.0], [0.0, 0.2]]
K = [[40.0, -5.0], [-5.0, 30.0]]
W = [0.0, 0.0]
step = 0.002
method = "euler"
claims = 1
"""
    a = written(tmp_path, "a.known", text)
    b = written(tmp_path, "b.known", text, ("-5.0], [-5.0", "-5.001], [-5.001"))
    comparison = compared(a, b)
    assert [t.message for t in result(comparison).terms] == [
        "stiffness between a and b: -5 in A, -5.001 in B (+0.02 %)"
    ]
    assert result(comparison).differences == ()
