"""`crosscheck new`: the example, and folders from model files."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from physics_crosscheck.harness.checks.poses import check_poses
from physics_crosscheck.harness.checks.task import load
from physics_crosscheck.harness.commands.scaffold.folder import (
    NewError,
    check_name,
    example,
    write_folder,
)
from physics_crosscheck.harness.commands.scaffold.from_energies import format_settings as _settings
from physics_crosscheck.harness.commands.scaffold.from_model import from_model
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.modelfiles.bindings import bindings, mismatches
from physics_crosscheck.harness.modelfiles.folders import template
from physics_crosscheck.harness.modelfiles.model_files import model_files
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, read_sidecar
from physics_crosscheck.harness.run import Options, run
from physics_crosscheck.reference.dynamics.derive import derive
from physics_crosscheck.reference.load import load_declaration, load_system
from physics_crosscheck.reference.mechanism.multibody import MultibodySystem

REPOSITORY = Path(__file__).parents[1] / "installed" / "repository" / "models"
CRANE = Path(__file__).parent / "crane.xml"
ARM = Path(__file__).parent / "arm.urdf"
CHECKED = "physics_crosscheck.harness.commands.scaffold.from_energies._checked"
"""The function that compares the equations with engines."""


class WrittenFolder(NamedTuple):
    """A folder written from a model file, and the remarks."""

    folder: Path
    remarks: tuple[str, ...]


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Path], WrittenFolder]:
    """Return a function that reads each model file once."""

    @cache
    def read_once(model: Path) -> WrittenFolder:
        folder = tmp_path_factory.mktemp("read") / model.stem
        return WrittenFolder(folder, from_model(model, folder).remarks)

    return read_once


@pytest.mark.slow
def test_example_agrees_in_every_engine(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new", "my_arm"]) == 0
    assert "next: crosscheck run my_arm" in capsys.readouterr().out
    results = run([tmp_path / "my_arm"], Options(jobs=2), lambda *_: None).results
    assert {case.outcome for case in results.cases} == {"AGREES"}
    assert {case.engine for case in results.cases} == {"mujoco", "pybullet", "pymunk"}
    assert not any(model.findings for model in results.models)
    assert results.systems[0].name == "my_arm"


def test_every_physical_number_of_the_example_is_bound() -> None:
    system = load_system(template())
    for sidecar in model_files(template()):
        assert isinstance(sidecar, Sidecar)
        assert len(bindings(system, sidecar)) == 5
        assert not mismatches(bindings(system, sidecar))


@pytest.mark.parametrize("name", ["a b", "2arms", "", "é", "a/.."])
def test_invalid_name_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(NewError, match="not a valid system name"):
        check_name(tmp_path / name if name else Path())


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


@pytest.mark.slow
@pytest.mark.parametrize(
    ("system", "file"), [("cart_pole", "mujoco.xml"), ("cart_pole", "robot.urdf")]
)
def test_equations_of_a_file_match_those_written_by_hand(
    tmp_path: Path, system: str, file: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(CHECKED, lambda *_: [])  # this test needs no engine
    target = tmp_path / "read"
    assert from_model(REPOSITORY / system / file, target).remarks == ()
    read = derive(load_system(target))
    hand = derive(load_system(REPOSITORY / system))
    random = np.random.default_rng(7)
    q, v = random.uniform(-1, 1, (2, 5, 2))
    u = [np.zeros((5, len(e.system.u))) for e in (read, hand)]
    actual = read.numeric_acceleration(q, v, u[0], np.zeros((5, 1)))
    expected = hand.numeric_acceleration(q, v, u[1], np.zeros((5, 1)))
    np.testing.assert_allclose(actual, expected, rtol=1e-11)
    sidecar = read_sidecar(target / f"{file}.toml")
    bound = bindings(read.system, sidecar)
    # Every constant is bound, and its source is its line.
    assert len(bound) == len(read.system.constants)
    places = {c.source for c in read.system.constants}
    assert {
        f"{b.place.file.name}:{b.place.line}" for b in bound if "sidecar:" not in b.address
    } <= (places)
    assert not mismatches(bound)


@pytest.mark.slow
def test_defaults_degrees_shapes_springs_and_oblique_axes_are_read(
    read: Callable[[Path], WrittenFolder],
) -> None:
    folder, remarks = read(CRANE)
    assert any("computes its mass and inertia from geoms" in remark for remark in remarks)
    system = load_system(folder)
    constants = {c.name: c for c in system.constants}
    assert constants["sway_damping"].value == 0.12
    assert constants["sway_springref"].value == pytest.approx(np.radians(15), rel=1e-15)
    assert constants["hook_mass"].value == pytest.approx(700 * 8 * 0.1 * 0.05 * 0.08, rel=1e-12)
    bound = read_sidecar(folder / "crane.xml.toml").bindings
    assert bound["joint[sway]@springref"] == "sway_springref * 180 / pi"
    # One number for both hinges of the class.
    assert bound["default[hinge]/joint@damping"] == "sway_damping"
    assert not mismatches(bindings(system, read_sidecar(folder / "crane.xml.toml")))


SHARED = """<mujoco>
  <default><joint damping="1" armature="0.5"/></default>
  <worldbody>
    <body name="cart">
      <joint name="slider" type="slide" axis="1 0 0"/>
      <inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
      <body name="pole">
        <joint name="swing" axis="0 1 0"/>
        <joint name="tilt" axis="1 0 0"/>
        <inertial pos="0 0 -0.5" mass="1" diaginertia="0.1 0.1 0.1"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.mark.slow
