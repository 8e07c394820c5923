"""Hostile MJCF files."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from soak.corpus.entry import CorpusEntry, chain_builds, replace_text, write_file
from soak.corpus.odd_files import odd_files
from soak.corpus.sound import MJCF

FILE = "mujoco.xml"
_NAMED = r"mujoco\.xml"
_STEP = 'timestep="0.002"'
_MASS = 'mass="1.3"'
_JOINT = '<joint name="x" type="slide" axis="1 0 0" stiffness="47" damping="0.9"/>'
_OPTION = '<option timestep="0.002" integrator="Euler" gravity="0 0 -9.81"/>'
_LAUGHS = (
    '<!DOCTYPE l [<!ENTITY a "ha">'
    + "".join(f'<!ENTITY {chr(code + 1)} "{f"&{chr(code)};" * 10}">' for code in range(97, 105))
    + "]>"
)  # fmt: skip

NUMBERS = {
    f"{what} {value or 'nothing'}": (old, new.format(value))
    for what, old, new, values in (
        ("timestep", _STEP, 'timestep="{}"',
         ("0", "-0.002", "nan", "inf", "1e-30", "1e30", "3", "", "two", "0.002 0.002", "9" * 400)),
        ("mass", _MASS, 'mass="{}"', ("nan", "inf", "-1.3", "0", "", "1e999", "one", "1e-320")),
        ("inertia", 'diaginertia="1 1 1"', 'diaginertia="{}"',
         ("nan 1 1", "-1 1 1", "0 0 0", "1 1", "1 1 9", "")),
        ("gravity", 'gravity="0 0 -9.81"', 'gravity="{}"', ("nan 0 0", "0 0", "", "inf 0 0")),
        ("axis", 'axis="1 0 0"', 'axis="{}"', ("0 0 0", "nan 0 0", "", "1 0", "1e-300 0 0")),
        ("stiffness", 'stiffness="47"', 'stiffness="{}"', ("nan", "inf", "-47", "", "1e300")),
        ("damping", 'damping="0.9"', 'damping="{}"', ("nan", "inf", "-0.9", "1e300")),
        ("position", 'pos="0 0 1"', 'pos="{}"', ("nan 0 0", "0 0", "a b c")),
        ("integrator", 'integrator="Euler"', 'integrator="{}"', ("Verlet", "", "Euler RK4")),
        ("joint type", 'type="slide"', 'type="{}"', ("ball", "free", "hinge", "", "screw")),
        ("joint name", 'name="x" type', 'name="{}" type', ("", "y", "x y", "world", "../x")),
    )
    for value in values
}  # fmt: skip
"""Numbers and names that do not describe the oscillator. Gravity acts across its motion."""

ELEMENTS = {
    "a second root": ("</mujoco>\n", "</mujoco>\n<mujoco/>\n"),
    "no root": ("<mujoco model", "<robot model"),
    "an end tag too few": ("</body>", ""),
    "an unknown element": ("<worldbody>", "<worldbody><wheel/>"),
    "an unknown attribute": ("<body ", '<body colour="red" '),
    "an attribute twice": ("<body ", '<body name="a" '),
    "a DTD": ("<mujoco model", "<!DOCTYPE mujoco>\n<mujoco model"),
    "entities": ("<mujoco model", '<!DOCTYPE m [<!ENTITY a "1.3">]>\n<mujoco model'),
    "a billion laughs": ("<mujoco model", f"{_LAUGHS}\n<mujoco model"),
    "a foreign entity": (
        "<mujoco model", '<!DOCTYPE m [<!ENTITY a SYSTEM "file:///etc/passwd">]>\n<mujoco model'
    ),
    "a reference to nothing": (_MASS, 'mass="&m;"'),
    "no file to include": ("<worldbody>", '<include file="nothing.xml"/><worldbody>'),
    "itself to include": ("<worldbody>", '<include file="mujoco.xml"/><worldbody>'),
    "a system's file to include": ("<worldbody>", '<include file="/etc/passwd"/><worldbody>'),
    "a folder to include": ("<worldbody>", '<include file="."/><worldbody>'),
    "a device to include": ("<worldbody>", '<include file="/dev/zero"/><worldbody>'),
    "a second joint": (_JOINT, f'{_JOINT}<joint name="y" type="slide" axis="0 0 1"/>'),
    "a joint twice": (_JOINT, f"{_JOINT}{_JOINT}"),
    "no joint": (_JOINT, ""),
    "a free joint": (_JOINT, "<freejoint/>"),
    "no body": ("<body", "<frame"),
    "no mass": ('<inertial pos="0 0 0" mass="1.3" diaginertia="1 1 1"/>', ""),
    "an actuator": ("</mujoco>", '<actuator><motor joint="x"/></actuator></mujoco>'),
    "a plugin": ("<worldbody>", '<extension><plugin plugin="a.b"/></extension><worldbody>'),
    "a mesh of nothing": ("<worldbody>", '<asset><mesh file="a.stl"/></asset><worldbody>'),
    "a texture that is a device": (
        "<worldbody>", '<asset><texture type="2d" file="/dev/zero"/></asset><worldbody>'
    ),
    "a size that is huge": (_OPTION, f'{_OPTION}<size memory="900G"/>'),
    "a keyframe of nan": ("</mujoco>", '<keyframe><key qpos="nan"/></keyframe></mujoco>'),
    "an equality with nothing": (
        "</mujoco>", '<equality><joint joint1="x" joint2="y"/></equality></mujoco>'
    ),
    "an equality that holds it": (
        "</mujoco>", '<equality><joint joint1="x"/></equality></mujoco>'
    ),
    "a limit that is turned round": ("axis=", 'limited="true" range="1 -1" axis='),
    "a limit within the motion": ("axis=", 'limited="true" range="-0.01 0.01" axis='),
    "dry friction": ("axis=", 'frictionloss="0.1" axis='),
    "a stop in the way": (
        "    </body>\n  </worldbody>",
        '<geom size="0.1"/></body><geom type="box" size="1 1 1" pos="0 0 1"/></worldbody>',
    ),
    "bytes that are no text": (_MASS, 'mass="1.3\udcff"'),
    "a name of 100000 characters": ('name="block"', f'name="{"b" * 100_000}"'),
    "a name that is markup": ('name="block"', 'name="&lt;script&gt;alert(1)&lt;/script&gt;"'),
    "10000 bodies": ("</worldbody>", "<body/>" * 10_000 + "</worldbody>"),
}  # fmt: skip

_HARMLESS = ("10000 bodies", "a keyframe of nan", "a size that is huge", "a DTD")
"""Inputs that some engines run. The motion of such an engine decides the verdict."""


_AMBIGUOUS = ("gravity 0 0", "gravity nothing", "integrator Euler RK4", "timestep nothing",
              "stiffness nothing", "axis nothing", "joint type nothing", "joint name world",
              "axis 1 0", "axis 1e-300 0 0", "inertia nothing")  # fmt: skip
"""Inputs that may agree. Gravity affects a slide along x only if it is not a number."""

_entry = partial(CorpusEntry, match=_NAMED, codes=(1, 3))


def mjcf_entries() -> Iterator[CorpusEntry]:
    """Yield the MJCF entries."""
    for name, change in (*NUMBERS.items(), *ELEMENTS.items()):
        codes = (0, 1, 3) if name in (*_AMBIGUOUS, *_HARMLESS) else (1, 3)
        match = "" if name in _HARMLESS else _NAMED
        yield _entry(f"mjcf/{name}", replace_text(FILE, change), match=match, codes=codes)
    deep = MJCF.replace("<body name", "<body>" * 5000 + "<body name", 1)
    deep = deep.replace("</worldbody>", "</body>" * 5000 + "</worldbody>", 1)
    bodies = write_file(FILE, deep)
    yield _entry("mjcf/5000 bodies in bodies", bodies, match="", codes=(0, 1, 3))
    declared = write_file(FILE, f'<?xml version="1.0" encoding="UTF-7"?>\n{MJCF}')
    yield _entry("mjcf/another encoding", declared, match="")
    yield _entry("mjcf/an include within an include", chain_builds(
        replace_text(FILE, ("<worldbody>", '<include file="other.xml"/><worldbody>')),
        write_file("other.xml", '<mujocoinclude><include file="other.xml"/></mujocoinclude>'),
        write_file("other.xml.toml", 'engines = ["mujoco"]\n'),
    ))  # fmt: skip
    for name, build in odd_files(FILE):
        codes = (0, 1, 3) if name.startswith("UTF") else (1, 3)
        yield _entry(f"mjcf/{name}", build, codes=codes)
