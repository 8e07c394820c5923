"""Advice about implausible numbers of robots' files: one planted fault of each kind."""

import re
from importlib.util import find_spec
from pathlib import Path
from typing import get_args

import pytest

from physics_crosscheck.engine import EngineError
from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.plausibility.kinds import plausibility_findings
from physics_crosscheck.harness.checks.prepare import prepare_tree
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.modelfiles.readers import read_robot
from physics_crosscheck.harness.records.finding import PlausibilityKind, UsdKind
from physics_crosscheck.records import AuditFinding, Outcome
from tests.commands import crosscheck

BOX = '<geometry><box size="0.1 0.1 0.4"/></geometry>'


def link(
    name: str,
    mass: float = 2.0,
    moments: tuple[float, float, float] = (0.0283, 0.0283, 0.0033),
    center: str = "0 0 0",
    shape: str = BOX,
) -> str:
    """Return a link that is a box of 0.1 x 0.1 x 0.4 m with uniform density."""
    xx, yy, zz = moments
    return f"""
  <link name="{name}">
    <inertial><origin xyz="{center}"/><mass value="{mass}"/>
      <inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision>{shape}</collision>
  </link>"""


def joint(child: str, limit: str = 'lower="-1" upper="1" effort="100" velocity="1"') -> str:
    y = {"left_arm": 2, "right_arm": -2}.get(child, sum(map(ord, child)))
    return f"""
  <joint name="{child}_joint" type="revolute"><parent link="base"/><child link="{child}"/>
    <origin xyz="0.3 {y} 0"/><axis xyz="0 1 0"/><limit {limit}/></joint>"""


def advice(folder: Path, *parts: str, suffix: str = ".urdf") -> list[AuditFinding]:
    file = folder / f"robot{suffix}"
    base = link("base", mass=2.5)
    whole = f'<robot name="r">{base}{"".join(parts)}\n</robot>\n'
    file.write_text(whole if suffix == ".urdf" and "<robot" not in parts[0] else parts[0])
    findings = [f for f in plausibility_findings(read_robot(file)) if f.severity == "advice"]
    for finding in findings:
        assert finding.code
        assert finding.location is not None
    return findings


def only(folder: Path, kind: str, *parts: str, suffix: str = ".urdf") -> AuditFinding:
    findings = advice(folder, *parts, suffix=suffix)
    assert [f.kind for f in findings] == [kind], [f.message for f in findings]
    return findings[0]


def text_at(finding: AuditFinding) -> str:
    assert finding.location is not None
    assert finding.location.line is not None
    return Path(finding.location.file).read_text().splitlines()[finding.location.line - 1]


STRONG, WEAK, KNEE = (
    f'lower="{lower}" upper="1" effort="{effort}" velocity="1"'
    for lower, effort in ((-1, 1000), (-1, 0.5), (0.2, 100))
)
DEGREES, FAST, UPSIDE, LONG = (
    f'lower="{lower}" upper="{upper}" effort="100" velocity="{speed}"'
    for lower, upper, speed in ((0, 120, 1), (-1, 1, 150), (1, -1, 1), (0, 90000, 1))
)
BRICK = '<geometry><box size="0.3 0.2 0.1"/></geometry>'
WATER = link("{}", 4.0, (0.0567, 0.0567, 0.00667))
HIP = """<link name="{}"><inertial><origin xyz="0.02 {} 0"/><mass value="2"/>
  <inertia ixx="0.006" iyy="0.005" izz="0.004" ixy="{}" ixz="0" iyz="0"/></inertial>
  <collision><origin xyz="0.02 {} -0.05"/><geometry><box size="0.12 0.16 0.21"/></geometry>
  </collision></link><joint name="{}_joint" type="revolute"><parent link="base"/>
  <child link="{}"/><origin xyz="0 {} 0"/><axis xyz="0 0 1"/><dynamics damping="{}"
  friction="{}"/><limit lower="{}" upper="{}" effort="50" velocity="5"/></joint>"""
