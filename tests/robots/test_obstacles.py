"""Problems that prevent a tree: all are reported together, with their lines and remedies."""

from pathlib import Path

import pytest

from physics_crosscheck.engine import ModelSpec
from physics_crosscheck.harness.checks.findings import inertia_findings
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.readers import RobotError, robot_numbers, robot_system
from physics_crosscheck.harness.modelfiles.urdf.read import read_urdf_robot
from physics_crosscheck.reference.solving import samples
from tests.robots.files import (
    BODY,
    inertial,
    joint,
    left_out,
    link,
    problems,
    read,
    read_text,
    tree_of,
)

BASE, A, B = link("base", ""), link("a"), link("b")
CHAIN = (BASE, link("a", ""), B, joint("j", "base", "a"))


def test_all_problems_are_reported_with_their_lines(tmp_path: Path) -> None:
    robot = read(
        tmp_path,
        BASE,
        link("a", BODY.replace('value="2"', 'value="2 kg"')),
        link("a"),
        joint("p", "base", "a", kind="planar"),
        joint("q", "a", "b", kind="Revolute"),
        link("b"),
        joint("r", "b", "alon"),
        joint("s", "b", "c", '<origin xyz="${x} 0 0"/><axis xyz="0 0 0"/>'),
        link("c"),
        link("alone"),
        joint("s", "c", "alone"),
        "<joint/>",
    )
    assert problems(robot) == [
        (3, "value of <mass> of link 'a' is '2 kg'; expected a finite number"),
        (4, "a second link is called 'a'"),
        (5, "joint 'p' is planar, which is not covered"),
        (6, "joint 'q' is of type 'Revolute'"),
        (8, "the child of joint 'r' is 'alon', which is not a link"),
        (9, "xyz of <origin> of joint 's' is '${x} 0 0'; expected 3 finite numbers"),
        (9, "the axis of joint 's' has no length"),
        (12, "a second joint is called 's'"),
        (13, "a <joint> has no name"),
    ]
    assert all(one.file == tmp_path / "robot.urdf" for one in robot.obstacles)
    assert "xacro" in robot.obstacles[5].remedy
    for index, close in ((3, "revolute"), (4, "alone")):
        assert robot.obstacles[index].remedy.endswith(f"; did you mean {close!r}?")
    assert str(robot.obstacles[2]).startswith(f"{tmp_path / 'robot.urdf'}:5: joint 'p' is planar")