def test_number_of_two_quantities_is_a_constant_for_each_unit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(CHECKED, lambda *_: [])
    (tmp_path / "m.xml").write_text(SHARED)
    assert from_model(tmp_path / "m.xml", tmp_path / "read").remarks == ()
    system = load_system(tmp_path / "read")
    stated = {c.name: (c.value, c.unit, c.source) for c in system.constants}
    assert stated["slider_damping"] == (1.0, "N*s/m", "m.xml:2")
    assert stated["swing_damping"] == (1.0, "N*m*s/rad", "m.xml:2")
    assert stated["slider_armature"][:2] == (0.5, "kg")
    assert stated["swing_armature"][:2] == (0.5, "kg*m^2")
    assert "tilt_damping" not in stated  # in the unit of the other hinge
    sidecar = read_sidecar(tmp_path / "read" / "m.xml.toml")
    assert sidecar.bindings["default/joint@damping"] == "slider_damping"
    assert "same number is swing_damping too" in (tmp_path / "read" / "m.xml.toml").read_text()
    assert not mismatches(bindings(system, sidecar))


@pytest.mark.slow
def test_rotated_frames_products_fixed_joints_and_limits_are_read(
    read: Callable[[Path], WrittenFolder],
) -> None:
    """Rely on both engines: without their agreement, nothing is written."""
    folder, remarks = read(ARM)
    assert remarks == (
        "the rotation of boom_centre is kept as numbers: a wrong one makes the case"
        " differ, but has no named cause",
    )
    system = load_system(folder)
    sidecar = read_sidecar(folder / "arm.urdf.toml")
    assert sidecar.engines == ("pybullet", "mujoco")
    assert sidecar.bindings["joint[lift]/origin@rpy[2]"] == "pi / 2"
    assert not mismatches(bindings(system, sidecar))
    pan = next(c for c in system.coordinates if c.name == "pan")
    assert pan.description.endswith("arm.urdf:30, from -2.5 to 2.5")


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