SIDES = HIP.format("l_hip", -0.03, 0.0004, 0, *["l_hip"] * 2, 0.1, 0.1, 0.2, -0.3, 1.5)
SIDES += HIP.format("r_hip", 0.03, "{}", 0, *["r_hip"] * 2, "-{}", "{4}", "{5}", "{2}", "{3}")
SIDES = SIDES.replace("{}", "{0}", 1).replace("{}", "{1}")
RIGHT_SIDE = (-0.0004, 0.1, -1.5, 0.3, 0.1, 0.2)
COPIED = ("0.02 0.03 0", "0.02 -0.03 0")
CUBE = '<geometry><box size="1 1 1"/></geometry>'  # 6 m^2
EQUAL = (0.01,) * 3
ARMS = joint("left_arm") + link("right_arm") + joint("right_arm")


@pytest.mark.parametrize(("robot", "kind", "actual", "expected", "subject", "text"), [
    (link("a", 1.0, EQUAL) + joint("a") + link("b", 3.0, EQUAL) + joint("b"), "equal inertias",
     0.01, 1.0 / 12 * (0.1**2 + 0.4**2), ("a", "b"), ""),
    (link("a", 2.0, (0.5, 0.5, 0.1)) + joint("a"), "inertia too large",
     0.5, 0.0283, ("a",), "impossible"),
    (link("a", 2.0, (1e-6,) * 3) + joint("a"), "inertia too small",
     1e-6, None, ("a",), "<inertial>"),
    (link("a", center="0 0 0.3") + joint("a"), "center outside", 0.1, None, ("a",), ""),
    (link("a", 100.0, (1.4, 1.4, 0.16)) + joint("a", STRONG), "density", 100.0, 4.0, ("a",), ""),
    (link("a", 0.02, (0.02 / 6,) * 3, shape=CUBE) + joint("a"), "density", 0.02, None, ("a",), ""),
    (link("a", 2.0, (0.0033, 0.0283, 0.0283)) + joint("a"), "swapped axes",
     None, None, ("a",), "rotation"),
    (link("left_arm", 2.2) + ARMS, "left and right", 2.2, 2.0, ("left_arm", "right_arm"), ""),
    (link("a", 2.0, (0, 0, 0), center="0.04 0 0") + joint("a"), "moving without inertia",
     None, 0.0283, ("a",), ""),
    # Engines lock a joint that moves nothing.
    ('<link name="a"/>' + joint("a") + link("b") + joint("b"), "moving without inertia",
     None, None, ("a_joint",), 'name="a_joint"'),
    (link("a", center="0.04 0 0") + joint("a", WEAK), "weak drive",
     0.5, 2.0 * 9.81 * 0.04, ("a_joint",), ""),
    (link("a") + joint("a", DEGREES), "implausible limit", 120, 2.094, ("a_joint", "range"), ""),
    (link("a") + joint("a", FAST), "implausible limit", 150, 2.618, ("a_joint", "velocity"), ""),
    (link("a") + joint("a", LONG).replace("revolute", "prismatic"), "implausible limit",
     90000, 90, ("a_joint", "range"), ""),
    (link("a") + joint("a", UPSIDE), "implausible limit", 1, -1, ("a_joint", "range"), ""),
    (link("a", 2.0, (0.021667, 0.016667, 0.008333), shape=BRICK) + joint("a"), "swapped axes",
     0.00833, 0.02167, ("a",), "rotation"),
    (link("a", 2.0, (0.008333, 0.016667, 0.01), shape=BRICK) + joint("a"), "odd moment",
     0.01, 0.02167, ("a",), ""),
    (f"<robot name='r'>{WATER.format('base')}{WATER.format('a')}{joint('a')}</robot>",
     "one density", 4, 10.8, ("base", "a"), "CAD"),
    (SIDES.format(*RIGHT_SIDE).replace(*COPIED), "left and right",
     -0.03, 0.03, ("l_hip", "r_hip"), "expected 0.02 0.03 0"),
    (SIDES.format(0.0004, *RIGHT_SIDE[1:]), "left and right",
     0.0004, -0.0004, ("l_hip", "r_hip"), "products"),
    (SIDES.format(-0.0004, 0.12, *RIGHT_SIDE[2:]), "left and right",
     0.02, 0, ("l_hip_joint", "r_hip_joint"), "20 mm apart"),
    (SIDES.format(*RIGHT_SIDE[:2], -0.3, 1.5, 0.1, 0.2), "left and right",
     -0.3, -1.5, ("l_hip_joint", "r_hip_joint"), "expected [-1.5 0.3]"),
    (SIDES.format(*RIGHT_SIDE[:4], 0.3, 0.2), "left and right",
     0.3, 0.1, ("l_hip_joint", "r_hip_joint"), "damping 0.1 and 0.3"),
    (SIDES.format(*RIGHT_SIDE[:5], 0.4), "left and right",
     0.4, 0.2, ("l_hip_joint", "r_hip_joint"), "friction 0.2 and 0.4"),
])  # fmt: skip
def test_planted_fault_gets_one_advice_at_its_line(
    tmp_path: Path, robot: str, kind: str, actual: float | None, expected: float | None,
    subject: tuple[str, ...], text: str,
) -> None:  # fmt: skip
    finding = only(tmp_path, kind, robot)
    assert finding.subject == subject
    assert text in f"{finding.message} {text_at(finding)}"
    for value, right in ((finding.actual, actual), (finding.expected, expected)):
        assert right is None or value == pytest.approx(right, rel=0.01)