@pytest.mark.parametrize(
    ("lines", "line", "sentence"),
    [
        ((BASE, A, B, joint("j", "base", "a")), 4, "it has 2 root links, 'base', 'b'"),
        ((A, joint("j", "world", "a")), 3,
         "the parent of joint 'j' is 'world', which is not a link"),
        (
            (BASE, A, B, joint("j", "base", "a"), joint("k", "a", "b"), joint("l", "base", "b")),
            7,
            "link 'b' has a second parent, by joint 'l'",
        ),
        (
            (BASE, A, B, joint("j", "b", "a"), joint("k", "a", "b")),
            3,
            "link 'a' is its own ancestor through its joints",
        ),
        ((A, joint("j", "a", "a")), 2, "link 'a' is its own ancestor through its joints"),
        ((BASE, A, joint("j", "base", "a"), joint("k", "a", "world")), 5,
         "the child of joint 'k' is 'world', which is not a link"),
        ((BASE, A, '<joint name="j" type="fixed"><parent link="base"/></joint>'), 4,
         "joint 'j' has no child"),
        ((BASE, link("a", BODY.replace("ixx", "Ixx")), joint("j", "base", "a")), 3,
         "the inertia of link 'a' has no ixx"),
        ((link("a", BODY.replace('<mass value="2"/>', "<mass>2</mass>")),), 2,
         "link 'a' has an inertial without mass"),
        ((BASE, A, joint("j", "base", "a"), '<gazebo reference="j">',
          "<springStiffness>stiff</springStiffness></gazebo>"), 6,
         "<springStiffness> of joint 'j' is 'stiff'; expected a finite number"),
        ((BASE, A, joint("j", "base", "a"), '<gazebo reference="nobody">',
          "<springStiffness>7</springStiffness></gazebo>"), 6,
         "a spring names 'nobody', which is neither a slide nor a hinge"),
        ((BASE, A, joint("j", "base", "a", kind="spherical"), '<gazebo reference="j">',
          "<springStiffness>7</springStiffness></gazebo>"), 6,
         "a spring names 'j', which is neither a slide nor a hinge"),
        ((BASE, A, joint("j", "base", "a", '<limit lower="-1.57." upper="1"/>', "revolute")), 4,
         "lower of <limit> of joint 'j' is '-1.57.'; expected a finite number"),
        ((BASE, A, joint("j", "base", "a", '<limit lower="0" upper="inf"/>', "revolute")), 4,
         "upper of <limit> of joint 'j' is 'inf'; expected a finite number"),
        ((BASE, A, joint("j", "base", "a", '<mimic joint="j"/>')), 4, "joint 'j' mimics itself"),
        ((BASE, A, joint("j", "base", "a", '<mimic joint="k"/>')), 4,
         "joint 'j' mimics 'k', which is not a joint"),
        ((BASE, A, joint("j", "base", "a", '<axis xzy="0 0 1"/>')), 4,
         "the <axis> of joint 'j' has no xyz"),
        ((BASE, "<robot/>"), 3, "a <robot> inside the <robot>"),
        ((), 1, "it has no <link>"),
        ((BASE, '<xacro:include filename="a"/>', "<xacro:arm/>"), 3,
         "it is xacro source: 2 elements such as <xacro:include>"),
        ((BASE, link("a", inertial("1e200", "1 1 1", origin='<origin xyz="1e200 0 0"/>')),
          joint("j", "base", "a", '<axis xyz="0 1 0"/>')), 1, "its mass matrix is not finite"),
        ((BASE, A, link("b", inertial("-2", "0 0 0")), joint("j", "base", "a"),
          joint("w", "a", "b", kind="fixed")), 4,
         "the masses of link 'b' and of the links fixed to it add up to zero, with a negative one"),
        *(((BASE, A, joint("j", "base", "a", f'<origin xyz="{text}"/>')), 4,
           f"xyz of <origin> of joint 'j' is {text!r}; expected 3 finite numbers") for text in (
            "0,5 0 0", "0.1,0,0", "0.1 ,0 ,0", "0 0", "0 0 0 0", "nan 0 0", "1e999 0 0")),
        ((*(link(name, "") for name in "abc"), joint("j", "a", "b"), joint("k", "b", "c")), 1,
         "none of its 2 joints moves anything with inertia: the file describes kinematics only"),
        ((*CHAIN, joint("k", "a", "b", '<origin xyz="2 0 0"/>')), 5,
         "a combined motion of the joints 'j', 'k' moves nothing with inertia, so their"
         " accelerations are undefined"),
        ((*CHAIN, joint("k", "a", "b", '<axis xyz="0 1 0"/>')), 0, ""),
        ((BASE, A, joint("j", "base", "a"), link("b", inertial("1e-12", "1e-20 1e-20 1e-20")),
          joint("k", "a", "b", '<origin xyz="5 0 0"/>')), 0, ""),
    ],
)  # fmt: skip
def test_problem_is_reported_with_its_line_or_none(
    tmp_path: Path, lines: tuple[str, ...], line: int, sentence: str
) -> None:
    assert problems(read(tmp_path, *lines)) == [(line, sentence)] * bool(line)