@pytest.mark.parametrize(("suffix", "old", "new", "message"), [
    (".urdf", 'damping="0.004" friction="0"', 'friction="0.1"', "has friction, which is not"),
    (".urdf", '<axis xyz="0 -1 0"/>', '<axis xyz="0 -1 0"/><mimic joint="x"/>', "mimics another"),
    (".urdf", '<limit lower="-100" upper="100"', "<limit", "has no lower and upper limits"),
    (".urdf", "xyz=\"1 0 0\"", 'xyz="0 0 1"', "no rest position found, within the limits"),
    (".urdf", "</link>\n\n  <joint name=\"x\"", '<visual><geometry><mesh filename="no.stl"/>'
     "</geometry></visual></link>\n\n  <joint name=\"x\"", "it needs no.stl, looked for"),
    (".xml", "</worldbody>", "</worldbody><actuator><motor joint='x'/></actuator>", "an actuator"),
    (".xml", 'type="hinge" axis="0 -1 0" damping="0.004"', 'type="ball"', "is a ball joint"),
    (".xml", 'damping="0.004"', 'frictionloss="0.1"', "has frictionloss"),
    (".xml", 'name="theta" ', "", r"m\.xml:\d+: this joint has no name"),
    (".xml", "<worldbody>", "<include file='a.xml'/><worldbody>", "<include>: parts in other"),
    (".xml", "<option", "<option density='1.2'", "a medium"),
])  # fmt: skip
def test_bodies_are_declared_if_energies_are_not_supported(
    tmp_path: Path, suffix: str, old: str, new: str, message: str
) -> None:
    text = MJCF if suffix == ".xml" else URDF
    assert old in text
    model = tmp_path / f"m{suffix}"
    model.write_text(text.replace(old, new))
    (tmp_path / "a.xml").write_text('<mujoco><option timestep="0.001"/></mujoco>')
    written = from_model(model, tmp_path / "read")
    assert written.declares.startswith("bodies instead of energies: ")
    assert re.search(message, written.declares)
    assert not [one for one in written.remarks if not one.startswith("left out: ")]
    assert isinstance(load_declaration(tmp_path / "read"), MultibodySystem)
    # A remark would name an engine that disagrees.
    sidecar = read_sidecar(tmp_path / "read" / f"m{suffix}.toml")
    assert len(sidecar.engines) >= (2 if suffix == ".urdf" else 1)


@pytest.mark.slow
def test_equations_that_no_engine_confirms_are_not_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = tmp_path / "m.urdf"
    model.write_text(URDF)
    # Plant a fault: gravity other than in the equations.
    settings = [line.replace("9.81", "9.8") for line in _settings(".urdf")]
    monkeypatch.setattr(
        "physics_crosscheck.harness.commands.scaffold.from_energies.format_settings",
        lambda _: settings,
    )
    with pytest.raises(NewError, match="no engine agrees with the equations read"):
        from_model(model, tmp_path / "read")
    assert os.listdir(tmp_path) == ["m.urdf"]


PENDULUM = """<robot name="pendulum">
  <link name="world"/>
  <joint name="swing" type="continuous">
    <parent link="world"/><child link="bob"/><axis xyz="0 1 0"/>
    <dynamics damping="0.05" friction="0"/>
  </joint>
  <link name="bob">
    <inertial>
      <origin xyz="0 0 -0.4"/><mass value="0.8"/>
      <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"/>
    </inertial>
  </link>
</robot>
"""
SWING = """<mujoco>
  <worldbody>
    <body name="bob">
      <joint name="swing" axis="0 1 0" damping="0.05"/>
      <inertial pos="0 0 -0.4" mass="0.8" diaginertia="0.02 0.02 0.01"/>
    </body>
  </worldbody>
</mujoco>
"""


def test_meshes_below_the_file_are_copied_and_others_are_reported(
    tmp_path: Path,
) -> None:
    (tmp_path / "meshes").mkdir()
    shape = tmp_path / "meshes" / "pole.obj"
    shape.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n")
    visual = '<visual><geometry><mesh filename="{}"/></geometry></visual>'
    for name, good in (("meshes/pole.obj", True), ("package://robot/pole.obj", False)):
        model = tmp_path / "m.urdf"
        model.write_text(PENDULUM.replace("</inertial>", f"</inertial>{visual.format(name)}"))
        target = tmp_path / "read"
        written = from_model(model, target)
        if good:
            assert (target / name).read_bytes() == shape.read_bytes()
        else:
            assert "not below its folder" in written.declares
            assert not (target / "meshes").exists()
        shutil.rmtree(target)