UNREADABLE = '</collision><visual><geometry><mesh filename="absent.stl"/></geometry></visual>'
ABSENT = '<geometry><mesh filename="package://r/absent.stl"/></geometry>'
FRAME = link("inner", 2.0).replace("<collision>", "<!--").replace("</collision>", "-->")
WELD = '<joint name="weld" type="fixed"><parent link="a"/><child link="inner"/></joint>'
RIGHT = {
    "mirrored hips": SIDES.format(*RIGHT_SIDE),
    "two uniform boxes": link("left_arm") + ARMS,
    "equal links": "".join(link(name) + joint(name) for name in "abc"),
    "balloon": link("a", 0.06, (0.01,) * 3, shape=CUBE) + joint("a"),
    "tungsten": link("a", 76.0, (1.08, 1.08, 0.127)) + joint("a", STRONG),
    "compact mass in a cover": link("a", 2.0, (7e-4,) * 3, shape=BOX.replace("0.1 0.1", "1 1"))
    + joint("a", STRONG),
    "small proxy": link("a", 2.0, (0.5, 0.5, 0.1)).replace("</collision>", UNREADABLE)
    + joint("a", STRONG),
    "knee whose range excludes zero": link("a") + joint("a", KNEE),
    "missing mesh": link("a", 0.1, (0.5,) * 3, shape=ABSENT) + joint("a"),
    # A common pattern: a frame without shapes carries its parent's inertia.
    "shapes of a welded link": f'<link name="a"><collision>{BOX}</collision></link>'
    + joint("a") + FRAME + WELD,
}  # fmt: skip


@pytest.mark.parametrize("robot", RIGHT.values(), ids=RIGHT)
def test_right_robot_gets_no_advice(tmp_path: Path, robot: str) -> None:
    assert advice(tmp_path, robot) == []


def test_joint_without_transmission_has_no_drive_if_others_have_one(tmp_path: Path) -> None:
    part = link("a", center="0.04 0 0")
    driven = '<transmission name="t"><joint name="{}"/></transmission>'
    finding = only(tmp_path, "weak drive", part, joint("a", WEAK), driven.format("a_joint"))
    assert finding.actual == 0.5
    assert advice(tmp_path, part, joint("a", WEAK), driven.format("other_joint")) == []


