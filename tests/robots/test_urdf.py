"""URDF semantics: frames, welded links, defaults, and elements that are left out."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.modelfiles.readers import RobotError, robot_system
from physics_crosscheck.records import Outcome
from physics_crosscheck.reference.dynamics.tree_dynamics import Dynamics
from tests.robots.files import BODY, inertial, joint, last, left_out, link, read, read_text, tree_of

LINKS = [link("base", ""), link("a"), link("b")]


def test_roll_pitch_yaw_rotate_about_fixed_axes(tmp_path: Path) -> None:
    origin = '<origin xyz="1 2 3" rpy="0.3 -0.7 1.9"/>'
    body = last(read(tmp_path, link("base", ""), link("a"), joint("j", "base", "a", origin)))
    expected = Rotation.from_euler("xyz", [0.3, -0.7, 1.9]).as_matrix()
    assert body.rotation == pytest.approx(expected, abs=1e-15)
    assert body.position == pytest.approx([1, 2, 3])


def test_inertia_is_rotated_by_its_origin(tmp_path: Path) -> None:
    turned = inertial("2", "1 2 2.5", origin='<origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/>')
    body = last(read(tmp_path, link("base", ""), link("a", turned), joint("j", "base", "a")))
    assert np.diag(body.inertia) == pytest.approx([2, 1, 2.5])
    assert body.center == pytest.approx([1, 0, 0])


def test_axis_is_normalized_and_defaults_to_x(tmp_path: Path) -> None:
    tree = tree_of(
        read(
            tmp_path,
            *LINKS,
            joint("p", "base", "a", '<axis xyz="0 3e-200 -4e-200"/>', "prismatic"),
            joint("q", "a", "b"),
        )
    )
    assert tree.links[0].kind == "slide"
    assert tree.links[0].axis == pytest.approx([0, 0.6, -0.8])
    assert tree.links[1].axis == pytest.approx([1, 0, 0])


RIGHT = '<origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/>'


def test_links_on_fixed_joints_are_one_body(tmp_path: Path) -> None:
    """Add 2 kg m^2 about y and z for each of two masses of 2 kg, 2 m apart along x (Steiner)."""
    light = inertial("2", "0.5 0.5 0.5")
    robot = read(
        tmp_path,
        link("base"),
        link("a", light),
        link("flange", ""),
        link("b", light),
        joint("weld2", "flange", "b", '<origin xyz="0 -1 0"/>', "fixed"),
        joint("j", "base", "a"),
        joint("weld1", "a", "flange", RIGHT, "fixed"),
        link("tool"),
        joint("k", "b", "tool", '<origin xyz="0 -0.5 0"/>'),
    )
    tree = tree_of(robot)
    assert robot.bodies == (("a", "flange", "b"), ("tool",))
    assert [part.body for part in robot.parts] == [-1, 0, 0, 0, 1]
    body = tree.links[0]
    assert body.mass == 4
    assert body.center == pytest.approx([1, 0, 0])
    assert body.inertia == pytest.approx(np.diag([1, 5, 5]))
    assert tree.links[1].parent == 0
    assert tree.links[1].position == pytest.approx([2.5, 0, 0])


def test_links_are_depth_first_in_the_order_of_the_joints(tmp_path: Path) -> None:
    names = ["base", "a", "b", "c", "d"]
    tree = tree_of(
        read(
            tmp_path,
            *(link(name) for name in names),
            joint("to_d", "b", "d"),
            joint("to_c", "base", "c"),
            joint("to_a", "base", "a"),
            joint("to_b", "a", "b"),
        )
    )
    assert [(one.name, one.parent) for one in tree.links] == [
        ("to_c", -1), ("to_a", -1), ("to_b", 1), ("to_d", 2)]  # fmt: skip


def test_missing_numbers_are_zero(tmp_path: Path) -> None:
    robot = read(tmp_path, link("base", ""), link("a", ""), joint("j", "base", "a"), link("b"),
                 joint("k", "a", "b", '<origin rpy="0 1 0"/>'))  # fmt: skip
    carrier, body = tree_of(robot).links
    assert (carrier.mass, carrier.damping, carrier.stiffness) == (0, 0, 0)
    assert not carrier.inertia.any()
    assert not body.position.any()
    assert robot.left_out == ()
    plain = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
    products = last(read(tmp_path, link("base", ""), link("a", plain), joint("j", "base", "a")))
    assert products.inertia == pytest.approx(np.eye(3))
    empty = read(tmp_path, link("base", "<inertial/>"), link("a"), joint("j", "base", "a"))
    assert tree_of(empty).nv == 1


def test_root_floats_on_request(tmp_path: Path) -> None:
    lines = [link("base"), link("a"), joint("base", "base", "a")]
    tree = tree_of(read(tmp_path, *lines, floating=True))
    assert [(one.name, one.kind, one.mass) for one in tree.links] == [
        ("base_free", "free", 2), ("base", "hinge", 2)]  # fmt: skip
    falling = Dynamics(tree).acceleration(tree.zero, np.zeros(7), np.zeros(7))
    assert falling == pytest.approx([0, 0, 0, 0, 0, -9.81, 0], abs=1e-12)
    assert tree_of(read(tmp_path, *lines)).nv == 1


def test_floating_and_spherical_joints(tmp_path: Path) -> None:
    damped = '<dynamics damping="3"/>'
    robot = read(
        tmp_path,
        *LINKS,
        joint("f", "base", "a", damped, "floating"),
        joint("s", "a", "b", damped, "spherical"),
    )
    free, ball = tree_of(robot).links
    assert (free.kind, free.damping, ball.kind, ball.damping) == ("free", 0, "ball", 3)
    assert left_out(robot) == {"damping of a floating joint": ("f",)}
    assert robot.home == pytest.approx([0] * 9)
    assert np.isinf(robot.limits).all()


def test_floating_link_of_a_fixed_root_starts_at_the_world_origin(tmp_path: Path) -> None:
    """Ignore its `<origin>`, as MuJoCo does."""
    place = '<origin xyz="0.3 0.2 0.5" rpy="0.3 0.2 0.1"/>'
    lines = (link("root", ""), link("fly"), link("tail"))
    joints = (
        joint("loose", "root", "fly", place, "floating"),
        joint("wag", "fly", "tail", f'{place}<axis xyz="0 1 0"/>'),
    )
    robot = read(tmp_path, *lines, *joints)
    free, hinge = tree_of(robot).links
    assert free.position == pytest.approx([0, 0, 0])
    assert free.rotation == pytest.approx(np.eye(3))
    assert hinge.position == pytest.approx([0.3, 0.2, 0.5])
    assert not robot.floats
    case = run_case(model_task(prepare_tree(robot.file, states=8), "mujoco"))
    assert (case.outcome, case.reason) == (Outcome.AGREES, "")
    assert read(tmp_path, link("a"), link("b"), joint("j", "a", "b"), floating=True).floats


def test_a_file_without_a_moving_joint_is_free_if_it_has_mass(tmp_path: Path) -> None:
    assert read(tmp_path, link("block")).floats
    for scene in (link("world"), link("plane", "")):
        with pytest.raises(RobotError, match="no joint that moves, and no free mass; add a joint"):
            robot_system(read(tmp_path, scene))


BOX = '<collision><geometry><box size="0.4 0.2 0.1"/></geometry></collision>'
WHEEL = """<collision><origin rpy="1.5708 0 0"/><geometry><cylinder radius="0.1" length="0.02"/>
</geometry></collision>"""


@pytest.mark.parametrize(
    ("root", "heights", "free"),
    [
        ((BODY, BOX), ("-0.01", "-0.01"), True),
        ((BODY, BOX), ("-0.01", "0.2"), False),
        ((BODY, BOX), ("0.2", "0.2"), False),
        ((BODY, ""), ("-0.01", "-0.01"), False),
        (("", BOX), ("-0.01", "-0.01"), False),
    ],
    ids=["wheels", "one leg", "arms", "no shape", "no mass"],
)
def test_root_is_free_on_legs_or_wheels(
    root: tuple[str, str], heights: tuple[str, str], free: bool, tmp_path: Path
) -> None:
    """Require two chains that reach below the root's shapes; the caller can still hold it."""
    lines = [link("base", "".join(root)), *(link(name, BODY + WHEEL) for name in "ab")]
    lines += [
        joint(f"to_{name}", "base", name, f'<origin xyz="0 0 {z}"/><axis xyz="0 1 0"/>')
        for name, z in zip("ab", heights, strict=True)
    ]
    robot = read(tmp_path, *lines, floating=None)
    assert robot.floats == free
    words = {True: "root free", False: "root held" if all(root) else "kg"}
    assert robot_system(robot).title.endswith(words[free])
    assert not read(tmp_path, *lines, floating=False).floats


