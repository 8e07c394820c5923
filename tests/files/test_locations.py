"""Addresses: each names the bytes of one number, or is refused with file, line and remedy."""

from pathlib import Path

import pytest

from physics_crosscheck.harness.documents.elements import read_number
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.reading import SourceFile
from physics_crosscheck.harness.modelfiles.locations import find, line_of, numbers
from tests.models import written

MJCF = """<?xml version="1.0" encoding="UTF-8"?>
<!-- Trägheit: <joint name="x" stiffness="1.0"/> is no joint, nor is mass="2" a mass. -->
<mujoco model="drum > pendulum">
  <option gravity="0 0 -9.81" note='stiffness="7"'/>
  <default><joint damping="0.01"/></default>
  <worldbody>
    <body name="drum">
      <joint name="x" type="slide" stiffness = '65.0' armature="1.2e0"/>
      <inertial pos="0 0 0" mass="2.4" diaginertia="
        0.02744   0.03888
        +.02744 "/>
      <body name="Stäbchen – rod"><inertial mass="0.8" pos="-0 0 -0.3"/></body>
    </body>
    <body><inertial mass="1"/></body>
  </worldbody>
  <equality><joint name="rolling" joint1="phi" polycoef="0 5.5 0 0 0"/></equality>
  <tendon><fixed name="coupling" stiffness="38"><joint joint="x" coef="-1"/></fixed></tendon>
</mujoco>
"""
URDF = """<robot name="r">
  <link name="rod"><inertial><mass value="0.8"/><origin xyz="0 0 -0.3"/>
    <inertia ixx="0.024" iyy="0.025" izz="1e-4"/></inertial></link>
  <joint name="x"><dynamics damping="0.9" friction="0"/></joint>
  <joint name="phi"><mimic joint="x" multiplier="5.5"/></joint>
  <gazebo reference="x"><springStiffness> <!-- N/m, 48 before -->
    47.0 </springStiffness><springReference>0</springReference></gazebo>
  <gazebo reference="y"><springStiffness>1 2</springStiffness></gazebo>
</robot>
"""
PYTHON = '''"""MASS = 9 in a docstring."""
import math
from math import tau
WÖRTER = "MASS = 8"; MASS = 1.3  # MASS = 7
REST: float = -0.75
COUNT = 3
PLUS = +1_000.5
COMPUTED = MASS * 2
TWICE = 1.0
TWICE = 2.0
if COUNT:
    SOMETIMES = 1.0
ADDED = 1.0
ADDED += 1
SHARED = ALIAS = 4.0
PAIR, OTHER = 1.0, 2.0
SPACED = - 3
HEX = 0x10
YES = True
GLOBAL = 1.0

def build():
    global GLOBAL
    MASS = 5.0
    GLOBAL = 2.0
    return MASS
'''
TOML = """# stiffness = 1
engines = ["a", 'b', "gravity = [1]"]
note = \"\"\"[[spring]]
stiffness = 3\"\"\"
"quoted key".é-no = 1 # not a key
[settings]
step = 2e-3
gravity = [
  0, # gravity = 1
  0,
  -9.81, ]
[settings.mujoco]
solref = [1e-6, 0.5]
day = 1979-05-27 07:32:00
[[spring]]
joints = { x1 = 1, "x 2" = -1 }
stiffness = 38.0
[[spring]]
stiffness = 1_000
nested = { rest = [{ at = 0.5 }] }
[spring.inner]
deep = 7.5
"""
TOML = TOML.replace(".é-no", '."é-no"')