ARM = """<mujoco>
  <worldbody>
    <body name="arm"><joint name="elbow" axis="0 1 0" range="-60 60" damping="{damping}"/>
      <geom type="capsule" size="0.03" fromto="0 0 0 0 0 -0.3"/></body>
  </worldbody>
  <actuator>
    <position name="servo" joint="elbow" kp="50"/>
  </actuator>
</mujoco>
"""


def test_unmarked_side_is_the_other_side(tmp_path: Path) -> None:
    """Compare the drives of `knee_left` and `knee`, as in Walker2d."""
    leg = """<body name="thigh{0}"><joint name="hip{0}" axis="0 1 0"/>{1}<body name="leg{0}">
      <joint name="knee{0}" pos="0 0 0.2" axis="0 1 0"/>{1}</body></body>"""
    legs = "".join(
        leg.format(side, '<geom size="0.1" contype="0" conaffinity="0"/>') for side in ("", "_left")
    )
    drives = "".join(
        f'<motor joint="{name}{side}" gear="{gear}"/>'
        for name, side, gear in (
            ("hip", "", 9), ("hip", "_left", 9), ("knee", "", 9), ("knee", "_left", 5),
        )
    )  # fmt: skip
    robot = f"<mujoco><worldbody>{legs}</worldbody><actuator>{drives}</actuator></mujoco>"
    finding = only(tmp_path, "left and right", robot, suffix=".xml")
    assert finding.subject == ("knee_left", "knee")
    assert "gear[0] of its drive 5 and 9" in finding.message


def test_drive_without_damping_oscillates(tmp_path: Path) -> None:
    finding = only(tmp_path, "damping ratio", ARM.format(damping=0.001), suffix=".xml")
    assert finding.actual is not None
    assert finding.actual < 0.1
    assert "<position" in text_at(finding)
    rubbed = ARM.format(damping='0.001" frictionloss="6')
    assert advice(tmp_path, rubbed, suffix=".xml") == []  # it stops within three periods
    only(tmp_path, "damping ratio", rubbed.replace('"6"', '"0.1"'), suffix=".xml")


CHAIN = """<mujoco><compiler angle="{angle}"/><worldbody>
  <geom name="floor" type="plane" size="1 1 1"/>
  <body name="base" pos="0 0 {height}"><freejoint/><geom type="box" size="0.2 0.2 0.1" mass="8"/>
    <body name="a" pos="0 0 0.2"><joint name="j" axis="0 1 0" range="{range}"/>
      <inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.01 0.001"/><site name="s" pos="0 0 0.2"/>
    </body>
    <body name="b" pos="0.1 0 0.2"><joint axis="0 1 0" range="{range}"/>
      <inertial pos="0 0 0.1" mass="1" diaginertia="{tensor}"/><site name="t" pos="{tip}"/>{sole}
    </body>
  </body></worldbody><equality>{equality}</equality></mujoco>"""
FINE = {
    "angle": "radian", "height": 0.5, "range": "-1.2 1.2", "tensor": "0.01 0.01 0.001",
    "tip": "-0.1 0 0.2", "sole": "", "equality": '<connect site1="s" site2="t"/>',
}  # fmt: skip
SOLE = '<body name="sole" pos="0 0 0.1"><geom size="0.02"/></body>'
FAR = SOLE.replace('<geom size="0.02"/>',
                   '<inertial pos="0 0 -90" mass="1" diaginertia="0.01 0.01 0.01"/>')  # fmt: skip
AIR = '<body name="air" pos="0 0 0.4"><joint/><geom size="0.2" density="1e-5"/></body>'