@pytest.mark.parametrize(("kind", "axis", "gimbal", "free"), [
    ("continuous", "0 0 1", 0.1, True), ("continuous", "1 0 0", 0.1, False),
    ("revolute", "0 0 1", 0.1, False), ("continuous", "0 0 1", 2.1, False),
])  # fmt: skip
def test_root_is_free_on_propellers(
    kind: str, axis: str, gimbal: float, free: bool, tmp_path: Path
) -> None:
    """Require light propellers, on upright hinges without limits, and a light gimbal."""
    light = BODY.replace('mass value="2"', 'mass value="0.1"')
    rest = f'<axis xyz="{axis}"/><limit lower="-1" upper="1" effort="1" velocity="1"/>'
    lines = [link("base", BODY + BOX), *(link(name, light) for name in "abc")]
    lines += [joint(f"to_{name}", "base", name, rest, kind) for name in "abc"]
    camera = BODY.replace('mass value="2"', f'mass value="{gimbal}"')
    lines += [link("camera", camera), joint("to_camera", "base", "camera", rest, "revolute")]
    assert read(tmp_path, *lines, floating=None).floats == free


def test_root_link_named_world_never_floats(tmp_path: Path) -> None:
    """Avoid false failures: engines disagree about the frame that a free joint there moves."""
    place = '<origin xyz="0 0.5 1" rpy="0.2 0 0"/>'
    lines = (link("world", ""), link("a"), link("b"), joint("w", "world", "a", place, "fixed"))
    robot = read(tmp_path, *lines, joint("j", "a", "b"), floating=True)
    assert not robot.floats
    assert [one.name for one in tree_of(robot).links] == ["j"]
    assert left_out(robot)["a free joint of the world"] == ("world",)
    task = model_task(prepare_tree(robot.file, floating=True, states=8), "mujoco")
    case = run_case(task)
    assert (case.outcome, case.reason) == (Outcome.AGREES, "")


