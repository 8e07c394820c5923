"""Lines of addresses; comments and similar texts are ignored."""

from pathlib import Path

import pytest

from physics_crosscheck.harness.modelfiles.locations import line_of

MJCF = """<mujoco>
  <!-- <joint name="a" armature="1"/> <option gravity="0 0 -1"/> -->
  <option timestep="0.001"/>
  <option
    gravity="0 0 -9.81"/>
  <default><joint damping="1"/></default>
  <equality><joint name="a" joint1="a"/></equality>
  <worldbody>
    <body name="arm"><frame><joint name="a"
        damping="2"/></frame></body>
  </worldbody>
</mujoco>
"""
PYTHON = """
# PinJoint() and space.damping = 1
MASS = 1.0
text = "space.damping = 2"

def build():
    spring = lib.DampedSpring(1)
    spring.damping = 3
    space = lib.Space(PinJoint)
    joint = (
        lib.PinJoint(2))
    space.damping = (
        4)
    given.gravity = 5
"""
TOML = """
text = "gravity = 1"
# gravity = 2
[settings]
step = 0.1
[settings.one]
motors = true
gravity = [0,
    0, 3]
"""


@pytest.mark.parametrize(
    ("name", "text", "address", "line"),
    [
        ("m.xml", MJCF, "body/joint[a]", 9),
        ("m.xml", MJCF, "body/joint[a]@damping", 10),
        ("m.xml", MJCF, "body/joint[a]@armature", 9),
        ("m.xml", MJCF, "equality/joint[a]", 7),
        ("m.xml", MJCF, "option@gravity", 5),
        ("m.xml", MJCF, "option@wind", 3),
        ("m.xml", MJCF, "body/joint[b]", None),
        ("m.xml", MJCF, "no address [", None),
        ("m.xml", "<mujoco>", "mujoco", None),
        ("m.urdf", "<robot>\n<link name='a'/>\n</robot>", "robot/link[a]", 2),
        ("m.py", PYTHON, "MASS", 3),
        ("m.py", PYTHON, "LENGTH", None),
        ("m.py", PYTHON, "PinJoint()", 11),
        ("m.py", PYTHON, "GearJoint()", None),
        ("m.py", PYTHON, "Space().damping", 12),
        ("m.py", PYTHON, "Space().gravity", 14),
        ("m.py", PYTHON, "Space().iterations", None),
        ("m.py", "def", "MASS", None),
        ("m.toml", TOML, "settings.step", 5),
        ("m.toml", TOML, "settings.one.motors", 7),
        ("m.toml", TOML, "settings.one.gravity", 8),
        ("m.toml", TOML, "settings.gravity", None),
        ("m.toml", TOML, "settings[", None),
        ("m.skel", "<skel/>", "skel", None),
    ],
)
def test_line_of_an_address(
    name: str, text: str, address: str, line: int | None, tmp_path: Path
) -> None:
    file = tmp_path / name
    file.write_text(text)
    assert line_of(file, address) == line


def test_missing_file_has_no_line(tmp_path: Path) -> None:
    assert line_of(tmp_path / "m.xml", "option") is None
