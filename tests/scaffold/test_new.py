"""`crosscheck new`: the example, folders from model files, and their kinematics."""

import os
from pathlib import Path

import pytest
import sympy as sp

from physics_crosscheck import Coordinate, MultibodySystem, ground, rotation
from physics_crosscheck.harness.commands.scaffold.folder import (
    NewError,
    check_name,
    example,
    write_folder,
)
from physics_crosscheck.harness.commands.scaffold.from_model import from_model
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.modelfiles.bindings import bindings, mismatches
from physics_crosscheck.harness.modelfiles.folders import template
from physics_crosscheck.harness.modelfiles.model_files import model_files
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar, read_sidecar
from physics_crosscheck.harness.run import Options, run
from physics_crosscheck.reference.load import load_declaration, load_system

REPOSITORY = Path(__file__).parents[1] / "installed" / "repository" / "models"
"""The function that compares the equations with engines."""


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
        assert len(bindings(system, sidecar)) == (5 if sidecar.model.suffix == ".py" else 6)
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
