"""The campaign on real robots, on a few of them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

PENDULUM = """<mujoco model="p"><worldbody><body><joint name="q" axis="0 1 0"/>
<geom size="0.1" pos="0 0 -1" mass="1"/></body></worldbody></mujoco>"""
ARM = """<robot name="r"><link name="g"/><link name="a"><inertial><origin xyz="0 0 -1"/>
<mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="q" type="continuous"><parent link="g"/><child link="a"/><axis xyz="0 1 0"/></joint>
</robot>"""
FILES = {
    "one/p.xml": PENDULUM,
    "one/part.xml": '<mujocoinclude><body name="b"/></mujocoinclude>',
    "one/still.xml": '<mujoco><worldbody><geom size="1"/></worldbody></mujoco>',
    "one/broken.xml": '<mujoco><include file="gone.xml"/><worldbody/></mujoco>',
    "two/r.urdf": ARM,
    "two/light.urdf": ARM.replace('value="1"', 'value="0"').replace('"0.1"', '"0"'),
}


def test_each_robot_has_a_line_and_each_refusal_its_reason(tmp_path: Path) -> None:
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    done = subprocess.run(
        [sys.executable, "-m", "campaigns.real_models", tmp_path / "one", tmp_path / "two",
         "--jobs", "1"],
        capture_output=True, text=True, check=True, cwd=Path(__file__).parents[2],
    )  # fmt: skip
    told = done.stdout
    assert "5 files, 2 read, 3 with obstacles" in told
    assert f"AGREES     mujoco    {tmp_path}/one/p.xml E " in told
    assert f"AGREES     pybullet  {tmp_path}/two/r.urdf E " in told
    assert "joint * moves nothing that has inertia" in told
    assert "Error opening file 'gone.xml'" in told
    assert ".xml: 3 files, 1 of them robots that move, 1 with a verdict (100.0%)" in told
    assert ".urdf: 2 files, 2 of them robots that move, 1 with a verdict (50.0%)" in told
