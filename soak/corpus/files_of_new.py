"""Hostile model files for `new --from` and `compare`: nothing of them may become code."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from soak.corpus import mjcf as mjcf_room
from soak.corpus import urdf as urdf_room
from soak.corpus.entry import Build, Entry
from soak.corpus.sound import MJCF, URDF

PAYLOAD = 'a"""+str(open("PWNED","w"))+"""c'
"""What would open a file, were it pasted between the quotes of a text."""

TEXTS = {
    "three quotes": PAYLOAD,
    "one quote": 'a"+str(open("PWNED","w"))+"c',
    "an apostrophe": "a'+str(open('PWNED','w'))+'c",
    "a brace": '{open("PWNED","w")}',
    "a backslash": "a\\",
    "a line": 'a\nopen("PWNED","w")\n',
    "a template": '{{ open("PWNED","w") }}',
    "a number sign": 'a # " b',
    "a null's name": "a\\0b",
    "another script": "\u202eknil \u0416",
    "a keyword": "lambda",
    "a dunder": "__import__",
    "the name of a builtin": "open",
    "the name of the system": "system",
}

_ESCAPED = (("&", "&amp;"), ("<", "&lt;"), ('"', "&quot;"), ("\n", "&#10;"))

PLACES = {
    "link": (URDF, 'name="block"', 'link="block"'),
    "joint": (URDF, 'name="x"', 'reference="x"'),
    "robot": (
        URDF,
        '<robot name="oscillator"',
    ),
    "body": (MJCF, 'name="block"'),
    "slide": (MJCF, 'name="x"'),
    "model": (MJCF, 'model="oscillator"'),
}
"""A text, and the attributes in which the same name stands."""

AS_BODIES = ("no limit", "a mesh of nothing", "a free joint", "joint type ball")
"""What no energies describe, or no visual geometry needs: `new` declares bodies."""


def files_of_new() -> Iterator[Entry]:
    """Every entry of `new --from`, and of `compare`."""
    for name, text in TEXTS.items():
        for place, (model, *attributes) in PLACES.items():
            suffix = ".urdf" if model is URDF else ".xml"
            yield _new(f"new/{name} in {place}", _named(model, attributes, text), f"model{suffix}",
                       codes=(0, 3))  # fmt: skip
        if "\0" not in text and "/" not in text:
            for model, suffix in ((URDF, ".urdf"), (MJCF, ".xml")):
                yield _new(f"new/{name} in the file's name, {suffix}", model, f"{text}{suffix}",
                           codes=(0, 3))  # fmt: skip
    for name in ("mass nan", "mass inf", "mass -1.3", "axis 0 0 0", "spring nan", "child nothing",
                 "parent block", "joint type floating", "a DTD", "a foreign entity", "no limit",
                 "a link that mimics itself", "a mesh of nothing", "damping much"):  # fmt: skip
        old, new = (urdf_room.NUMBERS | urdf_room.ELEMENTS)[name]
        codes: tuple[int, ...] = (0,) if name in AS_BODIES else (3,)
        yield _new(f"new/urdf {name}", URDF.replace(old, new, 1), "model.urdf", codes=codes)
        yield _compare(f"compare/urdf {name}", URDF.replace(old, new, 1), "model.urdf")
    for name in ("timestep 0", "mass nan", "mass inf", "axis 0 0 0", "stiffness nan", "a DTD",
                 "a billion laughs", "itself to include", "a device to include", "a free joint",
                 "a joint twice", "an end tag too few", "joint type ball"):  # fmt: skip
        old, new = (mjcf_room.NUMBERS | mjcf_room.ELEMENTS)[name]
        codes = {"timestep 0": (0, 3)}.get(name, (0,) if name in AS_BODIES else (3,))
        yield _new(f"new/mjcf {name}", MJCF.replace(old, new, 1), "model.xml", codes=codes)
        yield _compare(f"compare/mjcf {name}", MJCF.replace(old, new, 1), "model.xml")
    for name, file in (("a folder", "@hostile"), ("nothing", "@nothing.urdf"),
                       ("another format", "@hostile/system.py"),
                       ("a device", "/dev/zero")):  # fmt: skip
        yield Entry(name=f"new/{name}", build=lambda place: None, codes=(2, 3), says="crosscheck",
                    command=("new", "@new", "--from", file))  # fmt: skip


def _named(model: str, attributes: list[str], text: str) -> str:
    for old, new in _ESCAPED:
        text = text.replace(old, new)
    for attribute in attributes:
        key = attribute.partition("=")[0]
        model = model.replace(attribute, f'{key}="{text}"')
    return model


def _file(text: str, name: str) -> Build:
    return lambda place: (place / "hostile" / name).write_text(text, "utf-8")


def _new(name: str, text: str, file: str, codes: tuple[int, ...]) -> Entry:
    command = ("new", "@new", "--from", f"@hostile/{file}")
    return Entry(name=name, build=_file(text, file), command=command, codes=codes,
                 says=r"crosscheck|model\.")  # fmt: skip


def _compare(name: str, text: str, file: str) -> Entry:
    sound = "@sound/mujoco.xml" if file.endswith(".xml") else "@hostile/sound.urdf"

    def build(place: Path) -> None:
        (place / "hostile" / file).write_text(text, "utf-8")
        (place / "hostile" / "sound.urdf").write_text(URDF, "utf-8")

    return Entry(name=name, build=build, command=("compare", f"@hostile/{file}", sound),
                 codes=(0, 1, 2, 3) if name.endswith(AS_BODIES) else (1, 2, 3),
                 says=r"model\.|of A and joint x of B")  # fmt: skip
