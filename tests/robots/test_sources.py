"""Xacro sources and robots by name: their files, and the lines of the sources."""

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from shutil import copytree

import numpy as np
import pytest
import trimesh

from physics_crosscheck.harness.audits import audits
from physics_crosscheck.harness.documents import expanded
from physics_crosscheck.harness.documents.expanded import (
    expand,
    locate_file,
    package_folders,
    source_of,
)
from physics_crosscheck.harness.interfaces.cli.main import main
from physics_crosscheck.harness.modelfiles.folders import FolderError
from physics_crosscheck.harness.modelfiles.mesh_files import MeshError, read_mesh
from physics_crosscheck.harness.modelfiles.readers import read_robot, robot_system
from physics_crosscheck.harness.modelfiles.robot_targets import source_file
from physics_crosscheck.harness.run import Options
from tests.compare.asking import compared, result
from tests.models import written

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
    pytest.importorskip("xacro")
    macros = written(package / "urdf", "macros.xacro", MACROS.replace('izz="0.001"', 'izz="9"'))
    file = source_file(str(package / "urdf" / "arm.urdf.xacro"))
    assert file is not None
    assert file.name == "arm.urdf"
    assert [part.name for part in read_robot(file).parts] == ["base", "upper", "fore"]
    (audit,) = audits([file], Options(engines=("mujoco",)))
    places = [one.location for one in audit.findings if one.location is not None]
    assert {place.file for place in places} == {str(macros)}
    lines = [MACROS.splitlines()[(place.line or 0) - 1].strip() for place in places]
    assert set(lines) == {'<link name="${name}">'}


def test_two_versions_of_a_package_are_compared(package: Path) -> None:
    """Catch sources both expanded with the macros of the first, and lines of expanded files."""
    pytest.importorskip("xacro")
    other = package.parent / "other" / "arm"
    copytree(package, other)
    macros = written(other / "urdf", "macros.xacro", MACROS.replace('value="2"', 'value="3"'))
    a, b = (folder / "urdf" / "arm.urdf.xacro" for folder in (package, other))
    comparison = compared(a, b, engine_a="mujoco", engine_b="mujoco")
    differences = [one for one in result(comparison).properties if one.moves]
    assert {(one.about, one.a, one.b) for one in differences} == {("upper", 2, 3), ("fore", 2, 3)}
    assert {one.where_b.file for one in differences if one.where_b is not None} == {str(macros)}


def test_xacro_error_is_reported_with_its_reason(package: Path) -> None:
    pytest.importorskip("xacro")
    source = package / "urdf" / "arm.urdf.xacro"
    source.write_text(ARM.replace("xacro:rod name", "xacro:bar name"))
    with pytest.raises(FolderError, match=r"arm\.urdf\.xacro:6: xacro: .*bar.*correct the so"):
        source_file(str(source))


