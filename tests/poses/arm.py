"""An arm of two hinges with a tool, in equations, MJCF and URDF, and checks of its poses."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from physics_crosscheck import (
    Constant,
    Coordinate,
    Equilibrium,
    Output,
    Pose,
    Scenario,
    System,
    ground,
)
from physics_crosscheck.harness.checks.poses import PoseCheck, check_poses
from physics_crosscheck.harness.checks.task import load
from physics_crosscheck.harness.modelfiles.sidecar import read_sidecar

a = Coordinate("a", "rad", "shoulder, about the vertical")
b = Coordinate("b", "rad", "elbow, toward +x")
h = Constant("h", 0.5, "m", "height of the elbow", "chosen")
l = Constant("l", 0.8, "m", "length of the arm", "chosen")  # noqa: E741  # the usual name
J = Constant("J", 0.3, "kg*m^2", "inertia", "chosen")

_COLUMN = ground.hinge(a, about=(0, 0, 1)).at(0, 0, h)
_ARM = _COLUMN.hinge(b, about=(0, -1, 0))
_TOOL = _ARM.at(0, 0, -l).turned((1, 0, 0), 0.3)

ARM = System(
    name="arm",
    title="Arm",
    source="made up",
    coordinates=(a, b),
    constants=(h, l, J),
    inputs=(),
    outputs=(Output("a", a.q, "rad", "shoulder"),),
    T=J * (a.v**2 + b.v**2) / 2,
    V=0,
    D=0,
    equilibria=(Equilibrium("rest", at={a: 0, b: 0}, search=False, description="anywhere"),),
    scenarios=(Scenario("free", "let go", q={a: 0, b: 0}, v={a: 0, b: 1}, inputs={}, duration=1),),
    published=(),
    frames=(
        _COLUMN.pose("post", "the post's upper end"),
        _ARM.pose("arm", "the arm, at the elbow"),
        _TOOL.pose("tool", "the tool"),
        Pose("tip", tuple(_TOOL.origin), "where the tool is"),
    ),
)

MJCF = """<mujoco><compiler angle="radian"/><worldbody>
<body name="post" pos="0 0 0"><joint name="a" type="hinge" axis="0 0 1"/>
 <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
 <body name="arm" pos="0 0 0.5"><joint name="b" type="hinge" axis="0 -1 0"/>
  <inertial pos="0 0 -0.4" mass="1" diaginertia="1 1 1"/>
  <site name="tool" pos="0 0 -0.8" euler="0.3 0 0"/></body></body>
</worldbody></mujoco>"""
FRAMES = """[frames]
post = { is = "body:post", at = [0, 0, "h"] }
arm = "body:arm"
tool = "site:tool"
tip = "site:tool"
"""

SWING = replace(
    ARM,
    coordinates=(a,),
    T=J * a.v**2 / 2,
    equilibria=(Equilibrium("rest", at={a: 0}, search=False, description="anywhere"),),
    scenarios=(Scenario("free", "let go", q={a: 0}, v={a: 1}, inputs={}, duration=1),),
    frames=(
        ground.hinge(a, about=(0, -1, 0)).pose("rod", "a rod that swings toward +x"),
        ground.hinge(a, about=(0, -1, 0)).at(0, 0, -l).pose("end", "its end"),
    ),
)
SWING_MJCF = """<mujoco><worldbody><body name="rod"><joint name="a" type="hinge" axis="0 -1 0"/>
<inertial pos="0 0 -0.4" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>"""

URDF = """<robot name="arm"><link name="base"/>
<link name="post"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0"
 iyz="0"/></inertial></link>
<link name="arm"><inertial><origin xyz="0.1 0 -0.4" rpy="0.4 0.1 0.2"/><mass value="1"/>
 <inertia ixx="1" iyy="1.2" izz="1.5" ixy="0.1" ixz="0" iyz="0.2"/></inertial></link>
<link name="tool"><inertial><mass value="0.1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0"
 iyz="0"/></inertial></link>
<joint name="a" type="continuous"><parent link="base"/><child link="post"/>
 <axis xyz="0 0 1"/></joint>
<joint name="b" type="continuous"><parent link="post"/><child link="arm"/><origin xyz="0 0 0.5"/>
 <axis xyz="0 -1 0"/></joint>
<joint name="t" type="fixed"><parent link="arm"/><child link="tool"/>
 <origin xyz="0 0 -0.8" rpy="0.3 0 0"/></joint></robot>"""
LINKS = FRAMES.replace("body:", "link:").replace("site:", "link:")
SETTINGS = """[settings]
step = 0.002
gravity = [0, 0, 0]
"""


def poses(
    folder: Path,
    *changes: tuple[str, str],
    engine: str = "mujoco",
    file: str = "arm.xml",
    text: str = MJCF,
    sidecar: str = FRAMES,
    system: System = ARM,
) -> PoseCheck:
    """Compare poses of the arm after (old, new) changes of its file or its sidecar."""
    texts = {file: text, f"{file}.toml": f'engines = ["{engine}"]\n{sidecar}'}
    for old, new in changes:
        (name,) = [name for name, one in texts.items() if old in one]
        texts[name] = texts[name].replace(old, new, 1)
    _write(folder, texts)
    read = read_sidecar(folder / f"{file}.toml")
    model, coordinates = load(system, read, engine)
    reached = np.random.default_rng(1).uniform(-1, 1, (20, len(system.q)))
    return check_poses(system, read, model, coordinates, reached)


def message(check: PoseCheck) -> str:
    return "\n".join(one.message for one in check.findings)


def without_frames() -> System:
    return replace(ARM, frames=())


def _write(folder: Path, texts: Mapping[str, str]) -> None:
    for name, text in texts.items():
        (folder / name).write_text(text)
