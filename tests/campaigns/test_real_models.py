"""The campaign on real robots, with a few small files."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from msgspec import structs

from campaigns.real_models.__main__ import is_done
from campaigns.real_models.check import digest_of
from campaigns.real_models.entry import EngineResult, FileEntry, append_entry, read_entries
from campaigns.real_models.summary import FileKind, kind_of, summary
from physics_crosscheck.records import Outcome

PENDULUM = """<mujoco model="p"><worldbody><body><joint name="q" axis="0 1 0"/>
<geom size="0.1" pos="0 0 -1" mass="1"/></body></worldbody></mujoco>"""
ARM = """<robot name="r"><link name="g"/><link name="a"><inertial><origin xyz="0 0 -1"/>
<mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="q" type="continuous"><parent link="g"/><child link="a"/><axis xyz="0 1 0"/></joint>
</robot>"""
FILES = {
    "one/p.xml": PENDULUM,
    "one/part.xml": '<mujoco><include file="none.xml"/></mujoco>',
    "one/whole.xml": '<mujoco><include file="part.xml"/><worldbody/></mujoco>',
    "one/still.xml": '<mujoco><worldbody><geom size="1"/></worldbody></mujoco>',
    "two/r.urdf": ARM,
    "two/light.urdf": ARM.replace('value="1"', 'value="0"').replace('"0.1"', '"0"'),
}


def run_campaign(folder: Path) -> str:
    """Run the campaign on both folders; return its output."""
    command = [sys.executable, "-m", "campaigns.real_models", f"{folder}/one", f"{folder}/two",
               "--jobs", "1", "--kept", f"{folder}/read_entries.jsonl"]  # fmt: skip
    done = subprocess.run(
        command, capture_output=True, text=True, check=True, cwd=Path(__file__).parents[2]
    )
    return done.stdout


@pytest.mark.slow
def test_each_robot_has_a_line_and_each_rejection_a_reason(tmp_path: Path) -> None:
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    output = run_campaign(tmp_path)
    assert "[1/6, " in output
    assert f"AGREES     mujoco    {tmp_path}/one/p.xml E " in output
    assert f"AGREES     pybullet  {tmp_path}/two/r.urdf E " in output
    assert "MJCF: 4 files, 2 robots that move" in output
    assert "URDF: 2 files, 2 robots that move" in output
    assert "1  part of another file" in output
    assert "1  verdict: AGREES or DIFFERS in at least one engine   50.0%" in output
    assert "1  URDF: joint * moves nothing with inertia, so its acceleration is undefined" in output
    assert "1  MJCF: MuJoCo can't load it: XML Error: Error opening file *" in output


def test_finished_robots_are_repeated_only_on_request(tmp_path: Path) -> None:
    file, lines = tmp_path / "r.urdf", tmp_path / "kept.jsonl"
    file.write_text(ARM)
    wrong = EngineResult(engine="a", outcome=Outcome.FAILED, reason="a crash")
    failed = structs.replace(entry(wrong), file=str(file), digest=digest_of(file))
    append_entry(lines, failed)
    append_entry(lines, entry())
    lines.write_bytes(lines.read_bytes()[:-20])  # the last line is incomplete
    assert dict(read_entries(lines)) == {str(file): failed}
    append_entry(lines, entry())
    assert len(read_entries(lines)) == 2
    assert is_done(file, failed, None)
    assert is_done(file, failed, "UNRESOLVED")
    assert not is_done(file, failed, "FAILED .*crash")
    assert not is_done(file, None, None)
    file.write_text(ARM + " ")
    assert not is_done(file, failed, None)


def entry(*cases: EngineResult, obstacles: tuple[str, ...] = ()) -> FileEntry:
    return FileEntry(
        file="/a/r.urdf", digest="0", tree=not obstacles, dof=2, obstacles=obstacles,
        left_out=("contact geometry",), impossible=(), cases=cases,
    )  # fmt: skip


def test_crashes_and_faulty_files_are_not_verdicts() -> None:
    slow = EngineResult(
        engine="a", outcome=Outcome.FAILED, reason="out of its 120 processor seconds"
    )
    wrong = EngineResult(
        engine="b", outcome=Outcome.FAILED, reason="/a/r.urdf: PyBullet sets to zero"
    )
    vague = EngineResult(
        engine="b", outcome=Outcome.UNRESOLVED, uncertainty=2e-9, discrepancy=1e-10
    )
    differs = EngineResult(
        engine="c", outcome=Outcome.DIFFERS, reason="off", cause="moments of 'x'"
    )
    assert kind_of(entry(slow), ()) is FileKind.BROKEN
    assert kind_of(entry(wrong), ()) is FileKind.FAULT
    assert kind_of(entry(slow, vague), ()) is FileKind.UNRESOLVED
    assert kind_of(entry(wrong, differs), ()) is FileKind.VERDICT
    assert kind_of(entry(obstacles=("/a/r.urdf: joint 'x' is planar",)), ()) is FileKind.REFUSED
    text = summary([entry(wrong, differs)], ())
    assert "/a/r.urdf in c: off\n    moments of 'x'" in text
    assert "URDF b FAILED: PyBullet sets to zero  [r.urdf]" in text