def test_packages_beside_the_source_come_before_the_environment(
    package: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Catch siblings that are not found, in other repositories and under other folder names."""
    pytest.importorskip("xacro")
    source = written(package / "urdf", "arm.urdf.xacro", ARM.replace("$(find arm)", "$(find rods)"))
    with pytest.raises(FolderError, match=r"the ROS package rods\b.* Put its folder beside .*arm"):
        source_file(str(source))
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "install"))
    for place in ("install/share/rods", "renamed_rods", "repository/rods"):
        (tmp_path / place / "urdf").mkdir(parents=True)
        (tmp_path / place / "package.xml").write_text("<package><name>rods</name></package>")
        macros = tmp_path / place / "urdf" / "macros.xacro"
        mass = f'<mass value="{len(place)}"/>'
        macros.write_text(MACROS.replace('<mass value="2"/>', mass))
        assert mass in expand(source).read_text()


@pytest.mark.parametrize("file", ["arm.urdf.xacro", "macros.xacro"])
def test_absent_package_is_named_with_its_remedy(package: Path, file: str) -> None:
    place = "" if file.startswith("arm") else rf" \S+{file}:"
    text = (package / "urdf" / file).read_text()
    include = (
        '<xacro:if value="1"><xacro:include filename="$(find none)/a.xacro"/></xacro:if></robot>'
    )
    (package / "urdf" / file).write_text(text.replace("</robot>", include))
    with pytest.raises(
        FolderError, match=rf"^\S+arm.urdf.xacro:{place}\d+: needs the ROS package none"
    ):
        source_file(str(package / "urdf" / "arm.urdf.xacro"))


def test_arguments_reach_the_source_and_a_missing_one_is_named(
    package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("xacro")
    source = package / "urdf" / "arm.urdf.xacro"
    source.write_text(ARM.replace('value="0.5"', 'value="$(arg lower)"'))
    with pytest.raises(FolderError, match=r"xacro:\d+: .*t lower has no default. Add lower:=VALUE"):
        source_file(str(source))
    texts = []
    for words in (["lower:=0.25"], ["--xacro-arg", "lower:=0.125"]):
        monkeypatch.setenv("CROSSCHECK_XACRO_ARGS", "")
        assert main(["derive", str(source), *words]) == 0
        texts.append(source_file(str(source)).read_text())  # type: ignore[union-attr]
    assert ['lower="0.25"' in texts[0], 'lower="0.125"' in texts[1]] == [True, True]
    with pytest.raises(SystemExit):
        main(["derive", str(source), "--xacro-arg", "lower"])


def test_macros_alone_name_the_robots_that_use_them(package: Path) -> None:
    pytest.importorskip("xacro")
    with pytest.raises(FolderError, match=r"defines macros, not a robot. .*: \S+arm\.urdf\.xacro$"):
        source_file(str(package / "urdf" / "macros.xacro"))


def test_expanded_mesh_is_located_from_the_source(package: Path) -> None:
    pytest.importorskip("xacro")
    mesh = package / "meshes" / "rod.stl"
    mesh.parent.mkdir()
    mesh.write_text("solid rod\nendsolid rod\n")
    shape = '<visual><geometry><mesh filename="{}"/></geometry></visual>'
    source = package / "urdf" / "arm.urdf.xacro"
    for name in ("package://arm/meshes/rod.stl", "../meshes/rod.stl"):
        link = f'<link name="base">{shape.format(name)}</link>'
        source.write_text(ARM.replace('<link name="base"/>', link))
        assert str(mesh) in source_file(str(source)).read_text()  # type: ignore[union-attr]


def test_gate_names_lines_of_the_source(
    package: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Catch a baseline of the cache's copy, which no later edit of the source changes."""
    pytest.importorskip("xacro")
    monkeypatch.chdir(tmp_path)
    source = "arm/urdf/arm.urdf.xacro"
    only = ["--engine", "mujoco", "--smooth"]
    assert main(["run", source, *only]) == 0
    printed = capsys.readouterr().out
    assert f"\n{source}  2 joints" in printed
    assert "/cache/" not in printed + (tmp_path / "reports" / "results.json").read_text()
    monkeypatch.delenv("CI", raising=False)
    assert main(["accept", source, "--engine", "mujoco", "--reason", "measured"]) == 0
    written(package / "urdf", "macros.xacro", MACROS.replace('value="2"', 'value="3"'))
    assert main(["gate"]) == 1
    assert "arm/urdf/macros.xacro:6 mass of link upper 2 -> 3" in capsys.readouterr().out


def test_mesh_of_a_package_is_located_above_the_file_or_in_the_environment(
    package: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    mesh = package / "meshes" / "rod.stl"
    mesh.parent.mkdir()
    mesh.write_text("solid rod\nendsolid rod\n")
    model = package / "urdf" / "arm.urdf"
    assert locate_file(model, "package://arm/meshes/rod.stl") == mesh
    assert locate_file(model, "../meshes/rod.stl") == package / "urdf" / "../meshes/rod.stl"
    assert locate_file(model, "package://hand/meshes/rod.stl") == mesh  # a renamed package
    other = tmp_path / "install" / "share" / "palm" / "meshes" / "rod.stl"
    other.parent.mkdir(parents=True)
    other.write_text("solid other\nendsolid other\n")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "install"))
    assert locate_file(model, "package://palm/meshes/rod.stl") == other
    assert locate_file(model, "package://arm/meshes/absent.stl") is None
    model.touch()
    assert locate_file(model, f"package:///{model.name}") == model  # an export without a package