OPTIONS = {
    'balanceinertia="true"': False, 'boundmass="2.5"': False, 'boundinertia="0.2"': False,
    'inertiafromgeom="true"': False, 'fusestatic="false"': True, 'discardvisual="false"': True,
}  # fmt: skip


@pytest.mark.parametrize("option", OPTIONS)
def test_compiler_options_that_change_inertias_differ(tmp_path: Path, option: str) -> None:
    """Expect agreement only for options that keep the inertias of the file."""
    box = '<geometry><box size="0.1 0.2 0.3"/></geometry>'
    shapes = f"<collision>{box}</collision><visual>{box}</visual></link>"
    odd = 'ixx="0.05"' if "balance" in option else 'ixx="0.3"'
    swung = link("a").replace("</link>", shapes).replace('ixx="0.3"', odd)
    robot = read(
        tmp_path, f"<mujoco><compiler {option}/></mujoco>", link("root", ""), swung,
        joint("j", "root", "a", '<axis xyz="0.2 1 0.3"/>'),
    )  # fmt: skip
    case = run_case(model_task(prepare_tree(robot.file, states=8), "mujoco"))
    assert case.outcome is (Outcome.AGREES if OPTIONS[option] else Outcome.DIFFERS)
    assert "<mujoco>" in left_out(robot)


def test_gazebo_springs_are_read(tmp_path: Path) -> None:
    spring = "<springStiffness>{}</springStiffness><springReference>0.2</springReference>"
    robot = read(
        tmp_path,
        *LINKS,
        joint("j", "base", "a"),
        joint("s", "a", "b", kind="fixed"),
        f'<gazebo reference="j">{spring.format(" 7 ")}</gazebo>',
    )
    hinge = tree_of(robot).links[0]
    assert (hinge.stiffness, hinge.rest) == (7, (0.2,))
    assert left_out(robot) == {}


