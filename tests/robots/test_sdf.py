"""SDFormat files as trees of bodies: frames by the format's pose semantics, and refused files."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.harness.documents.document import Document
from physics_crosscheck.harness.documents.expanded import in_source, source_of
from physics_crosscheck.harness.engines.sdf import load_sdf, sdf_remarks
from physics_crosscheck.harness.engines.urdf import UrdfReader
from physics_crosscheck.harness.modelfiles.mesh_files import unread_meshes
from physics_crosscheck.harness.modelfiles.readers import read_robot, robot_numbers
from physics_crosscheck.harness.modelfiles.robot import Robot
from physics_crosscheck.harness.modelfiles.robot_targets import robot_files
from physics_crosscheck.reference.dynamics.recursion import Recursion
from physics_crosscheck.reference.mechanism.rotations import Place, from_rpy
from physics_crosscheck.reference.mechanism.tree import Tree
from tests.robots.files import left_out, problems, tree_of

TENSOR = "<ixx>0.1</ixx><iyy>0.2</iyy><izz>0.15</izz><ixy>0.01</ixy><ixz>0.02</ixz><iyz>0.03</iyz>"
INERTIAL = (
    "<inertial><pose>0.1 0.2 -0.5 0.3 0.2 0.1</pose><mass>2</mass>"
    f"<inertia>{TENSOR}</inertia></inertial>"
)
WELD = '<joint name="weld" type="fixed"><parent>world</parent><child>base</child></joint>'
BASE = f'<link name="base"><pose>0.1 0.2 0.3 0.2 0.1 0.4</pose>{INERTIAL}</link>'
ARM = f'<link name="arm"><pose>0.4 0.1 0.2 -0.3 0.5 0.1</pose>{INERTIAL}</link>'


def joint(inner: str = "", xyz: str = "<xyz>0.2 -1 0.3</xyz>", pose: str = "") -> str:
    return (
        f'<joint name="q" type="revolute"><parent>base</parent><child>arm</child>{pose}'
        f"<axis>{xyz}{inner}</axis></joint>"
    )


def read(folder: Path, *lines: str, version: str = "1.9", world: str = "") -> Robot:
    """Read a model with these lines; the first is the file's second."""
    model = "\n".join(
        ["<model name='m'><pose>0.3 -0.2 0.1 0.2 0.1 -0.3</pose>", *lines, "</model>"]
    )
    inner = f"<world name='w'>{world}{model}</world>" if world else model
    path = folder / "robot.sdf"
    path.write_text(f"<sdf version='{version}'>{inner}</sdf>")
    return read_robot(path)


def auto(geometry: str, density: str = "", within: str = "") -> str:
    """Return a link whose inertia follows from one shape."""
    return (
        f'<link name="arm"><pose>0.4 0.1 0.2 -0.3 0.5 0.1</pose><inertial auto="true">{within}'
        f'</inertial><collision name="c"><pose>0.1 0.2 0.3 0.4 0.5 0.6</pose>{density}'
        f"<geometry>{geometry}</geometry></collision></link>"
    )


def place(text: str) -> Place:
    x, y, z, roll, pitch, yaw = map(float, text.split())
    return Place(from_rpy(roll, pitch, yaw), np.array([x, y, z]))


MODEL = place("0.3 -0.2 0.1 0.2 0.1 -0.3")
ARM_THERE = place("0.4 0.1 0.2 -0.3 0.5 0.1")
LATER = "<pose>0.05 0.1 0 0.2 0.1 0.3</pose>"


def axis(tree: Tree, angle: float = 0.0) -> np.ndarray:
    """Return the axis of the only joint in the world frame, (3,)."""
    (pose,) = Recursion(tree).poses(np.array([[angle]]))
    direction: np.ndarray = pose.rotation[..., 0] @ tree.links[0].axis
    return direction