ADDRESSES = [
    ("m.xml", MJCF, {
        "joint[x]@stiffness": "65.0", "joint[x]@armature": "1.2e0", "joint[x]@coef": "-1",
        "body[drum]/joint[x]@stiffness": "65.0", "option@gravity[2]": "-9.81",
        "default/joint@damping": "0.01", "joint@damping": "0.01",
        "body[drum]/inertial@mass": "2.4", "body[drum]/inertial@diaginertia[0]": "0.02744",
        "body[drum]/inertial@diaginertia[2]": "+.02744", "inertial@diaginertia[1]": "0.03888",
        "body[drum]/body/inertial@mass": "0.8",
        "body[Stäbchen – rod]/inertial@mass": "0.8",
        "body[Stäbchen – rod]/inertial@pos[2]": "-0.3",
        "body[Stäbchen – rod]/inertial@pos[0]": "-0",
        "equality/joint[rolling]@polycoef[1]": "5.5", "fixed[coupling]@stiffness": "38",
        "tendon/fixed/joint[x]@coef": "-1", "joint[x]@armature[0]": "1.2e0",
    }),
    ("m.urdf", URDF, {
        "link[rod]/inertial/mass@value": "0.8", "mass@value": "0.8",
        "link[rod]/inertial/origin@xyz[2]": "-0.3", "link[rod]/inertial/inertia@izz": "1e-4",
        "joint[x]/dynamics@damping": "0.9", "joint[phi]/mimic@multiplier": "5.5",
        "mimic[x]@multiplier": "5.5", "gazebo[x]/springStiffness": "47.0",
        "gazebo/springReference": "0",
    }),
    ("m.py", PYTHON, {"MASS": "1.3", "REST": "-0.75", "COUNT": "3", "PLUS": "+1_000.5"}),
    ("first.py", "MASS = 1.3\n", {"MASS": "1.3"}),
    ("m.toml", TOML, {
        "settings.gravity[2]": "-9.81", "settings.step": "2e-3",
        "settings.mujoco.solref[0]": "1e-6",
        "spring[0].stiffness": "38.0", "spring[1].stiffness": "1_000",
        "spring[0].joints.x1": "1", 'spring[0].joints."x 2"': "-1",
        "spring[1].nested.rest[0].at": "0.5", "spring[1].inner.deep": "7.5",
        '"quoted key"."é-no"': "1",
    }),
]  # fmt: skip
CASES = [
    pytest.param(file, mark + text, end, address, number, id=f"{file}-{address}-{kind}")
    for file, text, places in ADDRESSES
    for address, number in places.items()
    for kind, mark, end in (("LF", "", "\n"), ("CRLF", "", "\r\n"), ("BOM", "\ufeff", "\n"))
    if not (mark and file.endswith(".toml"))  # TOML has no byte order mark
]


@pytest.mark.parametrize(("file", "text", "end", "address", "number"), CASES)
def test_address_names_the_bytes_of_its_number(
    tmp_path: Path, file: str, text: str, end: str, address: str, number: str
) -> None:
    data = text.replace("\n", end).encode()
    (tmp_path / file).write_bytes(data)
    place = find(tmp_path / file, [address])[address]
    assert place.text == number
    assert data[place.start : place.end] == number.encode()
    assert place.value == float(number)
    line = text.removeprefix("\ufeff").split("\n")[(place.line or 0) - 1]
    assert line[place.column - 1 :].startswith(number)
    assert str(place) == f"{tmp_path / file}:{place.line}"


def test_similar_texts_come_before_the_numbers() -> None:
    # Otherwise a text search would pass the test above.
    assert MJCF.index('stiffness="1.0"') < MJCF.index("stiffness = '65.0'")
    assert URDF.index("48 before") < URDF.index("47.0")
    assert PYTHON.index("MASS = 9") < PYTHON.index("MASS = 1.3")
    assert TOML.index("gravity = [1]") < TOML.index("gravity = [\n")