SHAPE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.mark.parametrize(("name", "compiler", "place", "engines"), [
    # PyBullet looks in the folder of the file, MuJoCo in the folder of its compiler element.
    ("meshes/x.obj", 'meshdir="meshes"', "meshes/x.obj", {"pybullet"}),
    ("meshes/x.obj", 'meshdir="meshes" strippath="true"', "meshes/x.obj", {"pybullet", "mujoco"}),
    ("x.obj", 'assetdir="meshes"', "meshes/x.obj", {"mujoco"}),
    ("package://meshes/x.obj", 'balanceinertia="false"', "meshes/x.obj", {"pybullet"}),
    ("package://robot/x.obj", 'meshdir="a" strippath="true"', "a/x.obj", {"mujoco"}),
])  # fmt: skip
def test_meshes_of_a_urdf_are_copied_for_each_engine(
    tmp_path: Path, name: str, compiler: str, place: str, engines: set[str]
) -> None:
    (tmp_path / place).parent.mkdir()
    (tmp_path / place).write_text(SHAPE)
    collision = f'<collision><geometry><mesh filename="{name}"/></geometry></collision>'
    text = PENDULUM.replace("</inertial>", f"</inertial>{collision}")
    library = '<gazebo><plugin name="p" filename="libcontrol.so"/></gazebo>'
    extra = f"<mujoco><compiler {compiler}/></mujoco>{library}"
    (tmp_path / "m.urdf").write_text(text.replace("</robot>", f"{extra}</robot>"))
    from_model(tmp_path / "m.urdf", tmp_path / "read")
    assert (tmp_path / "read" / place).read_text() == SHAPE
    assert set(read_sidecar(tmp_path / "read" / "m.urdf.toml").engines) == engines


@pytest.mark.parametrize(("file", "compiler", "place"), [
    ("meshes/x.obj", "", "meshes/x.obj"),
    ("x.obj", 'assetdir="a" meshdir="meshes"', "meshes/x.obj"),
    ("x.obj", 'assetdir="a"', "a/x.obj"),
    ("x.obj", 'texturedir="b" assetdir="a"', "a/x.obj"),
])  # fmt: skip
def test_meshes_of_an_mjcf_are_copied_from_its_compiler_folder(
    tmp_path: Path, file: str, compiler: str, place: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The test above runs the engines.
    monkeypatch.setattr(CHECKED, lambda *_: [])
    (tmp_path / place).parent.mkdir()
    (tmp_path / place).write_text(SHAPE)
    asset = f'<compiler {compiler}/><asset><mesh name="x" file="{file}"/></asset>'
    (tmp_path / "m.xml").write_text(SWING.replace("<worldbody>", f"{asset}<worldbody>"))
    from_model(tmp_path / "m.xml", tmp_path / "read")
    assert (tmp_path / "read" / place).read_text() == SHAPE


def test_missing_mesh_is_reported_with_the_searched_path(tmp_path: Path) -> None:
    asset = '<compiler meshdir="a"/><asset><mesh name="x" file="x.obj"/></asset>'
    (tmp_path / "m.xml").write_text(SHARED.replace("<worldbody>", f"{asset}<worldbody>"))
    written = from_model(tmp_path / "m.xml", tmp_path / "read")
    sentence = "m.xml:3: it needs x.obj, looked for as a/x.obj: No such"
    assert sentence in written.declares
    needed = asset + '<worldbody><geom type="mesh" mesh="x"/>'
    text = SHARED.replace("<worldbody>", needed, 1).replace(
        '<inertial pos="0 0 -0.5" mass="1" diaginertia="0.1 0.1 0.1"/>',
        '<geom type="mesh" mesh="x"/>',
    )
    (tmp_path / "m.xml").write_text(text)
    with pytest.raises(NewError, match=r"m.xml.*x\.obj"):
        from_model(tmp_path / "m.xml", tmp_path / "again")
    assert not (tmp_path / "again").exists()


@pytest.mark.slow
@pytest.mark.parametrize(("model", "names"), [
    (CRANE, {"body"}), (ARM, {"link"}),
])  # fmt: skip
def test_every_named_body_is_a_frame_that_agrees(
    read: Callable[[Path], WrittenFolder], model: Path, names: set[str]
) -> None:
    folder = read(model).folder
    system = load_system(folder)
    sidecar = read_sidecar(folder / f"{model.name}.toml")
    assert {str(place).partition(":")[0] for place in sidecar.frames.values()} == names
    assert list(sidecar.frames) == [frame.name for frame in system.frames]
    engine = sidecar.engines[0]
    loaded, coordinates = load(system, sidecar, engine)
    positions = np.random.default_rng(3).uniform(-1, 1, (5, len(system.q)))
    poses = check_poses(system, sidecar, loaded, coordinates, positions)
    assert poses.findings == ()
    assert all(one.agrees for one in poses.record.frames)
    assert len(poses.record.frames) == len(system.frames) > 1