@pytest.mark.parametrize(("version", "xyz", "frame"), [
    ("1.4", "<xyz>0.2 -1 0.3</xyz>", "model"),
    ("1.6", "<xyz>0.2 -1 0.3</xyz>", "joint"),
    ("1.6", "<use_parent_model_frame>1</use_parent_model_frame><xyz>0.2 -1 0.3</xyz>", "model"),
    ("1.9", "<xyz>0.2 -1 0.3</xyz>", "joint"),
    ("1.9", '<xyz expressed_in="__model__">0.2 -1 0.3</xyz>', "model"),
    ("1.9", '<xyz expressed_in="arm">0.2 -1 0.3</xyz>', "arm"),
])  # fmt: skip
def test_axis_frame_depends_on_version_and_attributes(
    version: str, xyz: str, frame: str, tmp_path: Path
) -> None:
    arm = MODEL.compose(ARM_THERE)
    turn = {"model": MODEL, "arm": arm, "joint": arm.compose(place("0.05 0.1 0 0.2 0.1 0.3"))}[
        frame
    ]
    tree = tree_of(read(tmp_path, BASE, ARM, WELD, joint(xyz=xyz, pose=LATER), version=version))
    components = np.array([0.2, -1.0, 0.3])
    expected = turn.rotation @ components / np.linalg.norm(components)
    assert axis(tree) == pytest.approx(expected, abs=1e-15)


def test_joint_origin_and_inertial_rotation(tmp_path: Path) -> None:
    tree = tree_of(read(tmp_path, BASE, ARM, WELD, joint(pose=LATER)))
    (link,) = tree.links
    (pose,) = Recursion(tree).poses(np.zeros((1, 1)))
    arm = MODEL.compose(ARM_THERE)
    assert pose.origin[:, 0] == pytest.approx(arm.transform(np.array([0.05, 0.1, 0.0])), abs=1e-15)
    turn = place("0.1 0.2 -0.5 0.3 0.2 0.1").rotation
    moments = np.array([[0.1, 0.01, 0.02], [0.01, 0.2, 0.03], [0.02, 0.03, 0.15]])
    assert link.inertia == pytest.approx(turn @ moments @ turn.T, abs=1e-15)
    assert link.center == pytest.approx([0.05, 0.1, -0.5], abs=1e-15)


def same(tree: Tree, other: Tree) -> bool:
    return all(
        np.allclose(getattr(a, name), getattr(b, name), atol=1e-14)
        for a, b in zip(tree.links, other.links, strict=True)
        for name in ("position", "rotation", "axis", "mass", "center", "inertia", "damping")
    )


@pytest.mark.parametrize("lines", [
    # By a frame that is attached to another one, and through a joint.
    ('<frame name="f" attached_to="base"><pose relative_to="__model__">0.4 0.1 0.2 0 0 0</pose>'
     '</frame><frame name="g" attached_to="f"><pose>0 0 0 -0.3 0.5 0.1</pose></frame>',
     f'<link name="arm"><pose relative_to="g"/>{INERTIAL}</link>', joint(pose=LATER)),
    # Angles in degrees, and a quaternion.
    ("", '<link name="arm"><pose degrees="true">0.4 0.1 0.2 -17.188733853924695 28.64788975654116'
     f' 5.729577951308232</pose>{INERTIAL}</link>', joint(pose=LATER)),
    # The pose of a joint relative to its child link.
    ("", ARM, joint(pose='<pose relative_to="arm">0.05 0.1 0 0.2 0.1 0.3</pose>')),
    # A frame for the child, and one for the parent.
    ('<frame name="f" attached_to="arm"/><frame name="g" attached_to="base"/>', ARM,
     joint(pose=LATER).replace(">arm<", ">f<").replace(">base<", ">g<")),
])  # fmt: skip
def test_equivalent_poses_make_the_same_tree(lines: tuple[str, str, str], tmp_path: Path) -> None:
    plain = tree_of(read(tmp_path, BASE, ARM, WELD, joint(pose=LATER)))
    assert same(tree_of(read(tmp_path, BASE, WELD, *lines)), plain)


def test_quaternion_has_its_real_part_last(tmp_path: Path) -> None:
    half = np.sqrt(0.5)
    pose = f'<pose rotation_format="quat_xyzw">0.4 0.1 0.2 {half} 0 0 {half}</pose>'
    quarter = ARM.replace("-0.3 0.5 0.1", f"{np.pi / 2} 0 0")
    expected = tree_of(read(tmp_path, BASE, WELD, quarter, joint()))
    arm = f'<link name="arm">{pose}{INERTIAL}</link>'
    assert same(tree_of(read(tmp_path, BASE, WELD, arm, joint())), expected)