@pytest.mark.parametrize(("file", "text", "address", "line", "sentence"), [
    # No element matches.
    ("m.xml", MJCF, "joint[y]@stiffness", None,
     r"there is no joint\[y\]; nearest: joint\[x\], joint\[rolling\]"),
    ("m.xml", MJCF, "bodi[drum]/inertial@mass", None, r"no bodi\[drum\]; nearest: body\[drum\]"),
    ("m.xml", MJCF, "body[drum]/intertial@mass", 7,
     r"no intertial in body\[drum\]; nearest: inertial"),
    ("m.xml", MJCF, "body[drum]/joint[x]@stifness", 8, "has no stifness; it has stiffness"),
    ("m.xml", MJCF, "worldbody/inertial@mass", 6, "no inertial in worldbody; nearest: body"),
    ("m.py", PYTHON, "MAS", None, "not a name at the top level; nearest: MASS"),
    ("m.toml", TOML, "spring[2].stiffness", None, r"a number; nearest: spring\[.\]\.stiffness"),
    ("m.toml", TOML, "settings.gravity", None, r"a number; nearest: settings\.gravity\[\d\]"),
    ("m.toml", TOML, "settings.mujoco.day", 14, "does not name a number"),
    ("m.toml", TOML, "engines[0]", 2, "does not name a number"),
    # Several numbers match.
    ("m.xml", MJCF, "body/inertial@mass", 9,
     r"several numbers \(lines 9, 12, 14\); add its name.*body\[drum\]/inertial, "
     r"body\[Stäbchen – rod\]/inertial, body/inertial"),
    ("m.xml", MJCF, "inertial@mass", 9, r"\(body\[drum\]/inertial, body\[Stäb"),
    ("m.xml", MJCF, "option@gravity", 4, r"names 3 numbers; choose one, as in 'option@gravity\[0"),
    ("m.urdf", URDF, "springStiffness", 6,
     r"lines 6, 8\); add its name.*\(gazebo\[x\]/springStiffness, gazebo\[y\]/springStiffness\)"),
    ("m.urdf", URDF, "gazebo[y]/springStiffness", 8, "names 2 numbers"),
    ("m.py", PYTHON, "TWICE", 9, r"bound several times \(lines 9, 10\)"),
    ("m.py", PYTHON, "ADDED", 13, r"bound several times \(lines 13, 14\)"),
    ("m.py", PYTHON, "GLOBAL", 20, r"bound several times \(lines 20, 25\)"),
    # The value is not a number, or can't be replaced.
    ("m.xml", MJCF, "option@gravity[3]", 4, "beyond gravity: it has 3 numbers"),
    ("m.xml", MJCF, "joint[x]@type", 8, "is 'slide'; expected a number"),
    ("m.xml", MJCF, "body[drum]", 7, r"not a number; end the address with an attribute"),
    ("m.urdf", URDF, "joint[x]/dynamics", 4, "which has no text; its attributes are damping"),
    ("m.py", PYTHON, "COMPUTED", 8, "not a plain number; write 'COMPUTED = 1.5'"),
    ("m.py", PYTHON, "SOMETIMES", 12, "not a plain number"),
    ("m.py", PYTHON, "SHARED", 15, "not a plain number"),
    ("m.py", PYTHON, "PAIR", 16, "not a plain number"),
    ("m.py", PYTHON, "YES", 19, "not a plain number"),
    ("m.py", PYTHON, "build", 22, "not a plain number"),
    ("m.py", PYTHON, "math", 2, "not a plain number"),
    ("m.py", PYTHON, "tau", 3, "not a plain number"),
    ("m.py", PYTHON, "SPACED", 17, "'- 3'; expected a decimal number"),
    ("m.py", PYTHON, "HEX", 18, "'0x10'; expected a decimal number"),
    # The address is malformed.
    ("m.xml", MJCF, "joint[x]@", None, r"is not an address; write it like 'body\[rod\]"),
    ("m.xml", MJCF, "joint[x", None, "is not an address"),
    ("m.xml", MJCF, "", None, "is not an address"),
    ("m.py", PYTHON, "build.MASS", None, "is not an address; in Python use a name"),
    ("m.toml", TOML, "settings.", None, r"is not an address; write it like 'spring\[0\]\."),
    ("m.toml", TOML, "[0]", None, "is not an address"),
    ("m.toml", TOML, "spring 0", None, "is not an address"),
    # The file can't be read.
    ("m.xml", "<a>\n<b></a>", "b@x", 2, "not XML at column 6: mismatched tag"),
    ("m.py", "A = 1\nB = (", "A", 2, "not Python"),
    ("m.toml", "a = = 1", "a", None, "not TOML"),
    ("m.json", "{}", "a", None, r"can be located in \.xml, \.urdf, \.sdf, \.py, \.toml files"),
    ("m.xml", '<!DOCTYPE a [<!ENTITY k "1">]>\n<a b="&k;"/>', "a@b", 1, "declares entities"),
    ("m.xml", '<!DOCTYPE a SYSTEM "a.dtd">\n<a b="1"/>', "a@b", 1, "declares entities or a DTD"),
    ("m.xml", '<?xml version="1.0" encoding="latin-1"?>\n<a b="1"/>', "a@b", 1, "as UTF-8"),
    ("m.py", "# coding: latin-1\nA = 1", "A", 1, "save the file as UTF-8"),
    # The bytes differ from the parsed value.
    ("m.xml", '<a b="4&#55;.0"/>', "a@b", 1, "written with a reference"),
    ("m.xml", "<a><![CDATA[47]]></a>", "a", 1, "written with a reference or CDATA"),
    ("m.xml", "<a>4<!-- and -->7</a>", "a", 1, "names 2 numbers"),
    ("m.xml", '<a b="1_0"/>', "a@b", 1, "is '1_0'; expected a number"),
    ("m.xml", '<a b="٣"/>', "a@b", 1, "is '٣'; expected a decimal number"),
    ("m.xml", '<a b="inf"/>', "a@b", 1, "is 'inf'; expected a decimal number"),
    ("m.xml", '<a b=""/>', "a@b", None, "names 0 numbers"),
])  # fmt: skip
def test_address_without_a_single_number_is_refused(
    tmp_path: Path, file: str, text: str, address: str, line: int | None, sentence: str
) -> None:
    path = tmp_path / file
    path.write_bytes(text.encode())
    with pytest.raises(LocationError, match=sentence) as error:
        find(path, [address])
    where = f"{path}: " if line is None else f"{path}:{line}: "
    assert str(error.value).startswith(where)


