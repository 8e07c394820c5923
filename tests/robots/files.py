"""URDFs written by hand."""

from pathlib import Path

from physics_crosscheck.harness.modelfiles.robot import Robot
from physics_crosscheck.harness.modelfiles.urdf.read import read_urdf_robot
from physics_crosscheck.reference.mechanism.tree import Tree, TreeLink

BODY = (
    '<inertial><origin xyz="0 0 -0.5"/><mass value="2"/>'
    '<inertia ixx="0.3" ixy="0" ixz="0" iyy="0.3" iyz="0" izz="0.1"/></inertial>'
)


def link(name: str, inner: str = BODY) -> str:
    return f'<link name="{name}">{inner}</link>'


def joint(name: str, parent: str, child: str, inner: str = "", kind: str = "continuous") -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{inner}</joint>'


def inertial(mass: str, moments: str, products: str = "0 0 0", origin: str = "") -> str:
    xx, yy, zz = moments.split()
    xy, xz, yz = products.split()
    return (
        f'<inertial>{origin}<mass value="{mass}"/><inertia ixx="{xx}" ixy="{xy}" ixz="{xz}"'
        f' iyy="{yy}" iyz="{yz}" izz="{zz}"/></inertial>'
    )


def read(folder: Path, *lines: str, floating: bool | None = False) -> Robot:
    """Read a robot with these lines; the first is the file's second."""
    return read_text(
        folder, "\n".join(['<robot name="written">', *lines, "</robot>"]), floating=floating
    )


def read_text(folder: Path, text: str | bytes, *, floating: bool | None = False) -> Robot:
    path = folder / "robot.urdf"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_urdf_robot(path, floating=floating)


def tree_of(robot: Robot) -> Tree:
    assert [str(one) for one in robot.obstacles] == []
    assert robot.tree is not None
    return robot.tree


def last(robot: Robot) -> TreeLink:
    return tree_of(robot).links[-1]


def left_out(robot: Robot) -> dict[str, tuple[str, ...]]:
    """Return the elements that were left out, and where."""
    assert all(one.count >= len(one.where) for one in robot.left_out)
    return {one.what: one.where for one in robot.left_out}


def problems(robot: Robot) -> list[tuple[int, str]]:
    assert (robot.tree is None) == bool(robot.obstacles)
    return [(one.line, one.sentence) for one in robot.obstacles]


ARM = "\n".join([
    '<robot name="swing">', link("ground"), link("rod"),
    joint("hinge", "ground", "rod", '<axis xyz="0 1 0"/>'), "</robot>",
])  # fmt: skip
"""A rod of 2 kg on a hinge, with its center 0.5 m from it."""

TIP = link(
    "tip", BODY.replace('mass value="2"', 'mass value="0"').replace('iyy="0.3"', 'iyy="0.35"')
)
TIPPED = ARM.replace("</robot>", f"{TIP}{joint('weld', 'rod', 'tip', kind='fixed')}</robot>")
"""MuJoCo drops the inertia of the massless link."""

LAMP = """<mujoco model="lamp"><worldbody><body name="rod">
<joint name="hinge" axis="0 1 0"/><inertial mass="2" pos="0 0 -0.5" diaginertia="0.3 0.3 0.1"/>
</body></worldbody></mujoco>
"""

UNLIMITED = """<robot name="unlimited"><link name="ground"/><link name="arm"><inertial>
<origin xyz="0 0 -0.3"/><mass value="0.7"/><inertia ixx="0.01" iyy="0.02" izz="0.015" ixy="0"
ixz="0" iyz="0"/></inertial></link><joint name="j" type="revolute"><parent link="ground"/>
<child link="arm"/><axis xyz="0 1 0"/></joint></robot>"""
"""A revolute joint without `<limit>`, which Pinocchio refuses."""

ADRIFT = """<robot name="adrift">
<link name="hub"><inertial><origin xyz="0.1 -0.2 0.05" rpy="0.3 0.2 0.1"/><mass value="2"/>
<inertia ixx="0.05" iyy="0.06" izz="0.07" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="arm"><inertial><origin xyz="0 0 -0.3"/><mass value="0.7"/>
<inertia ixx="0.01" iyy="0.02" izz="0.015" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hub" type="continuous"><parent link="hub"/><child link="arm"/>
<origin xyz="0.1 0 0.2" rpy="0.5 0 0"/><axis xyz="0 1 0"/><dynamics damping="0.1"/></joint></robot>
"""
"""A floating root whose center of mass is off its origin, and whose inertia is turned."""