def test_springs_dampers_limits_gravity_and_the_world_are_read(tmp_path: Path) -> None:
    inner = (
        "<dynamics><damping>0.3</damping><spring_stiffness>5</spring_stiffness>"
        "<spring_reference>0.2</spring_reference><friction>0.1</friction></dynamics>"
        "<limit><lower>-1</lower><upper>1e16</upper><effort>-1</effort></limit>"
    )
    world = "<gravity>0.1 0 -3.7</gravity><physics><max_step_size>0.004</max_step_size></physics>"
    falls = BASE.replace("</link>", "<gravity>false</gravity></link>")
    robot = read(tmp_path, falls, ARM, WELD, joint(inner), world=world)
    (link,) = tree_of(robot).links
    assert (link.damping, link.stiffness, link.rest) == (0.3, 5.0, (0.2,))
    assert (robot.limits[0][0], robot.limits[1][0]) == (-1.0, np.inf)
    assert robot.stated == {"gravity": [0.1, 0.0, -3.7], "step": 0.004}
    assert tree_of(robot).gravity.tolist() == [0.1, 0.0, -3.7]
    assert {"dry friction", "limits of position"} <= set(left_out(robot))


def test_unattached_base_floats_with_the_default_inertia(tmp_path: Path) -> None:
    robot = read(tmp_path, '<link name="base"/>', ARM, joint())
    free, _ = tree_of(robot).links
    assert robot.floats
    assert (free.kind, free.mass) == ("free", 1.0)
    assert free.inertia.tolist() == np.eye(3).tolist()
    assert not read(tmp_path, BASE, ARM, WELD, joint()).floats


@pytest.mark.parametrize(
    ("limit", "bounds"),
    [("", ""), ("<lower>1</lower><upper>-1</upper>", ""), ("<lower>-1</lower>", "[-1, inf]")],
)
def test_only_limits_of_the_file_are_reported(tmp_path: Path, limit: str, bounds: str) -> None:
    file = read(tmp_path, WELD, BASE, ARM, joint(f"<limit>{limit}</limit>")).file
    reader, rest = UrdfReader(name="engine", no_inertial="none"), np.zeros((2, 1))
    remarks = [one.message for one in sdf_remarks(load_sdf(file), reader, ["q"], rest, rest)]
    ranges = [one.split(", and")[0] for one in remarks]
    assert ranges == ([f"q is limited to {bounds}"] if bounds else [])


def test_ball_and_universal_joints_are_read(tmp_path: Path) -> None:
    inner = "<dynamics><damping>0.3</damping><friction>1</friction></dynamics>"
    ball = joint(inner, pose=LATER).replace("revolute", "ball")
    robot = read(tmp_path, BASE, ARM, WELD, ball)
    (link,), (hinge,) = (
        tree_of(one).links for one in (robot, read(tmp_path, BASE, ARM, WELD, joint(pose=LATER)))
    )
    assert (link.kind, link.damping) == ("ball", 0.3)
    assert link.center == pytest.approx(hinge.center)
    assert link.position == pytest.approx(hinge.position)
    assert {"<xyz> of a ball joint", "<friction> of a ball joint"} <= set(left_out(robot))
    two = joint(inner).replace("revolute", "universal")
    second = "</axis><axis2><xyz>1 0.2 0</xyz></axis2>"
    robot = read(tmp_path, BASE, ARM, WELD, two.replace("</axis>", second))
    first, last = tree_of(robot).links
    assert (first.name, first.damping, last.name, last.damping) == ("q:1", 0.3, "q:2", 0.0)
    assert last.axis == pytest.approx(np.array([1, 0.2, 0]) / np.hypot(1, 0.2))