def test_binary_or_missing_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "m.xml").write_bytes(b'<a b="\xe9"/>')
    with pytest.raises(LocationError, match=r"m\.xml: byte 6 is not UTF-8"):
        find(tmp_path / "m.xml", ["a@b"])
    with pytest.raises(LocationError, match=r"gone\.xml: can't be read: No such file"):
        find(tmp_path / "gone.xml", ["a@b"])


def test_bytes_that_differ_from_the_parsed_value_are_refused(tmp_path: Path) -> None:
    source = SourceFile(tmp_path / "m.xml", b'<a b="1.5"/>')
    assert read_number(source, (6, 9), 1.5, "a@b").text == "1.5"
    with pytest.raises(LocationError, match=r"m\.xml:1: 'a@b' is written '1\.5' but read as 2\.5"):
        read_number(source, (6, 9), 2.5, "a@b")


MECHANICS = r"(joint|inertial|mass)@\w+|springStiffness"


def test_listed_addresses_locate_their_numbers(tmp_path: Path) -> None:
    file = tmp_path / "model.xml"
    file.write_text(
        '<mujoco><geom name="g" size="1 2"/><body name="a"><joint name="x" damping="0.1"'
        ' axis="0 0 1"/><inertial mass="2" pos="1 2 3"/></body><body name="b">'
        '<inertial mass="3"/></body></mujoco>'
    )
    listed = numbers(file, r"(joint|inertial)@\w+")
    assert listed == (
        "joint[x]@damping",
        "joint[x]@axis[0]",
        "joint[x]@axis[1]",
        "joint[x]@axis[2]",
        "body[a]/inertial@mass",
        "body[a]/inertial@pos[0]",
        "body[a]/inertial@pos[1]",
        "body[a]/inertial@pos[2]",
        "body[b]/inertial@mass",
    )
    places = find(file, listed)
    assert [place.value for place in places.values()] == [0.1, 0, 0, 1, 2, 1, 2, 3, 3]


def test_numbers_without_a_unique_address_are_left_out(tmp_path: Path) -> None:
    file = tmp_path / "model.urdf"
    file.write_text(
        '<robot><gazebo reference="x"><springStiffness>4</springStiffness></gazebo>'
        '<link><mass value="1"/></link><link><mass value="2"/></link></robot>'
    )
    assert numbers(file, MECHANICS) == ("gazebo[x]/springStiffness",)


