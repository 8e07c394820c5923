"""Hostile model files for `new --from` and `compare`: none of their text may become code."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from soak.corpus import mjcf as mjcf_corpus
from soak.corpus import urdf as urdf_corpus
from soak.corpus.entry import Build, CorpusEntry
from soak.corpus.sound import MJCF, URDF

PAYLOAD = 'a"""+str(open("PWNED","w"))+"""c'
"""A text that opens a file when it is pasted between the quotes of a string."""

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
"""A model file and its attributes that hold one name, by the element with that name."""

AS_BODIES = ("no limit", "a mesh of nothing", "a free joint", "joint type ball")
"""Inputs without energies or with missing visual geometry. `new` declares bodies for them."""


def new_and_compare_entries() -> Iterator[CorpusEntry]:
    """Yield the entries of `new --from` and `compare`."""
    for name, text in TEXTS.items():
        for location, (model, *attributes) in PLACES.items():
            suffix = ".urdf" if model is URDF else ".xml"
            yield _new_entry(
                f"new/{name} in {location}",
                _with_name(model, attributes, text),
                f"model{suffix}",
                codes=(0, 3),
            )
        if "\0" not in text and "/" not in text:
            for model, suffix in ((URDF, ".urdf"), (MJCF, ".xml")):
                yield _new_entry(
                    f"new/{name} in the file's name, {suffix}",
                    model,
                    f"{text}{suffix}",
                    codes=(0, 3),
                )
    for name in ("mass nan", "mass inf", "mass -1.3", "axis 0 0 0", "spring nan", "child nothing",
                 "parent block", "joint type floating", "a DTD", "a foreign entity", "no limit",
                 "a link that mimics itself", "a mesh of nothing", "damping much"):  # fmt: skip
        old, new = (urdf_corpus.NUMBERS | urdf_corpus.ELEMENTS)[name]
        codes: tuple[int, ...] = (0,) if name in AS_BODIES else (3,)
        yield _new_entry(f"new/urdf {name}", URDF.replace(old, new, 1), "model.urdf", codes=codes)
        yield _compare_entry(f"compare/urdf {name}", URDF.replace(old, new, 1), "model.urdf")
    for name in ("timestep 0", "mass nan", "mass inf", "axis 0 0 0", "stiffness nan", "a DTD",
                 "a billion laughs", "itself to include", "a device to include", "a free joint",
                 "a joint twice", "an end tag too few", "joint type ball"):  # fmt: skip
        old, new = (mjcf_corpus.NUMBERS | mjcf_corpus.ELEMENTS)[name]
        codes = {"timestep 0": (0, 3)}.get(name, (0,) if name in AS_BODIES else (3,))
        yield _new_entry(f"new/mjcf {name}", MJCF.replace(old, new, 1), "model.xml", codes=codes)
        yield _compare_entry(f"compare/mjcf {name}", MJCF.replace(old, new, 1), "model.xml")
    for name, file in (("a folder", "@hostile"), ("nothing", "@nothing.urdf"),
                       ("another format", "@hostile/system.py"),
                       ("a device", "/dev/zero")):  # fmt: skip
        yield CorpusEntry(
            name=f"new/{name}",
            build=lambda workspace: None,
            codes=(2, 3),
            match="crosscheck",
            command=("new", "@new", "--from", file),
        )


def _with_name(model: str, attributes: list[str], text: str) -> str:
    for old, new in _ESCAPED:
        text = text.replace(old, new)
    for attribute in attributes:
        key = attribute.partition("=")[0]
        model = model.replace(attribute, f'{key}="{text}"')
    return model


def _write_model(text: str, name: str) -> Build:
    return lambda workspace: (workspace / "hostile" / name).write_text(text, "utf-8")


def _new_entry(name: str, text: str, file: str, codes: tuple[int, ...]) -> CorpusEntry:
    command = ("new", "@new", "--from", f"@hostile/{file}")
    return CorpusEntry(
        name=name,
        build=_write_model(text, file),
        command=command,
        codes=codes,
        match=r"crosscheck|model\.",
    )


def _compare_entry(name: str, text: str, file: str) -> CorpusEntry:
    sound = "@sound/mujoco.xml" if file.endswith(".xml") else "@hostile/sound.urdf"

    def build(workspace: Path) -> None:
        (workspace / "hostile" / file).write_text(text, "utf-8")
        (workspace / "hostile" / "sound.urdf").write_text(URDF, "utf-8")

    return CorpusEntry(
        name=name,
        build=build,
        command=("compare", f"@hostile/{file}", sound),
        codes=(0, 1, 2, 3) if name.endswith(AS_BODIES) else (1, 2, 3),
        match=r"model\.|of A and joint x of B",
    )