def test_mimic_is_a_coupling_unless_it_has_an_offset(tmp_path: Path) -> None:
    mimic = '<mimic joint="q"><multiplier>0.5</multiplier>{}</mimic>'
    more = joint().replace('"q"', '"k"').replace(">arm<", ">tip<").replace(">base<", ">arm<")
    lines = (BASE, ARM, ARM.replace('"arm"', '"tip"'), WELD, joint())
    held = read(tmp_path, *lines, more.replace("</axis>", mimic.format("") + "</axis>"))
    (coupling,) = tree_of(held).couplings
    assert (coupling.follower, coupling.leader, coupling.multiplier) == (1, 0, 0.5)
    again = read(tmp_path, *lines, joint().replace('"q"', '"p"'), more)
    assert (left_out(again)["joint that closes a loop"], tree_of(again).nv) == (("p",), 2)
    free = mimic.format("<offset>0.1</offset>")
    robot = read(tmp_path, *lines, more.replace("</axis>", free + "</axis>"))
    assert not tree_of(robot).couplings
    assert left_out(robot)["mimic without a gear: the joint is free"] == ("k",)


@pytest.mark.parametrize(("lines", "line", "message"), [
    ((BASE, ARM, joint(), "<include/>"), 5, "<include> is not covered"),
    ((BASE, ARM, joint(), "<model name='n'/>"), 5, "<model> is not covered"),
    ((BASE, ARM, joint().replace("revolute", "gearbox")), 4, "'gearbox', which no engine reads"),
    ((BASE, ARM, joint().replace("revolute", "screw").replace(
        "<axis>", "<thread_pitch>0</thread_pitch><axis>")), 4, "<thread_pitch> of joint 'q' is 0"),
    ((BASE, ARM, joint().replace("revolute", "universal")), 4, "joint 'q' has no <axis2>"),
    ((BASE, ARM), 3, "no joint holds 'base', 'arm'"),
    ((BASE, "<static>true</static>"), 3, "the model is static"),
    ((BASE.replace("<pose>", '<pose frame="f">', 1), WELD), 2, "frame= of the pose of link 'base'"),
    ((BASE, WELD, auto("<mesh><uri>a.dae</uri></mesh>")), 4,
     "<inertial auto=\"true\"> of link 'arm' is not computed from a <mesh>"),
    ((BASE, WELD, auto("<box><size>1 1 0</size></box>")), 4, "<size> of link 'arm' is not"),
    ((BASE, WELD, auto("<box/>").replace("collision", "visual")), 4, "has no <collision>"),
    ((BASE, ARM, joint().replace(">arm<", ">leg<")), 4, "the child of joint 'q' is 'leg'"),
    ((BASE, ARM, joint(xyz="<xyz>0 0 0</xyz>")), 4, "the axis of joint 'q' has no length"),
    ((BASE, ARM.replace("-0.3 0.5", "x 0.5"), joint()), 3, "expected 6 finite numbers"),
    ((BASE, ARM, re.sub("<axis>.*</axis>", "", joint())), 4, "joint 'q' has no <axis>"),
    ((BASE, ARM.replace("<mass>2", "<mass>inf"), joint()), 3,
     "<mass> of link 'arm' is 'inf'; expected a finite number"),
    ((BASE, ARM, joint("<limit><lower>inf</lower><upper>1 2</upper></limit>")), 4,
     "<upper> of joint 'q' is '1 2'; expected a finite number"),
    ((BASE, ARM, joint('<mimic joint="q"/>')), 4, "names 'q', which is not another joint"),
    ((BASE, BASE, ARM, joint()), 3, "a second link, joint or frame is called 'base'"),
    ((BASE, ARM.replace("<pose>", '<pose relative_to="nowhere">', 1), joint()), 3,
     "frame 'nowhere', which a pose refers to, does not exist"),
    ((BASE, ARM.replace("<pose>", '<pose relative_to="arm">', 1), joint()), 3,
     "is defined in itself"),
])  # fmt: skip
def test_problem_is_reported_with_its_line(
    lines: tuple[str, ...], line: int, message: str, tmp_path: Path
) -> None:
    reported = problems(read(tmp_path, *lines))
    assert any(where == line and message in sentence for where, sentence in reported), reported