def test_numbers_of_python_are_names_at_the_top_level(tmp_path: Path) -> None:
    file = tmp_path / "space.py"
    file.write_text("A = 1.5\nB: float = -2\nC = A * 2\n\ndef f():\n    D = 3\n")
    assert numbers(file, "unused") == ("A", "B")


@pytest.mark.parametrize(
    "address", ["a" * 9999, f"option@gravity[{'9' * 4000}]", f"body[{'b' * 9999}]"]
)
def test_long_address_is_abbreviated_in_the_message(tmp_path: Path, address: str) -> None:
    file = tmp_path / "m.xml"
    file.write_text(MJCF.replace('"drum"', f'"{"d" * 9999}"'), "utf-8")
    with pytest.raises(LocationError) as error:
        find(file, [address])
    assert len(str(error.value)) < 1000 + len(str(file))


SDF = """<sdf version="1.6"><model name="m">
<link name="a"><pose>0 0 1 0 0 0</pose><inertial><pose> 0.1 0.2
  -0.3 0 0 0</pose><mass>2.5</mass></inertial></link>
<link name="3"><mass>1</mass></link></model></sdf>
"""


@pytest.mark.parametrize(("address", "line", "value"), [
    ("link[a]/pose[2]", 2, 1.0), ("link[a]/inertial/pose[1]", 2, 0.2),
    ("link[a]/inertial/pose[2]", 3, -0.3), ("link[a]/inertial/mass", 3, 2.5),
    ("link[3]/mass", 4, 1.0), ("link[3]/mass[0]", 4, 1.0),
])  # fmt: skip
def test_numbers_of_a_list_in_an_element_have_addresses(
    tmp_path: Path, address: str, line: int, value: float
) -> None:
    file = written(tmp_path, "m.sdf", SDF)
    place = find(file, [address])[address]
    assert (place.line, place.value) == (line, value)


def test_index_beyond_a_list_is_refused_and_all_numbers_are_listed(tmp_path: Path) -> None:
    file = written(tmp_path, "m.sdf", SDF)
    with pytest.raises(LocationError, match="is beyond <pose>: it has 6 numbers"):
        find(file, ["link[a]/pose[6]"])
    listed = numbers(file, "pose|mass")
    assert "link[a]/inertial/pose[2]" in listed
    assert len(find(file, listed)) == 14


COMMENTED = """<mujoco>
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
CALLS = """
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
TABLES = """
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
        ("m.xml", COMMENTED, "body/joint[a]", 9),
        ("m.xml", COMMENTED, "body/joint[a]@damping", 10),
        ("m.xml", COMMENTED, "body/joint[a]@armature", 9),
        ("m.xml", COMMENTED, "equality/joint[a]", 7),
        ("m.xml", COMMENTED, "option@gravity", 5),
        ("m.xml", COMMENTED, "option@wind", 3),
        ("m.xml", COMMENTED, "body/joint[b]", None),
        ("m.xml", COMMENTED, "no address [", None),
        ("m.xml", "<mujoco>", "mujoco", None),
        ("m.urdf", "<robot>\n<link name='a'/>\n</robot>", "robot/link[a]", 2),
        ("m.py", CALLS, "MASS", 3),
        ("m.py", CALLS, "LENGTH", None),
        ("m.py", CALLS, "PinJoint()", 11),
        ("m.py", CALLS, "GearJoint()", None),
        ("m.py", CALLS, "Space().damping", 12),
        ("m.py", CALLS, "Space().gravity", 14),
        ("m.py", CALLS, "Space().iterations", None),
        ("m.py", "def", "MASS", None),
        ("m.toml", TABLES, "settings.step", 5),
        ("m.toml", TABLES, "settings.one.motors", 7),
        ("m.toml", TABLES, "settings.one.gravity", 8),
        ("m.toml", TABLES, "settings.gravity", None),
        ("m.toml", TABLES, "settings[", None),
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