@pytest.mark.parametrize(("changes", "kind", "actual", "expected", "text"), [
    ({"range": "-110 110"}, "implausible limit", 110, 1.92, '"-110 110"'),
    ({"angle": "degree", "range": "-1.57 1.57"}, "implausible limit", 0.0274, 1.57,
     "Write degrees"),
    ({"height": 0.05}, "overlap", 0.05, 0, "the world and base by 50 mm"),
    ({"tensor": "40 40 40"}, "inertia too large", 60, None, "gyration"),
    ({"sole": SOLE}, "default density", 0.0335, 0, 'mass="0"'),
    ({"sole": AIR}, "density", 3.35e-7, None, "balloon"),
    ({"tip": "0 0 0.2"}, "loop gap", 0.1, 0, "the joints can close it"),
    ({"tip": "0.3 0 0.2", "range": "-0.1 0.1"}, "loop gap", 0.4, None, "makes it smaller than 36"),
    ({"equality": '<weld body1="base" relpose="0 0 -1 1 0 0 0"/>'}, "loop gap", .5, 0, "can close"),
    ({"sole": FAR}, "center outside", 90, None, "Check the unit"),
    ({"equality": '<weld body1="a" body2="b" relpose="0.2 0 0 1 0 0 0"/>'}, "loop gap",
     0.1, None, "the weld of 'a' and 'b'"),
])  # fmt: skip
def test_planted_fault_of_a_compiled_file_gets_one_advice(
    tmp_path: Path, changes: dict[str, str], kind: str, actual: float, expected: float | None,
    text: str,
) -> None:  # fmt: skip
    assert advice(tmp_path, CHAIN.format(**FINE), suffix=".xml") == []
    findings = advice(tmp_path, CHAIN.format(**FINE | changes), suffix=".xml")
    (finding, *others) = (one for one in findings if one.kind == kind)
    assert len(others) <= 1, [one.message for one in findings]
    assert text in f"{finding.message} {text_at(finding)}"
    assert finding.actual == pytest.approx(actual, rel=0.01)
    assert expected is None or finding.expected == pytest.approx(expected, rel=0.01, abs=1e-9)


@pytest.mark.parametrize("density", ["", 'density="7850"'])
def test_shapes_that_are_the_bodies_get_no_advice(tmp_path: Path, density: str) -> None:
    """Accept a ball beside a robot, and bodies without names of one density."""
    ball = '<body name="ball" pos="2 0 1"><freejoint/><geom size="0.02" {}/></body>'
    with_ball = CHAIN.format(**FINE).replace("</worldbody>", ball.format("") + "</worldbody>")
    balls = "".join(ball.replace('"2', f'"{x}').format(density) for x in (2, 4)).replace(
        "ball", "", 1
    )
    for text in (with_ball, f"<mujoco><worldbody>{balls}</worldbody></mujoco>"):
        assert advice(tmp_path, text, suffix=".xml") == []


def test_drive_near_critical_damping_is_fine(tmp_path: Path) -> None:
    assert advice(tmp_path, ARM.format(damping=2.0), suffix=".xml") == []


def test_keyframe_states_an_initial_pose(tmp_path: Path) -> None:
    text = ARM.format(damping=2.0).replace('range="-60 60"', 'range="10 60"')
    only(tmp_path, "rest outside limits", text, suffix=".xml")
    key = '<keyframe><key qpos="0.5"/></keyframe></mujoco>'
    assert advice(tmp_path, text.replace("</mujoco>", key), suffix=".xml") == []


def stl(size: float) -> str:
    """Return a cube as the text of an STL file."""
    corners = [(x, y, z) for x in (0, size) for y in (0, size) for z in (0, size)]
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    facets = [three for a, b, c, d in sides for three in ((a, b, c), (a, c, d))]
    lines = ["solid cube"]
    for three in facets:
        vertices = "\n".join("vertex {} {} {}".format(*corners[i]) for i in three)
        lines.append(f"facet normal 0 0 0\nouter loop\n{vertices}\nendloop\nendfacet")
    return "\n".join([*lines, "endsolid cube"])