def test_parts_that_no_joint_connects_are_models(tmp_path: Path) -> None:
    """Catch a loose link that refuses its model, moves with it, or moves the frames of others."""
    box = BASE.replace('"base"', '"box"').replace("<mass>2", "<mass>7")
    arm = ARM.replace("<pose>", '<pose relative_to="box">', 1)
    weld = WELD.replace("weld", "bolt").replace(">world<", ">f<").replace(">base<", ">tip<")
    loose = (box, '<frame name="f" attached_to="box"/>', ARM.replace('"arm"', '"tip"'), weld)
    read(tmp_path, *loose, BASE, arm, WELD, joint())
    files = robot_files([str(tmp_path / "robot.sdf")]).files
    trees = {robot.name: tree_of(robot) for robot in map(read_robot, files)}
    assert [(name, tree.nv) for name, tree in trees.items()] == [("m", 1), ("m.box", 6)]
    assert trees["m.box"].links[0].mass == 9
    place = ARM.replace("<pose>", '<pose relative_to="base">', 1)  # which is where the box is
    held = tree_of(read(tmp_path, BASE, place, WELD, joint())).links[0]
    assert np.allclose(held.position, trees["m"].links[0].position, rtol=0, atol=1e-15)


def test_tree_with_a_changed_number_matches_the_changed_file(tmp_path: Path) -> None:
    read(tmp_path, BASE, ARM, WELD, joint(pose=LATER))
    file = tmp_path / "robot.sdf"
    numbers = robot_numbers(file, {})
    named = {one.address: i for i, one in enumerate(numbers.numerals)}
    for address in ("link[arm]/inertial/pose[3]", "link[arm]/inertial/mass", "joint[q]/pose[1]",
                    "joint[q]/axis/xyz[0]", "model[m]/pose[5]"):  # fmt: skip
        index = named[address]
        assert index in numbers.relevant_numbers
        before, changed = numbers.tree({}), numbers.tree({index: 0.125})
        assert before is not None
        assert changed is not None
        assert not same(before, changed)
        (text,) = numbers.texts({index: 0.125}).values()
        other = tmp_path / "other.sdf"
        other.write_bytes(text)
        assert same(tree_of(read_robot(other)), changed)
    assert named["sdf@version"] not in numbers.relevant_numbers


def test_sdf_files_are_listed_as_robots(tmp_path: Path) -> None:
    read(tmp_path, BASE, ARM, WELD, joint())
    assert robot_files([str(tmp_path / "robot.sdf")]).files == [tmp_path / "robot.sdf"]


@pytest.mark.parametrize(("geometry", "mass", "moments"), [
    ("<box><size>0.1 0.2 0.3</size></box>", 4.2, (0.0455, 0.035, 0.0175)),
    ("<sphere><radius>0.1</radius></sphere>", 2.932153143350474, (0.01172861257,) * 3),
    ("<ellipsoid><radii>0.1 0.2 0.3</radii></ellipsoid>", 17.59291886010284,
     (0.45741589, 0.35185838, 0.17592919)),
    ("<cylinder><radius>0.1</radius><length>0.4</length></cylinder>", 8.796459430051423,
     (0.13927727, 0.13927727, 0.0439823)),
    ("<capsule><radius>0.1</radius><length>0.4</length></capsule>", 11.728612573401898,
     (0.31227431, 0.31227431, 0.05571091)),
    ("<cone><radius>0.1</radius><length>0.4</length></cone>", 2.932153143350474,
     (0.02199115, 0.02199115, 0.00879646)),
])  # fmt: skip
def test_automatic_inertia_follows_from_the_shape_and_its_density(
    geometry: str, mass: float, moments: tuple[float, ...], tmp_path: Path
) -> None:
    """Compare masses with libsdformat 15, and moments with textbook formulas."""
    lines = (BASE, WELD, joint(), auto(geometry, "<density>700</density>"))
    (link,) = tree_of(read(tmp_path, *lines)).links
    assert link.mass == pytest.approx(mass, rel=1e-14)
    assert sorted(np.linalg.eigvalsh(link.inertia)) == pytest.approx(sorted(moments), rel=1e-7)
    height = -0.1 if "cone" in geometry else 0.0
    center = place("0.1 0.2 0.3 0.4 0.5 0.6").transform(np.array([0.0, 0.0, height]))
    assert link.center == pytest.approx(center, abs=1e-15)


