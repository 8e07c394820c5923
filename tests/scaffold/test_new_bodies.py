"""`crosscheck new`: folders of models have each number of the file and detect its change."""

import os
import re
import subprocess
from dataclasses import fields
from pathlib import Path

import gymnasium
import numpy as np
import pybullet_data
import pytest
import sympy as sp

from physics_crosscheck import Coordinate, DeclarationError, MultibodySystem, ground, rotation
from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.prepare import prepare
from physics_crosscheck.harness.checks.task import model_task
from physics_crosscheck.harness.commands.scaffold.folder import NewError, example, write_folder
from physics_crosscheck.harness.commands.scaffold.from_model import from_model
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.modelfiles.bindings import bindings, mismatches
from physics_crosscheck.harness.modelfiles.folders import template
from physics_crosscheck.harness.modelfiles.model_files import UnreadModel, model_files
from physics_crosscheck.harness.modelfiles.readers import read_robot
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, read_sidecar
from physics_crosscheck.harness.run import Options, Selection, run
from physics_crosscheck.records import Outcome
from physics_crosscheck.reference.load import load_declaration, load_system
from physics_crosscheck.reference.mechanism.tree import Tree, TreeLink
from tests import commands
from tests.models import edited, written
from tests.robots.files import ARM

DATA = Path(pybullet_data.getDataPath())
ASSETS = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"
SHAPE = "v 0 0 0\nv .2 0 0\nv 0 .2 0\nv 0 0 .2\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"

ALL = """<mujoco model="all"><option density="1.2" wind="1 2 0"/>
<include file="beside.xml"/><compiler meshdir="shapes"/>
<default><joint damping="0.1"/></default>
<asset><mesh name="tetrahedron" file="tetrahedron.obj"/></asset>
<worldbody><site name="there" pos="0 0 2"/>
<body name="base" pos="0 0 1" gravcomp="0.5"><freejoint name="root"/>
<geom type="mesh" mesh="tetrahedron" density="500"/>
<body name="arm" pos="0.1 0 0" euler="10 20 30"><joint name="shoulder" type="ball"
 armature="0.01" pos="0.01 0.02 0" stiffness="2 1 0"/><site name="at" pos="0.1 0 0" euler="1 2 3"/>
<geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03"/>
<body pos="0.3 0 0"><joint name="elbow" axis="0 1 1" stiffness="3 2 1" springref="10" ref="20"/>
<joint name="slide" type="slide" axis="1 0 0" ref="0.1" range="-1 0.5"/>
<geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03"/>
<include file="parts/tip.xml"/></body></body></body>
<replicate count="2" offset="0 1 0"><body name="r"><joint name="rj" axis="1 0 0"/>
<geom type="box" size=".1 .2 .1" pos="0 .2 0"/></body></replicate></worldbody>
<tendon><fixed name="rope" stiffness="5" damping="0.3" springlength="0.1">
<joint joint="elbow" coef="0.5"/><joint joint="slide" coef="-1"/></fixed>
<spatial name="line" stiffness="3"><site site="at"/><site site="there"/></spatial></tendon>
<actuator><position name="servo" joint="elbow" kp="5" kv="0.2"/>
<motor tendon="rope" gear="2"/><motor site="at" refsite="there" gear="1 2 3 0 0 0"/>
<motor joint="root" gear="1 2 3 4 5 6"/>
<intvelocity joint="slide" kp="2" actrange="-1 1"/></actuator>
<equality><joint joint1="rj1" joint2="rj0" polycoef="0.1 -0.5 0 0 0"/></equality></mujoco>
"""


def write_mjcf(folder: Path) -> Path:
    """Write an MJCF with every feature, in several files and folders."""
    for name in ("shapes", "parts"):
        (folder / name).mkdir(parents=True)
    (folder / "beside.xml").write_text('<mujoco><option gravity="0 1 -9.8"/></mujoco>')
    tip = '<mujocoinclude><body name="tip" pos=".3 0 0"><geom size=".05"/></body></mujocoinclude>'
    (folder / "parts" / "tip.xml").write_text(tip)
    (folder / "shapes" / "tetrahedron.obj").write_text(SHAPE)
    file = written(folder, "all.xml", ALL)
    return file


