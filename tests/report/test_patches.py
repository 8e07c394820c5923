"""What is to be changed, as a diff that can be applied."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from harness.records.base import SourceLine
from harness.report.patches import lines_of, unified
from harness.text.next_steps import Change

URDF = """<robot>
  <link name="rod">
    <inertial>
      <mass value="0.9"/>
      <inertia ixx="0.024" iyy="0.024" izz="0.0001" ixy="0"/>
      <origin xyz="0 0 -0.3" rpy="0 0 0"/>
    </inertial>
  </link>
</robot>
"""
SIDECAR = "[settings]\nstep = 0.01\ngravity = [0, 0, -9.8]"


def edit(subject: str | tuple[str, ...], lines: tuple[int, ...], old: float, new: str) -> Change:
    return Change(
        subject=(subject,) if isinstance(subject, str) else subject,
        where=tuple(SourceLine(file="models/disc/robot.urdf", line=line) for line in lines),
        old=old,
        new=new,
    )


def patched(*edits: Change) -> str:
    return unified(edits, (("robot.urdf", URDF), ("robot.urdf.toml", SIDECAR)))


MASS = edit("link[rod]/inertial/mass@value", (4,), 0.9, "0.8")


def test_a_patch_changes_the_number_and_nothing_else() -> None:
    told = patched(MASS)
    assert told.startswith("--- a/models/disc/robot.urdf\n+++ b/models/disc/robot.urdf\n@@ -1,7 ")
    assert lines_of(told) == ('- <mass value="0.9"/>', '+ <mass value="0.8"/>')


@pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")
def test_git_applies_a_patch_of_a_file_and_of_its_sidecar_without_a_last_newline(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "models" / "disc"
    folder.mkdir(parents=True)
    (folder / "robot.urdf").write_text(URDF)
    (folder / "robot.urdf.toml").write_text(SIDECAR)
    where = (SourceLine(file="models/disc/robot.urdf.toml", line=3),)
    gravity = Change(subject=("sidecar:settings.gravity[2]",), where=where, old=-9.8, new="-9.81")
    told = patched(MASS, gravity)
    subprocess.run(["git", "apply", "-"], input=told, text=True, cwd=tmp_path, check=True)
    assert (folder / "robot.urdf").read_text() == URDF.replace("0.9", "0.8")
    assert (folder / "robot.urdf.toml").read_text() == SIDECAR.replace("-9.8]", "-9.81]")


def test_of_equal_numbers_in_a_line_the_one_that_is_meant_is_changed() -> None:
    one = edit("link[rod]/inertial/inertia@iyy", (5,), 0.024, "0.03")
    assert lines_of(patched(one))[1] == ('+ <inertia ixx="0.024" iyy="0.03" izz="0.0001" ixy="0"/>')
    both = edit(("link[rod]//inertia@ixx", "link[rod]//inertia@iyy"), (5,), 0.024, "0.03")
    assert 'ixx="0.03" iyy="0.03" izz="0.0001"' in lines_of(patched(both))[1]


@pytest.mark.parametrize(
    "uncertain",
    [
        edit("link[rod]/inertial/mass@value", (4,), 0.7, "0.8"),
        edit("link[rod]/inertial/mass@value", (99,), 0.9, "0.8"),
        edit("link[rod]/inertial/origin@xyz[1]", (6,), 0.0, "0.8"),
        edit("link[rod]/inertial/mass@value", (), 0.9, "0.8"),
    ],
)
def test_what_is_not_certain_makes_no_patch_at_all(uncertain: Change) -> None:
    """Another number stands there, no such line, several that may be meant, no line."""
    assert patched(uncertain) == ""
    assert patched(MASS, uncertain) == ""


def test_an_absolute_path_becomes_a_name_that_can_be_applied_where_the_file_lies() -> None:
    where = (SourceLine(file="/models/disc/robot.urdf", line=4),)
    told = patched(Change(subject=MASS.subject, where=where, old=0.9, new="0.8"))
    assert told.startswith("--- a/robot.urdf\n+++ b/robot.urdf\n")