PLANNED = """<robot name="planned"><link name="base"/><!-- <inertial/> -->
<link name="a"/><link name="b"/>
<joint name="j" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="5" velocity="1"/></joint>
<joint name="k" type="prismatic"><parent link="a"/><child link="b"/><origin xyz="1 0 0"/>
<axis xyz="0 0 1"/><limit lower="0" upper="1" effort="5" velocity="1"/></joint></robot>
"""


def test_urdf_without_inertia_is_compared_by_poses(
    package: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Catch a robot for planning that no engine checks, and lines of the copy that it runs."""
    file = written(package / "urdf", "planned.urdf", PLANNED)
    assert main(["run", str(file), "--engine", "mujoco", "--out", str(package / "out")]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "3 links in 2 bodies, without masses" in shown
    assert "digits poses only" in shown
    assert "limits: follow the file" in shown
    zeros = '<inertial><mass value="0.0"/><inertia ixx="0" iyy="-0" izz="0"/></inertial>'
    file.write_text(re.sub(r"(<link name=.[ab].)/>", rf"\1>{zeros}</link>", PLANNED))
    assert main(["run", str(file), "--engine", "mujoco", "--out", str(package / "out")]) == 0
    assert "digits poses only" in " ".join(capsys.readouterr().out.split())
    plane = (
        '<collision><origin xyz="0 0 -5"/><geometry><box size="30 30 9"/></geometry></collision>'
    )
    file.write_text(f'<robot name="p"><link name="plane">{plane}</link></robot>')
    assert main(["run", str(file), "--engine", "pybullet", "--out", str(package / "out")]) == 0
    assert "digits poses only" in " ".join(capsys.readouterr().out.split())
    file.write_text(PLANNED.replace('lower="0"', 'lower="zero"'))
    main(["run", str(file), "--engine", "mujoco", "--out", str(package / "out")])
    assert "planned.urdf:6" in (shown := capsys.readouterr().out)
    assert str(package / "cache") not in shown


def test_world_that_only_a_joint_names_is_declared(
    package: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Catch a file that one engine reads, and that no engine runs."""
    products = 'ixy="0" ixz="0" iyz="0"'
    inertia = f'<inertia ixx="1" iyy="1" izz="1" {products}/>'
    inertial = f'<inertial><mass value="1"/>{inertia}</inertial>'
    held = '<joint name="w" type="fixed"><parent link="world"/><child link="base"/></joint>'
    text = PLANNED.replace('"/>\n<joint name="j"', f'"/>{held}\n<joint name="j"')
    for name in "ab":
        text = text.replace(f'<link name="{name}"/>', f'<link name="{name}">{inertial}</link>')
    file = written(package, "held.urdf", text)
    assert main(["run", str(file), "--engine", "mujoco", "--out", str(package / "out")]) == 0
    assert "2 joints, 4 links in" in capsys.readouterr().out
    assert source_file(str(file)) != file


def test_urdf_with_substitutions_of_xacro_is_expanded(package: Path) -> None:
    pytest.importorskip("xacro")
    file = package / "arm.urdf"
    joint = '<joint name="k" type="fixed"><parent link="a"/><child link="b"/><origin xyz="{}"/>'
    links = '<link name="a"><inertial><mass value="1"/></inertial></link><link name="b"/>'
    place = "$(optenv UNSET_HERE 0.19 0 0.149)"
    file.write_text(f'<robot name="arm">{links}{joint.format(place)}</joint></robot>')
    expanded_file = source_file(str(file))
    assert expanded_file is not None
    assert 'xyz="0.19 0 0.149"' in expanded_file.read_text()


MJCF = """<mujoco><compiler meshdir="meshes"/>
<asset><mesh file="rod.obj"/></asset><include file="parts/leg.xml"/></mujoco>"""
LEG = """<mujoco><worldbody><body><joint axis="0 1 0"/>
<geom type="mesh" mesh="rod" mass="1"/></body></worldbody></mujoco>"""
ROD = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
WORLD = """<sdf version="1.9"><world name="w"><model name="arm"><link name="a"><inertial><mass>1
</mass></inertial></link><joint name="j" type="revolute"><parent>world</parent><child>a</child>
<axis><xyz>0 1 0</xyz></axis></joint></model></world></sdf>"""


@pytest.mark.parametrize(("name", "text"), [("arm.mjcf", MJCF), ("arm.world", WORLD)])
def test_other_suffixes_of_a_format_are_read(package: Path, name: str, text: str) -> None:
    for part, content in (("parts/leg.xml", LEG), ("meshes/rod.obj", ROD), (name, text)):
        (package / part).parent.mkdir(exist_ok=True)
        (package / part).write_text(content)
    file = source_file(str(package / name))
    assert file is not None
    assert len(robot_system(read_robot(file)).coordinates) == 1
    assert source_of(file) == package / name


def test_many_missing_meshes_search_their_package_once(
    package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    searched: list[str] = []

    def folders(name: str, file: Path) -> Iterator[Path]:
        searched.append(name)
        return package_folders(name, file)

    monkeypatch.setattr(expanded, "package_folders", folders)
    monkeypatch.setattr(expanded, "SEARCH_SECONDS", 1e9)
    for i in range(20):
        assert locate_file(package / "urdf" / "b.urdf", f"package://gone/{i}.stl") is None
    assert searched == ["gone"]


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


def test_source_of_the_suffix_urdf_is_expanded(package: Path) -> None:
    source = (package / "urdf" / "arm.urdf.xacro").rename(package / "urdf" / "arm.urdf")
    expanded = source_file(str(source))
    assert expanded is not None
    assert read_robot(expanded).tree is not None
    comment = "<robot><!-- <xacro:include filename='a'/> --><link name='l'>{}</link></robot>"
    (package / "plain.urdf").write_text(comment.format("<inertial><mass value='1'/></inertial>"))
    assert source_file(str(package / "plain.urdf")) is None


def test_gltf_is_turned_from_y_up_to_z_up(tmp_path: Path) -> None:
    box = trimesh.creation.box((0.1, 0.2, 0.3)).apply_translation((0, 1, 0))
    box.export(tmp_path / "box.glb")
    points = read_mesh(tmp_path / "box.glb").points
    np.testing.assert_allclose(np.ptp(points, axis=0), (0.1, 0.3, 0.2), atol=1e-6)
    np.testing.assert_allclose(points.mean(axis=0), (0, 0, 1), atol=1e-6)


def test_mesh_without_a_reader_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Catch a missing module that makes a robot's picture a ball without a word."""
    file = tmp_path / "part.obj"
    (tmp_path / "part.mtl").write_text("newmtl a\n")
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n"
    file.write_text(f"mtllib part.mtl\n{corners}")
    assert len(read_mesh(file).faces) == 1
    read_mesh.cache_clear()
    monkeypatch.setitem(sys.modules, "PIL", None)
    monkeypatch.setitem(sys.modules, "PIL.Image", None)
    with pytest.raises(MeshError, match=r"part\.obj: .*PIL.*install"):
        read_mesh(file)
