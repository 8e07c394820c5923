"""The small sound folder that every entry starts from: a driven oscillator for one second."""

from __future__ import annotations

from pathlib import Path

SYSTEM = '''"""A mass on a spring and a damper, driven."""

from sympy import sin

from physics_crosscheck import Constant, Coordinate, Equilibrium, Input, Output, Scenario, System, t

x = Coordinate("x", "m", "displacement")
m = Constant("m", 1.3, "kg", "mass", "chosen")
c = Constant("c", 0.9, "N*s/m", "damping", "chosen")
k = Constant("k", 47.0, "N/m", "stiffness", "chosen")
f = Input("f", "N", "force", on={x: 1})
system = System(
    name="oscillator",
    title="Oscillator",
    source="chosen",
    coordinates=(x,),
    constants=(m, c, k),
    inputs=(f,),
    outputs=(Output("x", x.q, "m", "displacement"),),
    T=m * x.v**2 / 2,
    V=k * x.q**2 / 2,
    D=c * x.v**2 / 2,
    equilibria=(Equilibrium("rest", {x: 0}, False, "relaxed"),),
    scenarios=(
        Scenario("driven", "driven", q={x: 0.1}, v={x: 0.2}, inputs={f: 1.5 * sin(5.9 * t)},
                 duration=1.0),
    ),
    published=(),
)
'''

MJCF = """<mujoco model="oscillator">
  <compiler angle="radian" inertiafromgeom="false"/>
  <option timestep="0.002" integrator="Euler" gravity="0 0 -9.81"/>
  <worldbody>
    <body name="block" pos="0 0 1">
      <joint name="x" type="slide" axis="1 0 0" stiffness="47" damping="0.9"/>
      <inertial pos="0 0 0" mass="1.3" diaginertia="1 1 1"/>
    </body>
  </worldbody>
</mujoco>
"""

MJCF_SIDECAR = """engines = ["mujoco"]

[bindings]
"joint[x]@stiffness" = "k"
"joint[x]@damping" = "c"
"body[block]/inertial@mass" = "m"
"""

URDF = """<?xml version="1.0"?>
<robot name="oscillator">
  <link name="ground"><inertial><mass value="1"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="block"><inertial><origin xyz="0 0 0"/><mass value="1.3"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="x" type="prismatic">
    <parent link="ground"/><child link="block"/><origin xyz="0 0 1"/><axis xyz="1 0 0"/>
    <limit lower="-100" upper="100" effort="1000" velocity="100"/>
    <dynamics damping="0.9" friction="0"/>
  </joint>
  <gazebo reference="x"><springStiffness>47.0</springStiffness></gazebo>
</robot>
"""

URDF_SIDECAR = """engines = ["pybullet", "mujoco"]

[settings]
step = 0.002
gravity = [0, 0, -9.81]

[settings.mujoco]
integrator = "Euler"

[bindings]
"link[block]/inertial/mass@value" = "m"
"joint[x]/dynamics@damping" = "c"
"gazebo[x]/springStiffness" = "k"
"""

SPACE = '''"""A mass on a spring and a damper."""

import pymunk

MASS = 1.3
STIFFNESS = 47.0
DAMPING = 0.9


def build():
    """Build the space, seen from the side; the floor bears the weight."""
    space = pymunk.Space()
    space.gravity = (0, 0)
    block = pymunk.Body(MASS, float("inf"))
    ground = space.static_body
    spring = pymunk.DampedSpring(ground, block, (-1, 0), (0, 0), 1.0, STIFFNESS, DAMPING)
    space.add(block, spring)
    return space, {"block": block}
'''

SPACE_SIDECAR = """engines = ["pymunk"]

[settings]
step = 0.002

[coordinates]
"block.x" = "x"
"block.y" = 0
"block.angle" = 0

[readback]
x = "block.x"

[bindings]
MASS = "m"
STIFFNESS = "k"
DAMPING = "c"
"""

MODELS = {
    "mujoco.xml": (MJCF, MJCF_SIDECAR),
    "robot.urdf": (URDF, URDF_SIDECAR),
    "space.py": (SPACE, SPACE_SIDECAR),
}
"""Texts of the model file and of its sidecar, by the name of the model file."""


def write_sound_folder(folder: Path, *models: str) -> Path:
    """Write the sound folder with some of its model files, and return its path."""
    folder.mkdir(parents=True)
    (folder / "system.py").write_text(SYSTEM, "utf-8")
    for model in models:
        text, sidecar = MODELS[model]
        (folder / model).write_text(text, "utf-8")
        (folder / f"{model}.toml").write_text(sidecar, "utf-8")
    return folder
