"""Hostile URDF files for both engines that read them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from soak.corpus.entry import CorpusEntry, replace_text, write_file
from soak.corpus.odd_files import odd_files
from soak.corpus.sound import URDF

FILE = "robot.urdf"
_NAMED = r"robot\.urdf"
_MASS = '<mass value="1.3"/>'
_LIMIT = '<limit lower="-100" upper="100" effort="1000" velocity="100"/>'
_JOINT = '<joint name="x" type="prismatic">'

NUMBERS = {
    f"{what} {value or 'nothing'}": (old, new.format(value))
    for what, old, new, values in (
        ("mass", _MASS, '<mass value="{}"/>',
         ("nan", "inf", "-1.3", "0", "", "1e999", "one", "9" * 400)),
        ("inertia", '<mass value="1.3"/>\n    <inertia ixx="1"',
         '<mass value="1.3"/>\n    <inertia ixx="{}"', ("nan", "-1", "one", "")),
        ("axis", '<axis xyz="1 0 0"/>', '<axis xyz="{}"/>',
         ("0 0 0", "nan 0 0", "1 0", "", "a b c")),
        ("origin", '<origin xyz="0 0 1"/>', '<origin xyz="{}"/>', ("nan 0 0", "0 0", "a b c")),
        ("damping", 'damping="0.9"', 'damping="{}"', ("nan", "inf", "-0.9", "", "much")),
        ("friction", 'friction="0"', 'friction="{}"', ("0.5", "nan", "some")),
        ("joint type", 'type="prismatic"', 'type="{}"',
         ("floating", "planar", "fixed", "revolute", "", "screw")),
        ("joint name", 'name="x" type', 'name="{}" type', ("", "y", "x y")),
        ("spring", "<springStiffness>47.0<", "<springStiffness>{}<",
         ("nan", "inf", "", "stiff", "47 47", "-47")),
        ("spring of", '<gazebo reference="x">', '<gazebo reference="{}">', ("", "y")),
        ("child", '<child link="block"/>', '<child link="{}"/>', ("", "ground", "nothing")),
        ("parent", '<parent link="ground"/>', '<parent link="{}"/>', ("", "block", "nothing")),
        ("lower limit", 'lower="-100"', 'lower="{}"', ("nan", "100", "low", "0.05")),
    )
    for value in values
}  # fmt: skip

ELEMENTS = {
    "a second root": ("</robot>\n", "</robot>\n<robot/>\n"),
    "another root": ('<robot name="oscillator">', '<sdf name="oscillator">'),
    "an end tag too few": ("</link>", ""),
    "a DTD": ("<robot name", "<!DOCTYPE robot>\n<robot name"),
    "entities": ("<robot name", '<!DOCTYPE r [<!ENTITY a "1.3">]>\n<robot name'),
    "a foreign entity": (
        "<robot name", '<!DOCTYPE r [<!ENTITY a SYSTEM "file:///etc/passwd">]>\n<robot name'
    ),
    "no inertial": (f'<inertial><origin xyz="0 0 0"/>{_MASS}', f"<inertia><origin/>{_MASS}"),
    "no limit": (_LIMIT, ""),
    "limits of nothing": (_LIMIT, '<limit lower="0" upper="0" effort="1" velocity="1"/>'),
    "limits turned round": (_LIMIT, '<limit lower="1" upper="-1" effort="1" velocity="1"/>'),
    "a joint twice": (
        _JOINT, f'{_JOINT}<parent link="ground"/><child link="block"/></joint>{_JOINT}'
    ),
    "a link twice": ('<link name="ground">', '<link name="block"/><link name="ground">'),
    "a link that mimics itself": (_JOINT, f'{_JOINT}<mimic joint="x"/>'),
    "a mimic of nothing": (_JOINT, f'{_JOINT}<mimic joint="y"/>'),
    "a mimic by a text": (_JOINT, f'{_JOINT}<mimic joint="x" multiplier="two"/>'),
    "a mesh of nothing": (
        '<link name="block">',
        '<link name="block"><visual><geometry><mesh filename="a.stl"/></geometry></visual>',
    ),
    "a mesh far away": (
        '<link name="block">',
        '<link name="block"><collision><geometry><mesh filename="http://127.0.0.1:9/a.stl"/>'
        "</geometry></collision>",
    ),
    "a transmission": ("</robot>", "<transmission/></robot>"),
    "a reference in a number": (_MASS, '<mass value="&#49;.3"/>'),
    "bytes that are no text": (_MASS, '<mass value="1.3\udcff"/>'),
    "a name of 100000 characters": ('<child link="block"/>', f'<child link="{"b" * 100_000}"/>'),
}  # fmt: skip

_HARMLESS = ("a transmission", "a reference in a number", "mass 1e999", "origin 0 0",
        "a mesh of nothing", "a mesh far away", "lower limit 100", "limits turned round",
        "limits of nothing", "joint type revolute", "damping nothing", "inertia nothing",
        "axis nothing", "axis 1 0", "origin nan 0 0", "origin a b c", "a second root",
        "inertia nan", "inertia -1", "inertia one", "no limit", "lower limit nan",
        "lower limit low")  # fmt: skip
"""Inputs that an engine may run: they do not affect the slide, or a remark reports them."""


_entry = partial(CorpusEntry, model=FILE)


def urdf_entries() -> Iterator[CorpusEntry]:
    """Yield the URDF entries."""
    for name, change in (*NUMBERS.items(), *ELEMENTS.items()):
        match, codes = ("", (0, 1, 3)) if name in _HARMLESS else (_NAMED, (1, 3))
        yield _entry(f"urdf/{name}", replace_text(FILE, change), codes=codes, match=match)
    deep = URDF.replace("</robot>", "<a>" * 5000 + "</a>" * 5000 + "</robot>")
    yield _entry("urdf/5000 elements deep", write_file(FILE, deep), codes=(0, 1, 3))
    for name, build in odd_files(FILE):
        codes = (0, 1, 3) if name.startswith("UTF") else (1, 3)
        yield _entry(f"urdf/{name}", build, match=_NAMED, codes=codes)