def digits(tree: Tree) -> list[object]:
    """Return all numbers of a tree as texts that distinguish every double."""
    links = [
        [repr(np.asarray(getattr(link, field.name)).tolist()) for field in fields(TreeLink)]
        for link in tree.links
    ]
    return [links, repr(tree.pulls), repr(tree.couplings), repr(tree.gravity.tolist()),
            repr(tree.fluid), repr(tree.bushings),
            [one.size.tolist() for one in tree.immersed]]  # fmt: skip


def bodies(folder: Path) -> MultibodySystem:
    declared = load_declaration(folder)
    assert isinstance(declared, MultibodySystem)
    return declared


def without_engines(monkeypatch: pytest.MonkeyPatch) -> None:
    """Skip the engines, which other tests run."""
    monkeypatch.setattr(
        "physics_crosscheck.harness.commands.scaffold.from_tree._run", lambda *_: ({}, [])
    )


@pytest.mark.parametrize("file", [
    DATA / "kuka_iiwa" / "model.urdf", DATA / "franka_panda" / "panda.urdf",
    DATA / "a1" / "a1.urdf", ASSETS / "half_cheetah.xml", ASSETS / "humanoid.xml", None,
], ids=lambda file: "all" if file is None else file.stem)  # fmt: skip
def test_declaration_has_the_exact_tree_of_the_file(
    tmp_path: Path, file: Path | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    without_engines(monkeypatch)
    file = write_mjcf(tmp_path / "given") if file is None else file
    from_model(file, tmp_path / "made")
    declared, robot = bodies(tmp_path / "made"), read_robot(file)
    assert robot.tree is not None
    assert digits(declared.assembled.tree) == digits(robot.tree)
    for actual, expected in zip(declared.assembled.limits, robot.limits, strict=True):
        assert np.array_equal(actual, expected)
    names = [part.name for part in robot.parts]
    assert sorted(body.name for body in declared.bodies) == sorted(names)


@pytest.fixture(scope="module")
def kuka(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("folders") / "kuka"
    written = from_model(DATA / "kuka_iiwa" / "model.urdf", folder)
    uncopied, left_out = written
    assert uncopied.startswith("not copied, because no inertia depends on it: 'link_0.obj', ")
    assert left_out.startswith("left out: ")
    return folder


def test_every_number_has_a_comment_with_its_line(kuka: Path) -> None:
    source = (DATA / "kuka_iiwa" / "model.urdf").read_text().splitlines()
    count = 0
    for line in (kuka / "system.py").read_text().splitlines():
        if (match := re.search(r"(\w+)=(.*),  # .*model\.urdf:(\d+)$", line)) is None:
            continue
        key, value = match[1], match[2].strip("()").split(", ")
        numbers = re.findall(r"-?\d+\.?\d*(?:[eE]-?\d+)?", source[int(match[3]) - 1])
        words = set(map(float, numbers))
        assert {float(word) for word in value} <= words | {0.0}, (key, line)
        count += 1
    assert count == 7 * 7 + 6 + 2  # joints and links, six rotations, and the fixed link
    assert {one.name for one in kuka.iterdir()} == {"model.urdf", "model.urdf.toml", "system.py"}


def test_written_folder_agrees_and_its_numbers_are_tested(kuka: Path) -> None:
    results = run([kuka], Options(jobs=1), lambda *_: None).results
    assert {(case.scenario, case.outcome) for case in results.cases} == {("states", Outcome.AGREES)}
    assert all(model.coverage and model.coverage.motion > 100 for model in results.models)
    assert all(model.coverage and model.coverage.left_out for model in results.models)


OUTCOMES = Options(jobs=1, selection=Selection(models=None))


@pytest.mark.slow
def test_every_feature_of_an_mjcf_is_written_and_agrees(tmp_path: Path) -> None:
    """Cover includes, a mesh with inertia, replicas, free and ball joints, tendons, actuators."""
    file, folder = write_mjcf(tmp_path / "given"), tmp_path / "made"
    written = from_model(file, folder)
    assert not [one for one in written if not one.startswith("left out: ")]
    names = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}
    assert names == {
        "all.xml", "all.xml.toml", "beside.xml", "parts/tip.xml", "shapes/tetrahedron.obj",
        "system.py",
    }  # fmt: skip
    (model,) = model_files(folder)
    assert isinstance(model, Sidecar), "an included file is not a separate model"
    assert model.settings["couplings"] == ["rj1"]
    results = run([folder], Options(jobs=1), lambda *_: None).results
    assert [(case.model, case.outcome) for case in results.cases] == [("all.xml", Outcome.AGREES)]
    edited(folder / "parts" / "tip.xml", ".05", ".0500001")
    results = run([folder], OUTCOMES, lambda *_: None).results
    assert [case.outcome for case in results.cases] == [Outcome.DIFFERS]


def test_only_meshes_with_an_effect_are_copied(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = write_mjcf(tmp_path / "given")
    written(tmp_path / "given" / "shapes", "shown.obj", SHAPE)
    text = ALL.replace("<asset>", '<asset><mesh name="shown" file="shown.obj"/>')
    arm = '<geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03"/>'
    visual = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><geom type="mesh" mesh="shown"/>'
    file.write_text(text.replace(arm, arm + visual, 1))
    without_engines(monkeypatch)
    lines = from_model(file, tmp_path / "made")
    copied = [path.name for path in (tmp_path / "made" / "shapes").iterdir()]
    assert copied == ["tetrahedron.obj"]
    assert "not copied, because no inertia depends on it: 'shown.obj'" in lines


@pytest.mark.slow
def test_root_can_float(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(ARM)
    from_model(tmp_path / "arm.urdf", tmp_path / "arm", floating=True)
    assert bodies(tmp_path / "arm").bodies[0].joints[0].kind == "free"
    sidecar = read_sidecar(tmp_path / "arm" / "arm.urdf.toml")
    assert sidecar.settings["floating"] is True
    results = run([tmp_path / "arm"], OUTCOMES, lambda *_: None).results
    assert {case.outcome for case in results.cases} == {Outcome.AGREES}


def test_engines_that_refuse_the_file_are_reported(tmp_path: Path) -> None:
    written = from_model(DATA / "mini_cheetah" / "mini_cheetah.urdf", tmp_path / "dog")
    left_out = [one for one in written if "is left out: " in one]
    assert len(left_out) == 2
    assert "violate the triangle inequality" in left_out[0]
    assert "A + B >= C" in left_out[1]
    sidecar = read_sidecar(tmp_path / "dog" / "mini_cheetah.urdf.toml")
    assert set(sidecar.engines) == {"mujoco", "pybullet"}


def test_unreadable_file_leaves_no_folder(tmp_path: Path) -> None:
    robot = tmp_path / "robot.urdf"
    robot.write_text((DATA / "cartpole.urdf").read_text().replace('xyz="0 0 0"', 'xyz="0 0"', 1))
    with pytest.raises(NewError, match=r"robot\.urdf:\d+: "):
        from_model(robot, tmp_path / "robot")
    assert list(tmp_path.iterdir()) == [robot]


def test_coordinates_and_bindings_are_refused_with_bodies(kuka: Path) -> None:
    sidecar = kuka / "model.urdf.toml"
    text = sidecar.read_text()
    try:
        sidecar.write_text(f'{text}\n[coordinates]\nq = "x"\n[bindings]\n"x" = "y"\n')
        results = run([kuka], OUTCOMES, lambda *_: None).results
    finally:
        sidecar.write_text(text)
    for case in results.cases:
        assert case.outcome is Outcome.FAILED
        assert "model.urdf.toml: [coordinates], [bindings]: system.py declares" in case.reason


def test_contacts_and_limits_act_without_the_smooth_setting(tmp_path: Path) -> None:
    """Confirm that the sidecar states the setting."""
    from_model(ASSETS / "inverted_pendulum.xml", tmp_path / "made")
    sidecar = tmp_path / "made" / "inverted_pendulum.xml.toml"
    edited(sidecar, "smooth = true", "smooth = false")
    case = run_case(model_task(prepare(tmp_path / "made"), "mujoco", read_sidecar(sidecar)))
    assert case.outcome is Outcome.UNRESOLVED
    assert "the extrapolation is not trusted" in case.reason


@pytest.mark.parametrize(("old", "new", "message"), [
    ("mass=4.0,", 'mass="four",', "mass and lift of body 'lbr_iiwa_link_1' is "),
    ('parent="lbr_iiwa_link_0"', 'parent="link_0"', "'link_0', must come before it"),
    ('kind="hinge"', 'kind="screw"', "joint 'lbr_iiwa_joint_1' is of kind 'screw'; known kinds:"),
    ("axis=(0.0, 0.0, 1.0)", "axis=(0.0, 0.0, 0.0)", "the axis of joint 'lbr_iiwa_joint_1' has no"),
    ("axis=(0.0, 0.0, 1.0)", "axis=(0.0, 1.0)", "axis of joint 'lbr_iiwa_joint_1' is .* 3 finite"),
    ('name="lbr_iiwa_joint_2"', 'name="lbr_iiwa_joint_1"', "two joints have the name"),
    ("mass=4.0,", "weight=4.0,", "unexpected keyword argument 'weight'"),
])  # fmt: skip
def test_mistake_in_a_declaration_is_reported_with_its_line(
    kuka: Path, tmp_path: Path, old: str, new: str, message: str
) -> None:
    text = (kuka / "system.py").read_text()
    assert old in text
    (tmp_path / "system.py").write_text(text.replace(old, new, 1))
    with pytest.raises(DeclarationError, match=rf"system\.py:\d+: .*{message}"):
        load_declaration(tmp_path)


def test_load_system_refuses_bodies(kuka: Path) -> None:
    with pytest.raises(DeclarationError, match="it declares bodies instead of energies"):
        load_system(kuka)


def crosscheck(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    # Run as outside of CI, where `accept` is refused.
    return commands.crosscheck(*arguments, cwd=folder, CI=None, GITHUB_ACTIONS=None)


@pytest.mark.slow
def test_new_folder_passes_accept_and_gate(tmp_path: Path) -> None:
    (tmp_path / "m").mkdir()
    written(tmp_path, "arm.urdf", (DATA / "kuka_iiwa" / "model.urdf").read_text())
    done = crosscheck(tmp_path, "new", "m/arm", "--from", "arm.urdf")
    assert done.returncode == 0, done.stderr
    done = crosscheck(tmp_path, "accept", "--folder", "m", "--reason", "first")
    assert done.returncode == 0, done.stdout + done.stderr
    done = crosscheck(tmp_path, "gate")
    assert "2 cases as accepted (0 run" in done.stdout
    edited(tmp_path / "m" / "arm" / "arm.urdf", '<mass value="3"/>', '<mass value="3.001"/>')
    done = crosscheck(tmp_path, "gate", "--jobs", "1")
    assert done.returncode == 1, done.stdout + done.stderr
    assert "arm.urdf:154 value 3 -> 3.001 changed 2 of 2 cases" in done.stdout
    assert "the model's motion changed by" in done.stdout
    assert "arm.urdf:154" in done.stdout
    edited(tmp_path / "m" / "arm" / "system.py", "mass=3.0,", "mass=3.001,")
    done = crosscheck(tmp_path, "gate", "--jobs", "1")
    assert "model and equations changed alike, and agree" in done.stdout
    assert not [one for one in model_files(tmp_path / "m" / "arm") if isinstance(one, UnreadModel)]


REPOSITORY = Path(__file__).parents[1] / "installed" / "repository" / "models"
"""The function that compares the equations with engines."""


def test_every_physical_number_of_the_example_is_bound() -> None:
    system = load_system(template())
    for sidecar in model_files(template()):
        assert isinstance(sidecar, Sidecar)
        assert len(bindings(system, sidecar)) == (5 if sidecar.model.suffix == ".py" else 6)
        assert not mismatches(bindings(system, sidecar))


@pytest.mark.parametrize("name", ["a b", "2arms", "", "é", "a/.."])
def test_invalid_name_is_refused(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new", name]) == 2
    assert "not a valid system name" in capsys.readouterr().err


def test_existing_target_and_missing_parent_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm").mkdir()
    (tmp_path / "link").symlink_to("nowhere")
    for name in ("arm", "link"):
        assert main(["new", name]) == 2
        assert "exists already; nothing was written" in capsys.readouterr().err
    assert main(["new", "no/where"]) == 2
    assert "no: no such folder" in capsys.readouterr().err
    assert not list((tmp_path / "arm").iterdir())


def test_failed_check_leaves_no_folder(tmp_path: Path) -> None:
    def fail(folder: Path) -> None:
        assert (folder / "system.py").is_file()
        raise NewError("no")

    with pytest.raises(NewError):
        write_folder(tmp_path / "arm", example("arm"), fail)
    assert os.listdir(tmp_path) == []


URDF = (REPOSITORY / "cart_pole" / "robot.urdf").read_text()
MJCF = (REPOSITORY / "cart_pole" / "mujoco.xml").read_text()


@pytest.mark.parametrize(("suffix", "old", "new", "message"), [
    (".urdf", '<child link="pole"/>', '<child link="bar"/>', r"m\.urdf:\d+: the child of joint"),
    (".urdf", 'mass value="0.25"', 'mass value="a"', "value of <mass> of link 'pole' is 'a'"),
    (".urdf", "</robot>", "", r"m\.urdf:\d+: the file ends before </robot>"),
    (".xml", "<worldbody>", "<worldbody><bod/>", r"m\.xml:\d+: MuJoCo can't load it"),
    (".xml", "<worldbody>", "<include file='../a.xml'/><worldbody>", "which is not below its"),
    (".txt", "", "", "unknown kind of model file"),
])  # fmt: skip
def test_unreadable_file_is_reported_and_nothing_is_written(
    tmp_path: Path, suffix: str, old: str, new: str, message: str
) -> None:
    text = MJCF if suffix == ".xml" else URDF
    assert old in text
    model = tmp_path / "within" / f"m{suffix}"
    model.parent.mkdir()
    model.write_text(text.replace(old, new))
    (tmp_path / "a.xml").write_text('<mujoco><option timestep="0.001"/></mujoco>')
    with pytest.raises(NewError, match=message):
        from_model(model, tmp_path / "read")
    assert os.listdir(tmp_path / "within") == [model.name]
    assert not (tmp_path / "read").exists()


@pytest.mark.parametrize(("suffix", "old", "new"), [
    (".urdf", 'damping="0.004" friction="0"', 'friction="0.1"'),
    (".urdf", '<limit lower="-100" upper="100"', "<limit"),
    (".urdf", "xyz=\"1 0 0\"", 'xyz="0 0 1"'),
    (".urdf", "</link>\n\n  <joint name=\"x\"", '<visual><geometry><mesh filename="no.stl"/>'
     "</geometry></visual></link>\n\n  <joint name=\"x\""),
    (".xml", "</worldbody>", "</worldbody><actuator><motor joint='x'/></actuator>"),
    (".xml", 'type="hinge" axis="0 -1 0" damping="0.004"', 'type="ball"'),
    (".xml", 'damping="0.004"', 'frictionloss="0.1"'),
    (".xml", 'name="theta" ', ""),
    (".xml", "<worldbody>", "<include file='a.xml'/><worldbody>"),
    (".xml", "<option", "<option density='1.2'"),
])  # fmt: skip
def test_bodies_of_a_file_agree_in_its_engines(
    tmp_path: Path, suffix: str, old: str, new: str
) -> None:
    text = MJCF if suffix == ".xml" else URDF
    assert old in text
    model = tmp_path / f"m{suffix}"
    model.write_text(text.replace(old, new))
    (tmp_path / "a.xml").write_text('<mujoco><option timestep="0.001"/></mujoco>')
    remarks = from_model(model, tmp_path / "read")
    assert not [one for one in remarks if not one.startswith("left out: ")]
    assert isinstance(load_declaration(tmp_path / "read"), MultibodySystem)
    # A remark would name an engine that disagrees.
    sidecar = read_sidecar(tmp_path / "read" / f"m{suffix}.toml")
    assert len(sidecar.engines) >= (2 if suffix == ".urdf" else 1)


@pytest.mark.parametrize("file", ["crane.xml", "arm.urdf"])
def test_file_with_defaults_degrees_shapes_and_oblique_axes_agrees(
    tmp_path: Path, file: str
) -> None:
    (remark,) = from_model(Path(__file__).parent / file, tmp_path / "read")
    assert remark.startswith("left out: ")


A = Coordinate("a", "rad", "upper")
B = Coordinate("b", "rad", "lower")
X = Coordinate("x", "m", "slide")
m, l, g, J = sp.symbols("m l g J", positive=True)  # noqa: E741  # the usual names
DOWN = (0, -1, 0)


def equal(first: sp.Expr, second: sp.Expr) -> bool:
    return bool(sp.simplify(sp.expand(first - second)) == 0)


def test_hanging_rod_has_the_energies_of_the_textbook() -> None:
    centre = ground.at(0, 0, 1).hinge(A, about=DOWN).at(0, 0, -l / 2)
    assert equal(centre.kinetic(m, (J, m * l**2 / 12, J)), m * l**2 * A.v**2 / 6)
    assert equal(centre.weight(m, (0, 0, -g)), m * g * (1 - l / 2 * sp.cos(A.q)))


def test_double_pendulum_of_points_has_the_coupling_of_landau() -> None:
    elbow = ground.hinge(A, about=DOWN).at(0, 0, -l)
    point = elbow.hinge(B, about=DOWN).at(0, 0, -l)
    spin = A.v + B.v
    expected = m * l**2 / 2 * (A.v**2 + spin**2 + 2 * sp.cos(B.q) * A.v * spin)
    assert equal(point.kinetic(m, (0, 0, 0)), expected)


def test_slide_on_a_rotating_arm_has_its_velocity() -> None:
    point = ground.hinge(A, about=(0, 0, 1)).slide(X, along=(2, 0, 0), zero=l)
    assert equal(point.kinetic(m, (0, 0, 0)), m / 2 * (X.v**2 + (X.q - l) ** 2 * A.v**2))


def test_moments_are_about_the_axes_of_the_frame() -> None:
    wheel = ground.hinge(A, about=(0, 0, 1)).turned((0, 1, 0), sp.pi / 2)
    assert equal(wheel.kinetic(m, (J, 0, 0)), J * A.v**2 / 2)
    assert equal(wheel.kinetic(m, (0, 0, 0), (J, J, J)), 0)


def test_products_of_inertia_are_elements_of_the_matrix() -> None:
    body = ground.hinge(A, about=(1, 1, 0))
    spin = float(body.kinetic(0, (0, 0, 0), (1, 0, 0)).subs(A.v, 1))
    assert spin == pytest.approx(0.5, rel=1e-15)


def test_rotation_keeps_lengths_and_the_axis() -> None:
    turn = rotation((0.3, -0.4, 1.2), 0.7)
    assert max(abs(x) for x in (turn * turn.T - sp.eye(3)).evalf(30)) < 1e-22
    axis = sp.Matrix([3, -4, 12])
    assert max(abs(x) for x in (turn * axis - axis).evalf(30)) < 1e-21


def test_axis_without_length_is_refused() -> None:
    with pytest.raises(ValueError, match="has no length"):
        rotation((0, 0, 0), 1)
