"""Xacro sources and robots by name: their files, and the lines of the sources."""

from pathlib import Path
from shutil import copytree

import pytest

from physics_crosscheck.harness.audits import audits
from physics_crosscheck.harness.documents.expanded import expand
from physics_crosscheck.harness.modelfiles.folders import FolderError
from physics_crosscheck.harness.modelfiles.mesh_files import locate_mesh
from physics_crosscheck.harness.modelfiles.readers import read_robot
from physics_crosscheck.harness.modelfiles.robot_sources import source_file
from tests.compare.asking import compared, result

MACROS = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:macro name="rod" params="name parent inertia:=0.0267">
    <link name="${name}">
      <inertial>
        <origin xyz="0 0 -0.2"/>
        <mass value="2"/>
        <inertia ixx="${inertia}" iyy="${inertia}" izz="0.001" ixy="0" ixz="0" iyz="0"/>
      </inertial>
    </link>
    <joint name="${name}_joint" type="revolute">
      <parent link="${parent}"/><child link="${name}"/><axis xyz="0 1 0"/>
      <limit lower="${lower}" upper="1" effort="90" velocity="1"/>
    </joint>
  </xacro:macro>
</robot>
"""

ARM = """<?xml version="1.0"?>
<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:property name="lower" value="0.5"/>
  <xacro:include filename="$(find arm)/urdf/macros.xacro"/>
  <link name="base"/>
  <xacro:rod name="upper" parent="base"/>
  <xacro:rod name="fore" parent="upper"/>
</robot>
"""


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    folder = tmp_path / "arm"
    (folder / "urdf").mkdir(parents=True)
    (folder / "package.xml").write_text("<package><name>arm</name></package>")
    (folder / "urdf" / "macros.xacro").write_text(MACROS)
    (folder / "urdf" / "arm.urdf.xacro").write_text(ARM)
    return folder


def test_finding_in_a_macro_names_its_line_in_the_source(package: Path) -> None:
    pytest.importorskip("xacrodoc")
    file = source_file(str(package / "urdf" / "arm.urdf.xacro"))
    assert file is not None
    assert file.name == "arm.urdf"
    assert [part.name for part in read_robot(file).parts] == ["base", "upper", "fore"]
    (audit,) = audits([file], engines=("mujoco",))
    (limit,) = [one for one in audit.findings if one.kind == "rest outside limits"]
    assert limit.location is not None
    assert limit.location.file == str(package / "urdf" / "macros.xacro")
    line = MACROS.splitlines()[(limit.location.line or 0) - 1]
    assert line.strip().startswith("<limit")


def test_two_versions_of_a_package_are_compared(package: Path) -> None:
    """Catch sources both expanded with the macros of the first, and lines of expanded files."""
    pytest.importorskip("xacrodoc")
    other = package.parent / "other" / "arm"
    copytree(package, other)
    macros = other / "urdf" / "macros.xacro"
    macros.write_text(MACROS.replace('value="2"', 'value="3"'))
    a, b = (folder / "urdf" / "arm.urdf.xacro" for folder in (package, other))
    comparison = compared(a, b, engine_a="mujoco", engine_b="mujoco")
    differences = [one for one in result(comparison).properties if one.moves]
    assert {(one.about, one.a, one.b) for one in differences} == {("upper", 2, 3), ("fore", 2, 3)}
    assert {one.where_b.file for one in differences if one.where_b is not None} == {str(macros)}


def test_xacro_error_is_reported_with_its_reason(package: Path) -> None:
    pytest.importorskip("xacrodoc")
    source = package / "urdf" / "arm.urdf.xacro"
    source.write_text(ARM.replace("xacro:rod name", "xacro:bar name"))
    with pytest.raises(FolderError, match=r"arm\.urdf\.xacro: xacro: .*bar.*correct the source"):
        source_file(str(source))


def test_expanding_twice_gives_the_same_file(package: Path) -> None:
    pytest.importorskip("xacrodoc")
    source = package / "urdf" / "arm.urdf.xacro"
    assert expand(source) == expand(source)


def test_mesh_of_a_package_is_located_above_the_file_or_in_the_environment(
    package: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    mesh = package / "meshes" / "rod.stl"
    mesh.parent.mkdir()
    mesh.write_text("solid rod\nendsolid rod\n")
    model = package / "urdf" / "arm.urdf"
    assert locate_mesh(model, "package://arm/meshes/rod.stl") == mesh
    assert locate_mesh(model, "../meshes/rod.stl") == package / "urdf" / "../meshes/rod.stl"
    assert locate_mesh(model, "package://hand/meshes/rod.stl") == mesh  # a renamed package
    other = tmp_path / "install" / "share" / "hand" / "meshes" / "rod.stl"
    other.parent.mkdir(parents=True)
    other.write_text("solid other\nendsolid other\n")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "install"))
    assert locate_mesh(model, "package://hand/meshes/rod.stl") == other
    assert locate_mesh(model, "package://arm/meshes/absent.stl") is None


def test_robot_comes_from_the_cache_without_network(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("robot_descriptions")
    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(tmp_path))
    with pytest.raises(FolderError, match=r"not in .*robot_descriptions pull panda_description"):
        source_file("robot:panda")
    file = tmp_path / "example-robot-data" / "robots" / "panda_description" / "urdf" / "panda.urdf"
    file.parent.mkdir(parents=True)
    file.write_text("<robot name='panda'/>")
    assert source_file("robot:panda") == file
    with pytest.raises(FolderError, match="no such robot; similar: robot:panda"):
        source_file("robot:pandda")


def test_plain_path_has_no_source(tmp_path: Path) -> None:
    assert source_file(str(tmp_path / "arm.urdf")) is None
    assert source_file("simple_pendulum") is None