@pytest.mark.parametrize(
    ("limit", "kind", "bounds", "home"),
    [
        ('<limit lower="-1" upper="2"/>', "revolute", (-1, 2), 0),
        ('<limit lower="-3" upper="-1"/>', "revolute", (-3, -1), -2),
        ('<limit upper="2"/>', "revolute", (0, 2), 0),
        ('<limit lower="-1" upper="2"/>', "continuous", (-np.inf, np.inf), 0),
        ('<limit lower="1" upper="-1"/>', "revolute", (-np.inf, np.inf), 0),
        ('<limit effort="1" velocity="1"/>', "revolute", (-np.inf, np.inf), 0),
        ("", "revolute", (-np.inf, np.inf), 0),
    ],
)
def test_limits_and_home_position(
    tmp_path: Path, limit: str, kind: str, bounds: tuple[float, float], home: float
) -> None:
    robot = read(tmp_path, link("base", ""), link("a"), joint("j", "base", "a", limit, kind))
    assert (*robot.limits[0], *robot.limits[1]) == bounds
    assert robot.home == pytest.approx([home])


def test_left_out_elements_are_reported(tmp_path: Path) -> None:
    shape = '<collision><geometry><mesh filename="package://a/b.stl"/></geometry></collision>'
    looks = '<visual><geometry><mesh filename="../../no/where.dae"/></geometry></visual>'
    limit = '<limit lower="-1" upper="1." effort="3" velocity="0"/>'
    robot = read(
        tmp_path,
        '<material name="white"/>',
        link("base", shape + shape + looks),
        link("a", BODY + shape + looks + "<contact/>"),
        link("b"),
        joint("j", "base", "a", limit + '<dynamics damping="1" friction="0.2"/>', "revolute"),
        joint("k", "a", "b", '<mimic joint="j" multiplier="2"/><dynamics friction="0"/>'),
        joint("m", "b", "d", '<mimic joint="j" offset="1" gain="2"/><origin><shift/></origin>'),
        link("d", BODY.replace("<inertial", '<inertial scale="2"')),
        '<transmission name="t"><joint name="j"><hardwareInterface/></joint></transmission>',
        "<gazebo><plugin/></gazebo>",
        '<gazebo reference="a"><turnGravityOff>true</turnGravityOff><mu1>1</mu1></gazebo>',
        joint("w", "b", "c", '<axis xyz="0 0 0" rpy="0 0 0"/>', "fixed"),
        '<link name="c" mass="3"/>',
        "<loop_joint/>",
    )
    assert (tree_of(robot).nv, tree_of(robot).dof) == (3, 2)
    assert left_out(robot) == {
        "dry friction": ("j",), "limits of position": ("j",), "limits of effort": ("j",),
        "mimic without a gear: the joint is free": ("m",), "<transmission>": ("t",),
        "<loop_joint>": (), "collision geometry": ("base", "a"), "<contact> of <link>": ("a",),
        "<plugin> of <gazebo>": (), "<turnGravityOff> of <gazebo>": ("a",),
        "<mu1> of <gazebo>": ("a",), "rpy of <axis>": ("w",), "mass of <link>": ("c",),
        "gain of <mimic>": ("m",), "<shift> of <origin>": ("m",), "scale of <inertial>": ("d",),
    }  # fmt: skip


WHOLE = f'<robot name="r">{link("base", "")}{link("a")}{joint("j", "base", "a")}</robot>'


@pytest.mark.parametrize(
    "text",
    [
        f'\n\n  <?xml version="1.0"?>\n{WHOLE}',
        f'<?xml version="1.0" encoding="ISO-8859-1"?><!-- é -->{WHOLE}'.encode("latin-1"),
        f"<!-- é -->{WHOLE}".encode("latin-1"),
        f'<?xml version="1.0" encoding="utf-16"?>{WHOLE}',
        f"\ufeff{WHOLE}",
        f"{WHOLE}\n\0",
        f"<!-- two -- hyphens -->{WHOLE}",
        WHOLE.replace('<link name="base">', '<link name="base"><xacro:nothing/>'),
        WHOLE.replace("0 0 -0.5", "0, 0, -0.5"),
        WHOLE.replace("0 0 -0.5", "0, 0 -0.5"),
        WHOLE.replace('<mass value="2"/>', '<mass value=" 2 "/><mass value="2"/>'),
    ],
)  # fmt: skip
def test_flaws_that_engines_ignore_are_accepted(tmp_path: Path, text: str | bytes) -> None:
    body = last(read_text(tmp_path, text))
    assert (body.mass, *body.center) == (2, 0, 0, -0.5)


def test_undecodable_bytes_in_names_are_kept(tmp_path: Path) -> None:
    text = WHOLE.replace('"a"', '"\u00e4"').encode("latin-1")
    assert read_text(tmp_path, text).bodies == (("\u00e4",),)