def test_stated_mass_scales_the_densities_of_several_shapes(tmp_path: Path) -> None:
    ball = '<collision name="d"><density>3000</density><geometry><sphere/></geometry></collision>'
    light = "<density>500</density>"

    def arm(within: str) -> str:
        return auto("<box/>", within=within).replace("</link>", ball + "</link>")

    def mass_and_center(within: str) -> tuple[float, float]:
        (link,) = tree_of(read(tmp_path, BASE, WELD, joint(), arm(within))).links
        return link.mass, link.center[2]

    total = 500 + 3000 * 4 / 3 * np.pi
    assert mass_and_center(light) == pytest.approx((total, 0.3 * 500 / total), rel=1e-14)
    assert mass_and_center(f"{light}<mass>5</mass>") == pytest.approx((5, 0.3 * 500 / total))


def test_shape_numbers_are_relevant_only_with_an_automatic_inertia(tmp_path: Path) -> None:
    shaped = BASE.replace(
        "</link>", "<collision name='k'><pose>1 0 0 0 0 0</pose></collision></link>"
    )
    read(tmp_path, shaped, WELD, joint(), auto("<sphere><radius>0.1</radius></sphere>"))
    numbers = robot_numbers(tmp_path / "robot.sdf", {})
    named = {one.address: i for i, one in enumerate(numbers.numerals)}
    radius = next(i for a, i in named.items() if a.endswith("sphere/radius"))
    assert radius in numbers.relevant_numbers
    assert named["collision[k]/pose[0]"] not in numbers.relevant_numbers
    changed = numbers.tree({radius: 0.2})
    assert changed is not None
    assert changed.links[0].mass == pytest.approx(1000 * 4 / 3 * np.pi * 0.008)


STATIC = "<model name='ground'><static>true</static><link name='l'/></model>"
SECOND = "<model name='second'><link name='l'><inertial><mass>7</mass></inertial></link></model>"


def test_other_elements_of_a_world_are_reported_as_left_out(tmp_path: Path) -> None:
    world = (
        f"{STATIC}<include><uri>model://sun</uri></include><wind/><light name='s' kind='a'/>"
        "<physics name='p' type='ode'><max_step_size>0.002</max_step_size><ode/></physics>"
    )
    sensor = "<sensor name='s'><plugin name='p'><model/><include/></plugin></sensor>"
    surface = "<surface><contact><ode><kp>9</kp></ode></contact><mu>1</mu></surface>"
    shape = f"<collision name='c'>{surface}<plugin><mass>abc</mass><axis2/></plugin></collision>"
    base = BASE.replace("</link>", f"{sensor}{shape}</link>").replace("<pose>", "<pose odd='1'>", 1)
    robot = read(tmp_path, base, ARM, WELD, joint(), "<enable_wind>1</enable_wind>", world=world)
    tree_of(robot)
    assert left_out(robot) == {
        "collision geometry": ("base",),
        "odd of <pose>": ("base",),
        "<sensor> of <link>": ("base",),
        "<kp> of <surface>": (),
        "<enable_wind> of <model>": (),
        "static model": ("ground",),
        "<include> of another file": ("model://sun",),
        "<wind> of <world>": ("w",),
        "<ode> of <physics>": ("w",),
    }


def test_one_of_several_moving_models_is_selected_by_name(tmp_path: Path) -> None:
    read(tmp_path, BASE, ARM, WELD, joint(), world=f"{STATIC}{SECOND}")
    file = tmp_path / "robot.sdf"
    ((line, sentence),) = problems(read_robot(file))
    assert (line, sentence) == (1, "it has 2 models that move: 'second', 'm'")
    second = read_robot(file, model="second")
    assert [one.mass for one in tree_of(second).links] == [7.0]
    assert second.stated == {"model": "second"}
    assert left_out(second)["another model that moves"] == ("m",)
    assert [one.name for one in tree_of(read_robot(file, model="m")).links] == ["q"]
    ((_, sentence),) = problems(read_robot(file, model="ground"))
    assert sentence == "it has no moving model of the name 'ground'"
    numbers = robot_numbers(file, {"model": "second"})
    assert [one.value for one in numbers.numerals] == [1.9, 7.0]


NESTED = f"""<model name='n'><pose>0.2 0.3 0.1 0.3 0.1 0.2</pose>{ARM}
<frame name='tip'><pose>0.1 0 0 0 0 0.4</pose></frame></model>"""
BETWEEN = """<joint name='q' type='revolute'><parent>{}base</parent><child>{}arm</child>
<pose relative_to='{}tip'/><axis><xyz>0.2 -1 0.3</xyz></axis></joint>"""