@pytest.mark.parametrize(
    ("text", "line", "sentence"),
    [
        ("<robot>\n<link>\n</robot>", 3, "not XML at column 3: mismatched tag"),
        ("", 1, "not XML: the file has no element"),
        (b"<robot>\0<link/>\n</robot>", 1, "not XML at column 8: the file is binary"),
        ('<!DOCTYPE r [<!ENTITY x "1">]>\n<robot/>', 1, "refused: it declares entities or a DTD"),
        ("<robot/>".encode("utf-16"), 1, "its encoding is UTF-16"),
        ("<sdf/>", 1, "the root is <sdf>, not <robot>"),
        (b"\x89PNG\r\n\x1a\n", 1, "not XML at column 1: not well-formed (invalid token)"),
    ],
)
def test_invalid_urdf_is_refused(
    tmp_path: Path, text: str | bytes, line: int, sentence: str
) -> None:
    assert (line, sentence) in problems(read_text(tmp_path, text))


def test_unreadable_file_is_refused(tmp_path: Path) -> None:
    for path in (tmp_path / "none.urdf", tmp_path):
        robot = read_urdf_robot(path)
        assert [one.line for one in robot.obstacles] == [0]
        assert str(robot.obstacles[0]).startswith(f"{path}: can't be read: ")


def test_joints_that_move_no_inertia_are_held_still(tmp_path: Path) -> None:
    lines = [
        BASE,
        A,
        link("camera", ""),
        joint("j", "base", "a"),
        joint("pan", "a", "camera", kind="revolute"),
        link("point", inertial("1", "0 0 0", origin='<origin xyz="3 0 0" rpy="1 2 3"/>')),
        joint("spin", "a", "point"),
    ]
    robot = read(tmp_path, *lines)
    assert problems(robot) == []
    assert robot.held == ("pan", "spin")
    assert [one.name for one in tree_of(robot).links] == ["j"]
    assert tree_of(robot).links[0].mass == 3  # the mass of the link 'point'
    assert left_out(robot)["joints that move nothing with inertia (held still)"] == ("pan", "spin")
    after = joint("z", "base", "hand", '<mimic joint="pan"/>')
    robot = read(tmp_path, *lines, link("hand", ""), after)
    assert (robot.held, tree_of(robot).couplings) == (("pan", "spin", "z"), ())
    follower = joint("k", "base", "b", '<mimic joint="pan"/>')
    led = read(tmp_path, *lines, link("b"), follower)
    assert (problems(led), led.held) == ([], ("spin",))  # 'pan' has the inertia of 'k'


