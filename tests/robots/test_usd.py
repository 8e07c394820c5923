"""USD robots: units, joints, masses by shapes, the places of numbers, and edits."""

import math
from pathlib import Path

import numpy as np
import pytest

from physics_crosscheck.harness.documents.usd import layer_lines
from physics_crosscheck.harness.modelfiles.inertias import impossible_inertias
from physics_crosscheck.harness.modelfiles.parts import named_files
from physics_crosscheck.harness.modelfiles.readers import read_robot, robot_system
from physics_crosscheck.harness.modelfiles.robot import Robot
from physics_crosscheck.harness.modelfiles.robot_targets import robots_below
from physics_crosscheck.harness.modelfiles.usd import numbers, read
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.tree import Tree
from tests.robots.files import left_out, tree_of
from tests.robots.usd import ARM, crate, edited, read_usd

pytest.importorskip("pxr")

Q = np.array([[0.3, -0.7, 0.4]])


def mechanics(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Return mass matrix and forces at one state."""
    q = Q[:, : tree_of(robot).dof]
    mass, force = TreeEquations(robot_system(robot)).mechanics(q, 2 * q - 1, np.zeros_like(q))
    return mass[0], force[0]


MJCF = """<mujoco><option gravity="0 0 -9.81"/><compiler angle="radian"/><worldbody>
<body name="upper" pos="0 0 0.125"><inertial pos="0 0.25 0.125" mass="1.5"
quat="0.98 0.1 0 0.17" diaginertia="0.012 0.011 0.002"/>
<joint name="shoulder" axis="0 1 0" stiffness="28.64788975654116" damping="14.32394487827058"
springref="0.3490658503988659"/>
<body name="lower" pos="0 0 0.25" quat="0.9238795 0 0.3826834 0"><inertial pos="0.0625 0 0.125"
mass="0.75" diaginertia="0.0035 0.003 0.001"/>
<joint name="elbow" axis="1 0 0" damping="7.16197243913529" armature="0.0625"/></body>
</body></worldbody></mujoco>"""


def test_it_equals_the_same_arm_as_an_mjcf(tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(MJCF)
    robot = read_usd(tmp_path)
    expected = mechanics(read_robot(tmp_path / "arm.xml"))
    for mine, its in zip(mechanics(robot), expected, strict=True):
        assert mine == pytest.approx(its, rel=1e-6, abs=1e-7)
    assert left_out(robot) == {"limits of position": ("shoulder",)}
    assert robot.limits[0][0] == pytest.approx(-math.pi / 2)


CENTIMETERS = (
    ("metersPerUnit = 1", "metersPerUnit = 0.01"),
    ("kilogramsPerUnit = 1", "kilogramsPerUnit = 0.5"),
    ("Magnitude = 9.81", "Magnitude = 981"),
    ("mass = 1.5", "mass = 3"),
    ("mass = 0.75", "mass = 1.5"),
    ("(0, 0.25, 0.125)", "(0, 25, 12.5)"),
    ("(0.0625, 0, 0.125)", "(6.25, 0, 12.5)"),
    ("(0.012, 0.011, 0.002)", "(240, 220, 40)"),
    ("(0.0035, 0.003, 0.001)", "(70, 60, 20)"),
    ("Pos0 = (0, 0, 0.125)", "Pos0 = (0, 0, 12.5)"),
    ("Pos0 = (0, 0, 0.25)", "Pos0 = (0, 0, 25)"),
    ("stiffness = 0.5", "stiffness = 10000"),
    ("physics:damping = 0.25", "physics:damping = 5000"),
    ("newton:damping = 0.125", "newton:damping = 2500"),
    ("armature = 0.0625", "armature = 1250"),
)
LOCKED = ("transX", "transY", "transZ", "rotY", "rotZ")
SCHEMAS = '["PhysicsRigidBodyAPI", "PhysicsMassAPI"'
BEFORE = "{}]) {{\n        {}double3 xformOp:translate = (0, 0, 0.375)".format
EQUAL: dict[str, tuple[tuple[str, str], ...]] = {
    "units": CENTIMETERS,
    "unset magnitude": (("Magnitude = 9.81", "Magnitude = -inf"),),
    "longer quaternion": (("(0.98, 0.1, 0, 0.17)", "(1.96, 0.2, 0, 0.34)"),),
    "kinematic base": (
        ("physics:mass = 2\n", "physics:mass = 2\n bool physics:kinematicEnabled = 1\n"),
        ('PhysicsFixedJoint "mount"', 'Scope "mount"'),
    ),
    "doubles win": (
        (BEFORE(SCHEMAS, ""), BEFORE(f'{SCHEMAS}, "NewtonMassAPI"',
         "double[] newton:inertia = [0.0035, 0.003, 0.001, 0, 0, 0]\n        ")),
        ("= (0.0035, 0.003, 0.001)", "= (1, 2, 2)"),
    ),
    "scaled body": (
        ("double3 xformOp:translate = (0, 0, 0.375)", "float3 xformOp:scale = (2, 2, 2)"),
        ('xformOpOrder = ["xformOp:translate"]\n        float physics:mass = 0.75',
         'xformOpOrder = ["xformOp:scale"]\n        float physics:mass = 0.75'),
        ("(0.0625, 0, 0.125)", "(0.03125, 0, 0.0625)"),
    ),
    "generic joint": (
        ('PhysicsRevoluteJoint "elbow" (prepend apiSchemas = ["NewtonJointAPI"])',
         'PhysicsJoint "elbow" (prepend apiSchemas = ["NewtonJointAPI", '
         + ", ".join(f'"PhysicsLimitAPI:{one}"' for one in LOCKED)
         + "])"),
        ('uniform token physics:axis = "X"', "".join(
            f"float limit:{one}:physics:low = 1\n float limit:{one}:physics:high = -1\n "
            for one in LOCKED)),
    ),
    "exchanged ends": (
        ("physics:body0 = </arm/base>\n        rel physics:body1 = </arm/upper>",
         "physics:body0 = </arm/upper>\n        rel physics:body1 = </arm/base>\n"
         " quatf physics:localRot0 = (0, 0, 0, 1)\n quatf physics:localRot1 = (0, 0, 0, 1)"),
        ("Pos0 = (0, 0, 0.125)", "Pos1 = (0, 0, 0.125)"),
    ),
    "joint to a frame of the body": (
        ("body0 = </arm/upper>", "body0 = </arm/upper/site>"),
        ("Pos0 = (0, 0, 0.25)", "Pos0 = (0, 0, 0.125)"),
        ("quatf physics:principalAxes = (0.98, 0.1, 0, 0.17)",
         'quatf physics:principalAxes = (0.98, 0.1, 0, 0.17)\n        def Xform "site"\n        {\n'
         "            double3 xformOp:translate = (0, 0, 0.125)\n"
         '            uniform token[] xformOpOrder = ["xformOp:translate"]\n        }'),
    ),
}  # fmt: skip


@pytest.mark.parametrize("edits", EQUAL.values(), ids=EQUAL)
def test_another_spelling_is_the_same_mechanism(
    edits: tuple[tuple[str, str], ...], tmp_path: Path
) -> None:
    plain, other = read_usd(tmp_path), read_usd(tmp_path, edited(*edits), "other.usda")
    for mine, its in zip(mechanics(other), mechanics(plain), strict=True):
        assert mine == pytest.approx(its, rel=1e-6, abs=1e-7)


ROUND = "double radius = 0.1\n double height = 3\n"
BALL = "double radius = 0.5\n"
CORNERS = """point3f[] points = [(0,0,0), (1,0,0), (0,1,0), (0,0,1)]
int[] faceVertexCounts = [3,3,3,3]
int[] faceVertexIndices = [0,2,1, 0,1,3, 0,3,2, 1,2,3]"""
AREA = 1000 * math.pi * 0.01
SHAPES = {
    "box": ("Cube", "double size = 0.5", 125.0, (1, 1, 1)),
    "along x": ("Cylinder", ROUND + ' uniform token axis = "X"', 3 * AREA, (0.06, 9.03, 9.03)),
    "capsule": ("Capsule", ROUND, AREA * (3 + 0.4 / 3), None),
    "cone": ("Cone", ROUND, AREA, None),
    "own density": ("Sphere", BALL + "float physics:density = 6", math.pi, (1, 1, 1)),
    "own mass": ("Sphere", BALL + "float physics:mass = 7", 7.0, (1, 1, 1)),
    "mesh": ("Mesh", CORNERS, 1000 / 6, (1, 1, 1)),
}


@pytest.mark.parametrize(("kind", "lines", "mass", "moments"), SHAPES.values(), ids=SHAPES)
def test_unset_masses_follow_from_shapes(
    kind: str, lines: str, mass: float, moments: tuple[float, ...] | None, tmp_path: Path
) -> None:
    schemas = 'apiSchemas = ["PhysicsCollisionAPI", "PhysicsMassAPI"]'
    shape = f'def {kind} "s" (prepend {schemas})\n{{\n {lines}\n}}\n'
    text = edited(
        ("float physics:mass = 0.75\n", shape),
        ("point3f physics:centerOfMass = (0.0625, 0, 0.125)\n", ""),
        ("float3 physics:diagonalInertia = (0.0035, 0.003, 0.001)\n", ""),
    )
    link = next(one.link for one in read_usd(tmp_path, text).parts if one.name == "lower")
    assert link.mass == pytest.approx(mass, rel=1e-6)
    if moments:
        ratio = np.array(link.inertia[:3]) / link.inertia[0] * moments[0]
        assert ratio == pytest.approx(np.array(moments) * (1, 1, 1), rel=0.01)


def test_a_negative_mass_is_named_as_one(tmp_path: Path) -> None:
    read_usd(tmp_path, edited(("mass = 0.75", "mass = -0.75")))
    robot = read_usd(tmp_path, "#usda 1.0\n(\n    subLayers = [@arm.usda@]\n)", "over.usda")
    first = impossible_inertias(robot)[0]
    assert (first.kind, first.file, first.line) == ("negative mass", tmp_path / "arm.usda", 27)


def test_each_number_has_its_layer_prim_and_line(tmp_path: Path) -> None:
    binary, texts = crate(tmp_path), ARM.splitlines()
    text_numbers = numbers(tmp_path / "arm.usda", {}).numerals
    assert len(text_numbers) > 40
    for entry in text_numbers:
        assert entry.line
        assert entry.key in texts[entry.line - 1]
        assert f".{entry.key}" in entry.address
    without_lines = numbers(binary, {}).numerals
    assert {one.line for one in without_lines} == {None}
    assert [one.address for one in without_lines] == [one.address for one in text_numbers]


def test_lines_are_those_of_variants_and_not_of_comments(tmp_path: Path) -> None:
    text = (
        '#usda 1.0\ndef Xform "a" (\n    doc = """def "no" {\n""" customData = {}\n)\n{\n'
        "    # float x = 1 {\n"
        '    string s = "}"\n    variantSet "v" = {\n        "one" {\n            float x = 2\n'
        '            def "in"\n            {\n                float y.timeSamples = {\n'
        "                    0: 1,\n                }\n            }\n        }\n    }\n"
        "    float z = 3\n}\n"
    )
    (tmp_path / "a.usda").write_text(text)
    lines = layer_lines(tmp_path / "a.usda")
    assert lines["/a"] == 2
    assert lines["/a{v=one}.x"] == 11
    assert lines["/a{v=one}in"] == 12
    assert lines["/a.z"] == 20
    assert "/no" not in lines


def assert_equal(mine: Tree | None, its: Tree | None) -> None:
    assert mine is not None
    assert its is not None
    for here, there in zip(mine.links, its.links, strict=True):
        assert here.inertia == pytest.approx(there.inertia, rel=1e-5, abs=1e-9)
        assert here.position == pytest.approx(there.position, abs=1e-6)
        assert (here.mass, here.damping) == pytest.approx((there.mass, there.damping), rel=1e-6)


def test_edits_are_layers_over_the_file(tmp_path: Path) -> None:
    """Compare the effect of numbers in the tree with that of a layer over a crate."""
    binary = crate(tmp_path)
    file, before = numbers(binary, {}), binary.read_bytes()
    chosen = [i for i in file.relevant_numbers if "gravity" not in file.numerals[i].address]
    for i in chosen[::3]:
        value = file.numerals[i].value + 0.0625
        (path, text), *_ = file.texts({i: value}).items()
        copy = tmp_path / "trial" / path.name
        copy.parent.mkdir(exist_ok=True)
        copy.write_bytes(text)
        assert_equal(file.tree({i: value}), read(copy, {"allow_outside": True}).tree)
    assert binary.read_bytes() == before


PART = 'def "{}" (instanceable = true\n references = @parts/arm.usda@</arm>) {{ }}\n'.format
INSTANCES = f"""#usda 1.0
(
    defaultPrim = "pair"
    upAxis = "Y"
)
def Xform "pair" {{
{PART("left")}{PART("right")}}}
"""


def test_instances_and_references(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "arm.usda").write_text(ARM)
    robot = read_usd(tmp_path, INSTANCES, "pair.usda")
    names = [one.name for one in tree_of(robot).links]
    assert sorted(names) == ["left/elbow", "left/shoulder", "right/elbow", "right/shoulder"]
    assert str(robot.stated["gravity"]) == "[0.0, -9.81, 0.0]"
    file = numbers(tmp_path / "pair.usda", {})
    addresses = [one.address for one in file.numerals]
    mass = addresses.index("/pair/right/lower.physics:mass")
    assert str(file.numerals[mass]) == f"{tmp_path / 'parts' / 'arm.usda'}:30"
    copy = tmp_path / "copy.usda"
    copy.write_bytes(file.texts({mass: 3.0})[tmp_path / "pair.usda"])
    masses = {one.name: one.link.mass for one in read(copy, {}).parts}
    assert (masses["left/lower"], masses["right/lower"]) == (0.75, 3.0)
    assert named_files(tmp_path / "pair.usda") == (tmp_path / "parts" / "arm.usda",)
    moved = addresses.index("/pair/left/lower.xformOp:translate[0]")
    copy.write_bytes(file.texts({moved: 0.5})[tmp_path / "pair.usda"])
    assert_equal(file.tree({moved: 0.5}), read(copy, {}).tree)
    copy.unlink()
    assert robots_below(tmp_path) == [tmp_path / "pair.usda"]


SIZED = """#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
    subLayers = [@arm.usda@]
)
over "arm" (
    variants = { string size = "small" }
    prepend variantSets = "size"
) {
    variantSet "size" = {
        "small" { }
        "large" {
            over "shoulder" { float newton:armature = 1; }
        }
    }
}
"""


def test_variants_are_selected_and_named(tmp_path: Path) -> None:
    (tmp_path / "arm.usda").write_text(ARM)
    robot = read_usd(tmp_path, SIZED, "sized.usda")
    assert (robot.selection, tree_of(robot).dof) == ("size=small", 2)
    large = read(tmp_path / "sized.usda", {"variants": {"size": "large"}})
    assert [one.links[0].armature for one in (tree_of(robot), tree_of(large))] == [0.0, 1.0]
    assert (large.selection, large.stated["variants"]) == ("size=large", {"size": "large"})
    file = numbers(tmp_path / "sized.usda", {"variants": {"size": "large"}})
    moved = next(i for i, one in enumerate(file.numerals) if "xformOp" in one.key)
    changed = file.tree({moved: 1.0})
    assert changed is not None
    assert changed.links[0].armature == 1.0
    wrong = read(tmp_path / "sized.usda", {"variants": {"size": "huge"}})
    assert "it has large, small" in str(wrong.obstacles[0])


def test_each_number_has_a_size_so_that_coverage_can_change_it(tmp_path: Path) -> None:
    read_usd(tmp_path, edited(("(0, 0, 0.05)", "(0, 0, 0)"), ("Position = 20", "Position = 0")))
    rows = numbers(tmp_path / "arm.usda", {}).numerals
    assert {one.value for one in rows} >= {0.0}
    assert min(one.scale for one in rows) > 0


def test_hinges_between_the_same_bodies_are_stacked_if_the_root_says_so(tmp_path: Path) -> None:
    elbow = ARM[ARM.index('    def PhysicsRevoluteJoint "elbow"') :]
    swing = elbow.replace('"elbow"', '"swing"').replace('"X"', '"Y"')
    both = ARM.rstrip().removesuffix("}") + swing
    assert "usda:57: /arm/swing: joint 'swing' joins" in str(read_usd(tmp_path, both).obstacles[0])
    flagged = both.replace("{\n    def", "{\n uniform bool newton:jointsAddMobility = 1\n def", 1)
    robot, joint = read_usd(tmp_path, flagged), MJCF.splitlines()[-2].removesuffix("</body>")
    second = joint.replace("elbow", "swing").replace("1 0 0", "0 1 0")
    (tmp_path / "arm.xml").write_text(MJCF.replace(joint, joint + second))
    expected = mechanics(read_robot(tmp_path / "arm.xml"))
    for mine, its in zip(mechanics(robot), expected, strict=True):
        assert mine == pytest.approx(its, rel=1e-6, abs=1e-6)