def test_mesh_in_millimetres_is_recognized_by_its_density(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    (tmp_path / "cube.stl").write_text(stl(50.0))
    mesh = '<geometry><mesh filename="package://r/cube.stl"/></geometry>'
    part = link("a", 0.1, (4e-5, 4e-5, 4e-5), center="0.025 0.025 0.025", shape=mesh)
    finding = only(tmp_path, "mesh unit", part, joint("a"))
    assert finding.expected == 0.001
    small = part.replace("cube.stl", 'cube.stl" scale="0.001 0.001 0.001')
    assert advice(tmp_path, small, joint("a")) == []


def collada(folder: Path, upper: str, size: tuple[float, float, float], unit: str = "1") -> str:
    """Write a box with its center 0.4 above its frame if upper is Z; return its element."""
    box = pytest.importorskip("trimesh").creation.box(size)
    pytest.importorskip("collada")
    box.apply_translation((0, 0, 0.4))
    folder.mkdir()
    file = folder / "box.dae"
    box.export(file)
    asset = f'<unit name="u" meter="{unit}"/><up_axis>{upper}_UP<'
    file.write_text(re.sub("<up_axis>.*?<", asset, file.read_text()))
    return '<geometry><mesh filename="package://r/box.dae"/></geometry>'


def test_unit_of_a_collada_mesh_is_applied(tmp_path: Path) -> None:
    kind = {}
    for unit in ("1", "0.001"):
        mesh = collada(tmp_path / unit, "Z", (50.0, 50.0, 50.0), unit)
        part = link("a", 0.1, (4e-5, 4e-5, 4e-5), shape=mesh)
        kind[unit] = [finding.kind for finding in advice(tmp_path / unit, part, joint("a"))]
    assert kind == {"1": ["mesh unit"], "0.001": []}


def test_collada_mesh_whose_upper_axis_is_y_gives_no_advice(tmp_path: Path) -> None:
    """Accept both poses: some programs rotate such a mesh, others do not."""
    kind = {}
    for upper in "YZ":
        mesh = collada(tmp_path / upper, upper, (0.1, 0.1, 0.4))
        part = link("a", center="0 -0.4 0", shape=mesh)
        kind[upper] = [finding.kind for finding in advice(tmp_path / upper, part, joint("a"))]
    assert kind == {"Y": [], "Z": ["center outside"]}


def test_shape_fitted_to_a_mesh_has_no_size(tmp_path: Path) -> None:
    """Catch a shape fitted to the placeholder mesh, which would be a metre large."""
    (tmp_path / "cube.stl").write_text(stl(0.1))
    text = ARM.format(damping=2.0)
    text = text.replace("<worldbody>", '<asset><mesh file="cube.stl"/></asset><worldbody>')
    geom = '<geom type="capsule" mesh="cube"/><inertial pos="0.05 0.05 0.05" mass="0.1"'
    text = text.replace(
        '<geom type="capsule" size="0.03" fromto="0 0 0 0 0 -0.3"/>',
        f'{geom} diaginertia="0.00017 0.00017 0.00017"/>',
    )
    kinds = [finding.kind for finding in advice(tmp_path, text, suffix=".xml")]
    assert "density" not in kinds
    assert "inertia too small" not in kinds


@pytest.mark.parametrize("key", ["effort", "velocity"])
def test_negative_limit_is_named_by_joint_and_line(tmp_path: Path, key: str) -> None:
    limit = 'lower="-1" upper="1" effort="100" velocity="1"'
    wrong = re.sub(rf'{key}="\d+"', f'{key}="-1"', limit)
    finding = only(tmp_path, "negative limit", link("a"), joint("a", wrong))
    assert finding.message.startswith(f"the {key} of joint 'a_joint' is -1: ")
    assert f'{key}="-1"' in text_at(finding)
    refusal = f"the {key} of joint 'a_joint' is -1, and Pinocchio refuses limits below zero"
    pytest.importorskip("pinocchio")
    with pytest.raises(EngineError, match=refusal):
        model_task(prepare_tree(tmp_path / "robot.urdf", states=2), "pinocchio").load()


@pytest.mark.parametrize(("last", "second"), [
    ("</link>", '<inertial><mass value="9"/></inertial>'),
    ("</inertial>", '<mass value="9"/>'),
    ("</inertial>", '<inertia ixx="9" iyy="9" izz="9"/>'),
    ("</inertial>", '<origin xyz="0 0 1"/>'),
    ("</joint>", '<origin xyz="0 0 1"/>'),
    ("</joint>", '<axis xyz="1 0 0"/>'),
    ("</joint>", '<limit lower="-2" upper="0" effort="1" velocity="1"/>'),
])  # fmt: skip
def test_first_of_two_elements_counts(tmp_path: Path, last: str, second: str) -> None:
    """Catch a file that engines load without a verdict, or with the second element's numbers."""
    robot = link("a") + joint("a")
    before, after, rest = robot.rpartition(last)
    finding = only(tmp_path, "repeated element", f"{before}\n{second}{after}{rest}")
    assert text_at(finding).startswith(second)
    assert re.match(r"a second <\w+> in (link|joint)\[a\S* has no effect", finding.message)
    task = model_task(prepare_tree(tmp_path / "robot.urdf", states=2), "pybullet")
    assert run_case(task).outcome is Outcome.AGREES


def test_no_advice_fails_a_case(tmp_path: Path) -> None:
    """Run files that get advice of every kind and agree; a mesh needs another package."""
    (tmp_path / "cube.stl").write_text(stl(50.0))
    mesh = '<geometry><mesh filename="package://r/cube.stl"/></geometry>'
    links = {
        "equal": link("equal", 1.0, (0.01,) * 3),
        "alike": link("alike", 3.0, (0.01,) * 3),
        "large": link("large", 2.0, (0.5, 0.5, 0.1)),
        "small": link("small", 2.0, (1e-6,) * 3),
        "outside": link("outside", center="0 0 0.3"),
        "dense": link("dense", 100.0, (1.4, 1.4, 0.16)),
        "swapped": link("swapped", 2.0, (0.0033, 0.0283, 0.0283)),
        "left_arm": link("left_arm", 2.2),
        "right_arm": link("right_arm"),
        "bare": link("bare", 2.0, (0, 0, 0), center="0.04 0 0"),
        "unit": link("unit", 0.1, (4e-5,) * 3, center="0.025 0.025 0.025", shape=mesh),
        "weak": link("weak", center="0.04 0 0"),
        "negative": link("negative").replace("</inertial>", '<mass value="9"/></inertial>'),
        "odd": link("odd", 2.0, (0.008333, 0.016667, 0.01), shape=BRICK),
        "degrees": link("degrees"),
    }
    limits = {"weak": 0.5, "negative": -1}
    limit = 'lower="-1" upper="1" effort="{}" velocity="1"'
    joints = [
        joint(name, DEGREES if name == "degrees" else limit.format(limits.get(name, 1000)))
        for name in links
    ]
    kinds = {one.kind for one in advice(tmp_path, *links.values(), *joints)}
    text = ARM.format(damping=0.001).replace('range="-60 60"', 'range="10 60"')
    kinds |= {one.kind for one in advice(tmp_path, text, suffix=".xml")}
    other = CHAIN.format(**FINE | {"height": 0.05, "tip": "0 0 0.2", "sole": SOLE})
    kinds |= {one.kind for one in advice(tmp_path, other, suffix=".xml")}
    absent = {"one density"} | (set() if find_spec("trimesh") else {"mesh unit"})
    assert kinds == {*get_args(PlausibilityKind)} - absent - {*get_args(UsdKind)}
    for file, engine in (("robot.urdf", "pybullet"), ("robot.xml", "mujoco")):
        done = crosscheck("run", file, "--engine", engine, "--smooth", cwd=tmp_path)
        assert (done.returncode, "(advice, " in done.stdout) == (0, True), done.stdout