def test_neck_of_a_point_mass_is_compared_or_named_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Catch a verdict that one position prevents, and a reason that leaves out a joint or link."""
    head = link("head", inertial("1.3", "0 0 0", origin='<origin xyz="0.02 0 0.1"/>'))
    pitch, roll, yaw = (f'<axis xyz="{axis}"/>' for axis in ("0 1 0", "1 0 0", "0 0 1"))
    range_ = '<limit lower="-{0}" upper="{0}" effort="9" velocity="9"/>'
    lines = (
        BASE, A, link("n1", ""), link("n2", ""), head, joint("j", "base", "a"),
        joint("pitch", "a", "n1", pitch + range_.format(0.7), kind="revolute"),
        joint("roll", "n1", "n2", f'<origin xyz="0.01 0 0"/>{roll}'),
    )  # fmt: skip
    with monkeypatch.context() as patch:
        patch.setattr(samples, "MIN_EIGENVALUE", 1e-7)  # 1e-13 is rare
        read(tmp_path, *lines, joint("yaw", "n2", "head", yaw + range_.format(1), kind="revolute"))
        assert prepare_tree(tmp_path / "robot.urdf", states=4).tree.nv == 4
    read(tmp_path, *lines, joint("yaw", "n2", "head", yaw + range_.format(2e-5), kind="revolute"))
    with pytest.raises(RobotError, match=r"'pitch', 'roll' and 'yaw' move .* move: 'head'"):
        prepare_tree(tmp_path / "robot.urdf", states=4)


_LOCKED = {
    "robot.urdf": (
        '<robot name="r"><link name="w"/>'
        + link("b")
        + link("c")
        + joint("lift", "w", "b", '<dynamics damping="1e11"/>')
        + joint("j", "b", "c")
        + "</robot>"
    ),
    "robot.xml": (
        '<mujoco><worldbody><body><joint name="lift" type="slide" damping="1e11"/>'
        '<geom size=".1"/><body pos="1 0 0"><joint name="j"/><geom size=".1"/></body></body>'
        '</worldbody><actuator><motor joint="lift"/><motor joint="j"/></actuator></mujoco>'
    ),
    "robot.sdf": (
        '<sdf version="1.9"><model name="m"><link name="b"/>'
        '<link name="c"><pose>1 0 0 0 0 0</pose></link>'
        '<joint name="lift" type="prismatic"><parent>world</parent><child>b</child><axis>'
        "<xyz>0 0 1</xyz><dynamics><damping>1e11</damping></dynamics></axis></joint>"
        '<joint name="j" type="revolute"><parent>b</parent><child>c</child><axis>'
        "<xyz>0 0 1</xyz></axis></joint></model></sdf>"
    ),
}
_LOCKED["spring.xml"] = _LOCKED["robot.xml"].replace('damping="1e11"', 'stiffness="1e20"')


@pytest.mark.parametrize("name", _LOCKED)
def test_joint_that_damping_locks_is_held_and_listed(tmp_path: Path, name: str) -> None:
    file = tmp_path / name
    file.write_text(_LOCKED[name])
    prepared = prepare_tree(file, states=4)
    assert (prepared.names, prepared.settings["held"]) == (("j",), ["lift"])
    assert "joints that their damping or spring locks (held still)" in prepared.left_out
    (advice,) = [one for one in prepared.findings if one.subject == ("lift",)]
    assert advice.message.startswith("joint 'lift' is locked by its damping")
    numbers = robot_numbers(file, prepared.settings).tree({})
    assert numbers is not None
    assert numbers.nv == 1
    if name.endswith(".xml"):  # a drive of a joint that is held has no control
        assert engines()["mujoco"].load(ModelSpec(file, settings=prepared.settings)).coordinates


def test_massless_root_floats_only_with_a_welded_mass(tmp_path: Path) -> None:
    assert problems(read(tmp_path, BASE, A, joint("j", "base", "a"), floating=True)) == [
        (2, "a combined motion of the joints 'base', 'j' moves nothing with inertia, so their"
            " accelerations are undefined"),
    ]  # fmt: skip
    welded = joint("j", "base", "a", kind="fixed")
    assert problems(read(tmp_path, BASE, A, welded, floating=True)) == []


def test_impossible_inertias_are_named_before_their_consequences(tmp_path: Path) -> None:
    negative = inertial("0.5", "-0.1 -0.1 0.01")
    hip = joint("hip", "base", "thigh")
    robot = read(tmp_path, BASE, link("thigh", negative), hip)
    with pytest.raises(RobotError, match=r":3: link 'thigh' has the principal moments") as raised:
        robot_system(robot)
    assert raised.value.kind == "moments"
    assert "moves nothing" not in str(raised.value)
    assert [one.severity for one in inertia_findings(robot)] == ["finding"]
    light = link("a", inertial("-1", "0.02 0.02 0.01", origin='<origin xyz="0 0 -0.2"/>'))
    with pytest.raises(RobotError, match=":3: link 'a' has a mass of -1 kg") as raised:
        robot_system(read(tmp_path, BASE, light, joint("j", "base", "a")))
    assert raised.value.kind == "negative mass"
    flat = link("a", inertial("1", "0.1 0.1 0.5"))
    unread = read(tmp_path, BASE, flat, joint("j", "base", "a"), joint("k", "base", "gone"))
    with pytest.raises(RobotError, match=r"(?s)largest can't exceed.*'gone'"):
        robot_system(unread)
