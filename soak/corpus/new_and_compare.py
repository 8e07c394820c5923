"""Hostile model files for `new --from` and `compare`: none of their text may become code."""

from __future__ import annotations

from collections.abc import Iterator

from soak.corpus import mjcf as mjcf_corpus
from soak.corpus import urdf as urdf_corpus
from soak.corpus.entry import CorpusEntry, chain_builds, write_file
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

_SUFFIX = {URDF: ".urdf", MJCF: ".xml"}
_ESCAPED = (("&", "&amp;"), ("<", "&lt;"), ('"', "&quot;"), ("\n", "&#10;"))

PLACES = {
    "link": (URDF, 'name="block"', 'link="block"'),
    "joint": (URDF, 'name="x"', 'reference="x"'),
    "robot": (URDF, '<robot name="oscillator"'),
    "body": (MJCF, 'name="block"'),
    "slide": (MJCF, 'name="x"'),
    "model": (MJCF, 'model="oscillator"'),
}
"""A model file and its attributes that hold one name, by the element with that name."""

AS_BODIES = ("no limit", "a mesh of nothing", "a free joint", "joint type ball")
"""Inputs without energies or with missing visual geometry. `new` declares bodies for them."""


_FAULTS = (
    ("urdf", URDF, urdf_corpus.NUMBERS | urdf_corpus.ELEMENTS,
     ("mass nan", "mass inf", "mass -1.3", "axis 0 0 0", "spring nan", "child nothing",
      "parent block", "joint type floating", "a DTD", "a foreign entity", "no limit",
      "a link that mimics itself", "a mesh of nothing", "damping much")),
    ("mjcf", MJCF, mjcf_corpus.NUMBERS | mjcf_corpus.ELEMENTS,
     ("timestep 0", "mass nan", "mass inf", "axis 0 0 0", "stiffness nan", "a DTD",
      "a billion laughs", "itself to include", "a device to include", "a free joint",
      "a joint twice", "an end tag too few", "joint type ball")),
)  # fmt: skip
"""Format, sound model, changes, and those of them that both commands read."""


def new_and_compare_entries() -> Iterator[CorpusEntry]:
    """Yield the entries of `new --from` and `compare`."""
    for name, text in TEXTS.items():
        for location, (model, *attributes) in PLACES.items():
            named = _with_name(model, attributes, text)
            yield _new_entry(f"new/{name} in {location}", named, f"model{_SUFFIX[model]}", (0, 3))
        if "\0" not in text and "/" not in text:
            for model, suffix in _SUFFIX.items():
                title = f"new/{name} in the file's name, {suffix}"
                yield _new_entry(title, model, f"{text}{suffix}", (0, 3))
    for kind, model, changes, names in _FAULTS:
        for name in names:
            wrong, file = model.replace(*changes[name], 1), f"model{_SUFFIX[model]}"
            codes = {"timestep 0": (0, 3)}.get(name, (0,) if name in AS_BODIES else (3,))
            yield _new_entry(f"new/{kind} {name}", wrong, file, codes)
            yield _compare_entry(f"compare/{kind} {name}", wrong, file)
    for name, file in (("a folder", "@hostile"), ("nothing", "@nothing.urdf"),
                       ("another format", "@hostile/system.py"),
                       ("a device", "/dev/zero")):  # fmt: skip
        command = ("new", "@new", "--from", file)
        yield CorpusEntry(
            f"new/{name}", chain_builds(), codes=(2, 3), match="crosscheck", command=command
        )


def _with_name(model: str, attributes: list[str], text: str) -> str:
    for old, new in _ESCAPED:
        text = text.replace(old, new)
    for attribute in attributes:
        key = attribute.partition("=")[0]
        model = model.replace(attribute, f'{key}="{text}"')
    return model


def _new_entry(name: str, text: str, file: str, codes: tuple[int, ...]) -> CorpusEntry:
    command, match = ("new", "@new", "--from", f"@hostile/{file}"), r"crosscheck|model\."
    return CorpusEntry(name, write_file(file, text), command=command, codes=codes, match=match)


def _compare_entry(name: str, text: str, file: str) -> CorpusEntry:
    sound = "@sound/mujoco.xml" if file.endswith(".xml") else "@hostile/sound.urdf"
    return CorpusEntry(
        name,
        chain_builds(write_file(file, text), write_file("sound.urdf", URDF)),
        command=("compare", f"@hostile/{file}", sound),
        codes=(0, 1, 2, 3) if name.endswith(AS_BODIES) else (1, 2, 3),
        match=r"model\.|of A and joint x of B",
    )
