"""Random serial chains of slides and hinges, the same one written as MJCF and as URDF."""

from collections.abc import Iterable

import numpy as np


def chain(seed: int, joints: int) -> tuple[str, str]:
    """Return (MJCF, URDF) of a chain with random axes, offsets, inertias, springs and dampers."""
    random = np.random.default_rng(seed)
    bodies, links = "", '  <link name="ground"/>\n'
    for i in range(joints):
        hinge = i == 0 or random.uniform() < 0.7
        size, mass = random.uniform(0.1, 0.5), random.uniform(0.2, 3.0)
        place, centre = random.uniform(-1, 1, 3) * size, random.uniform(-1, 1, 3) * size / 2
        turn = random.uniform(-1, 1, 3) * [0.8, 0.8, 3.0]
        axis = random.normal(size=3)
        axis = axis / np.linalg.norm(axis)
        root = random.normal(size=(3, 3)) * size / 6
        inertia = mass * (np.trace(root @ root.T) * np.eye(3) - root @ root.T)
        damping, spring, rest = random.uniform(0, 1), random.uniform(0, 30), random.uniform(-1, 1)
        x, y, z = (inertia[a, a] for a in range(3))
        xy, xz, yz = inertia[0, 1], inertia[0, 2], inertia[1, 2]
        bodies += (
            f'<body name="b{i}" pos="{words(place)}" euler="{words(turn)}">\n'
            f'  <joint name="j{i}" type="{"hinge" if hinge else "slide"}" axis="{words(axis)}"'
            f' damping="{damping!r}" stiffness="{spring!r}" springref="{rest!r}"/>\n'
            f'  <inertial pos="{words(centre)}" mass="{mass!r}"'
            f' fullinertia="{words([x, y, z, xy, xz, yz])}"/>\n'
        )
        links += f"""  <link name="b{i}"><inertial>
    <origin xyz="{words(centre)}"/><mass value="{mass!r}"/>
    <inertia ixx="{x}" iyy="{y}" izz="{z}" ixy="{xy}" ixz="{xz}" iyz="{yz}"/>
  </inertial></link>
  <joint name="j{i}" type="{"continuous" if hinge else "prismatic"}">
    <parent link="{f"b{i - 1}" if i else "ground"}"/><child link="b{i}"/>
    <origin xyz="{words(place)}" rpy="{words(turn)}"/><axis xyz="{words(axis)}"/>
    <dynamics damping="{damping!r}"/>
    <limit lower="-100" upper="100" effort="1e6" velocity="1e6"/>
  </joint>
  <gazebo reference="j{i}"><springStiffness>{spring!r}</springStiffness>
    <springReference>{rest!r}</springReference></gazebo>
"""
    # A URDF's roll, pitch and yaw are about fixed axes: MuJoCo's XYZ in capitals.
    mjcf = (
        '<mujoco>\n<compiler angle="radian" eulerseq="XYZ" inertiafromgeom="false"/>\n'
        f"<worldbody>\n{bodies}{'</body>' * joints}\n</worldbody>\n</mujoco>\n"
    )
    return mjcf, f'<robot name="chain">\n{links}</robot>\n'


def words(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