@pytest.mark.parametrize(("inner", "world", "links"), [
    (f"{BASE}{WELD}{NESTED}{BETWEEN.format('', 'n::', 'n::')}", "", ["n__arm"]),
    (f"{BASE}{WELD}<include><uri>model://part</uri><name>n</name></include>"
     + BETWEEN.format("", "n::", "n::"), "", ["n__arm"]),
    (f"{BASE}{WELD}<include merge='true'><uri>part</uri></include>"
     + BETWEEN.format("", "", ""), "", ["arm"]),
    (f"{BASE}{WELD}", NESTED + BETWEEN.format("m::", "n::", "n::"), ["n__arm"]),
])  # fmt: skip
def test_nested_and_included_models_become_one(
    tmp_path: Path, inner: str, world: str, links: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "models" / "part").mkdir(parents=True)
    (tmp_path / "models" / "part" / "model.sdf").write_text(f"<sdf version='1.9'>{NESTED}</sdf>")
    (tmp_path / "part").symlink_to(tmp_path / "models" / "part")
    model = f"<model name='m'>{inner}</model>"
    file = tmp_path / "robot.sdf"
    file.write_text(f"<sdf version='1.9'>\n<world name='w'>{model}{world}</world></sdf>")
    (copy,) = robot_files([str(file)]).files
    ours = tree_of(read_robot(copy))
    by_hand = ARM.replace("<pose>", "<pose relative_to='n'>", 1)
    frames = (
        "<frame name='n'><pose>0.2 0.3 0.1 0.3 0.1 0.2</pose></frame><frame name='tip'"
        " attached_to='n'><pose>0.1 0 0 0 0 0.4</pose></frame>"
    )
    lines = f"{BASE}{WELD}{frames}{by_hand}{BETWEEN.format('', '', '')}"
    file.write_text(f"<sdf version='1.9'><model name='m'>{lines}</model></sdf>")
    expected = tree_of(read_robot(file))
    for q in (np.array([0.0]), np.array([0.7])):
        first, second = Recursion(ours), Recursion(expected)
        np.testing.assert_allclose(first.mass(q), second.mass(q), rtol=1e-13)
        for placed, wanted in zip(first.placements(q), second.placements(q), strict=True):
            np.testing.assert_allclose(placed.rotation, wanted.rotation, atol=1e-14)
    assert source_of(copy) == file
    (mass, *_) = [one for one in Document(copy).elements if one.tag == "mass"]
    assert in_source(str(copy), Document(copy).line(mass)) == (str(file), 2)


def test_each_moving_model_runs_in_turn(tmp_path: Path) -> None:
    (tmp_path / "part.stl").touch()
    uri = "<geometry><mesh><uri>part.stl</uri></mesh></geometry>"
    arm = ARM.replace("</link>", f"<collision name='c'>{uri}</collision></link>")
    read(tmp_path, BASE, arm, WELD, joint(), world=f"{STATIC}{SECOND}")
    file = tmp_path / "robot.sdf"
    files = robot_files([str(file)]).files
    assert [one.problem for one in unread_meshes(read_robot(files[1]).placed)] == ["empty"]
    assert [one.name for one in files] == ["robot.second.sdf", "robot.m.sdf"]
    assert [[link.mass for link in tree_of(read_robot(one)).links] for one in files] == [[7], [2]]
    assert robot_files([str(file)], "m").files == files[1:]
    assert robot_files([str(file)], "none").files == [file]


def test_models_that_are_not_there_are_refused_by_line(tmp_path: Path) -> None:
    file = tmp_path / "robot.sdf"
    include = "<include><uri>model://arm</uri></include>"
    file.write_text(f"<sdf version='1.9'>\n<world name='w'>{STATIC}\n{include}</world></sdf>")
    ((line, sentence),) = problems(read_robot(file))
    assert (line, sentence.split(",")[0]) == (3, "<include> is not covered")
    between = "<joint name='j' type='fixed'><parent>m</parent><child>second</child></joint>"
    read(tmp_path, BASE, ARM, WELD, joint(), world=f"{SECOND}{between}")
    ((line, sentence),) = problems(read_robot(file, model="m"))
    assert sentence == "a <joint> between models is not covered"
