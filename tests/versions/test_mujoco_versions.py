"""Comparison of two versions of MuJoCo, of which one is installed from a package index."""

import importlib.metadata
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from physics_crosscheck.harness.records.baseline import Gate
from physics_crosscheck.harness.records.read import decoded
from physics_crosscheck.records import Outcome
from tests.faults.known_folder import environment
from tests.installed.documents import ROOT, check_shown, commands

OTHER = "3.3.7"

ROTATED = """<robot name="rotated">
  <link name="base"/>
  <joint name="hinge" type="continuous">
    <parent link="base"/>
    <child link="arm"/>
    <axis xyz="0 1 0"/>
  </joint>
  <link name="arm">
    <inertial>
      <origin xyz="0 0 -0.5" rpy="0 0 0.7"/>
      <mass value="2"/>
      <inertia ixx="0.1" iyy="0.06" izz="0.05" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
</robot>
"""

MESHES = """<mujoco model="meshes">
  <asset><mesh file="looks.stl"/><mesh file="more/looks_more.stl" scale="2 2 2"/></asset>
  <worldbody>
    <body>
      <joint name="hinge" axis="0 1 0"/>
      <inertial pos="0 0 -0.5" mass="2" diaginertia="0.1 0.06 0.05"/>
      <geom type="mesh" mesh="looks" contype="0" conaffinity="0"/>
      <geom type="mesh" mesh="looks_more" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
</mujoco>
"""
"""Unnamed visual geometry, identified by file name only; it has no effect on motion."""


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the user's cache, in which the other version is installed once."""
    return tmp_path_factory.mktemp("cache")


@pytest.mark.release
def test_fixed_fault_is_reported_and_other_results_are_identical(
    tmp_path: Path, cache: Path
) -> None:
    here = importlib.metadata.version("mujoco")
    (tmp_path / "rotated.urdf").write_text(ROTATED)
    (tmp_path / "meshes.xml").write_text(MESHES)
    command = [
        *(sys.executable, "-m", "physics_crosscheck", "versions", "rotated.urdf", "meshes.xml"),
        *("--engine", "mujoco", OTHER, here),
        *("--environments", str(cache / "physics-crosscheck" / "environments")),
    ]
    done = subprocess.run(
        command,
        cwd=tmp_path,
        env=environment(),
        capture_output=True,
        text=True,
        timeout=1800,
        check=False,
    )
    if f"mujoco {OTHER} can't be installed" in done.stderr:
        pytest.skip(f"no package index gives MuJoCo {OTHER}: {done.stderr.strip()}")
    assert done.returncode == 1, done.stdout + done.stderr
    path = tmp_path / "reports" / "versions" / f"mujoco-{here}" / "gate.json"
    cases = {case.model: case for case in decoded(path.read_bytes(), Gate).cases}
    rotated, meshes = cases["rotated.urdf"], cases["meshes.xml"]
    assert rotated.outcomes == (Outcome.DIFFERS, Outcome.AGREES)
    assert rotated.moved is not None
    assert 0.01 < rotated.moved < 0.1
    assert (meshes.changed, meshes.moved) == ((), 0.0)


@pytest.mark.release
def test_gripper_comparison_prints_what_the_page_shows(tmp_path: Path, cache: Path) -> None:
    shutil.copy(ROOT / "docs" / "cases" / "gripper.urdf", tmp_path)
    _, excepted = commands((ROOT / "docs" / "cases.md").read_text())
    (command,) = (each for each in excepted if each.text.startswith("crosscheck versions gripper"))
    assert len(command.shown) == 6
    done = subprocess.run(
        [sys.executable, "-m", "physics_crosscheck", *command.text.split()[1:]],
        cwd=tmp_path,
        env=environment() | {"XDG_CACHE_HOME": str(cache)},
        capture_output=True,
        text=True,
        timeout=1800,
        check=False,
    )
    if "can't be installed" in done.stderr:
        pytest.skip(f"no package index gives these versions of MuJoCo: {done.stderr.strip()}")
    assert done.returncode == command.code, done.stdout + done.stderr
    check_shown(command, done.stdout)
