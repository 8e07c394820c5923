"""What lies beyond the folder's plain files: what code reads elsewhere, engines that are absent."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from soak.corpus.baselines import ACCEPT
from soak.corpus.entry import Build, Entry, both, replaced, written
from soak.corpus.sound import MJCF

GATE = ("gate", "@hostile", "--baseline", "@baseline", "--out", "@og", "--jobs", "1")
_BARE = 'engines = ["mujoco"]\n'
_HERE = "__import__('pathlib').Path(__file__).parent"
_JOINT = '<joint name="x" type="slide" axis="1 0 0" stiffness="{}" damping="0.9"/>'


def _beside(name: str, text: str) -> Build:
    """A file of the workspace."""

    def build(place: Path) -> None:
        path = place / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, "utf-8")

    return build


@dataclass(frozen=True, kw_only=True)
class Elsewhere:
    """A stiffness that stands in another file.

    Attributes:
        reads: makes the folder read it.
        file: in the workspace.
        text: of the file, with the stiffness in the place of `{}`.
        model: that the folder has.
    """

    reads: Build
    file: str
    text: str = "{}"
    model: str = "mujoco.xml"


def _read(path: str, *, model: str = "system.py") -> Build:
    old = '"k", 47.0' if model == "system.py" else "STIFFNESS, DAMPING)"
    new = f"float({_HERE}.joinpath('{path}').read_text())"
    return replaced(model, (old, f'"k", {new}' if model == "system.py" else f"{new}, DAMPING)"))


def _included(name: str, *further: Build) -> Build:
    """An MJCF whose joint is in another file; bindings know nothing of that."""
    text = MJCF.replace(_JOINT.format(47), f'<include file="{name}"/>')
    return both(written("mujoco.xml", text), written("mujoco.xml.toml", _BARE), *further)


_PART = f"<mujocoinclude>{_JOINT}</mujocoinclude>"

FILES = {
    "data outside": Elsewhere(reads=_read("../shared.txt"), file="shared.txt"),
    "a module outside": Elsewhere(
        reads=replaced("system.py", (
            '"k", 47.0',
            f"\"k\", (__import__('sys').path.insert(0, str({_HERE}.parent / 'lib')),"
            " __import__('own_k').K)[1]",
        )),
        file="lib/own_k.py", text="K = {}\n",
    ),
    "a hidden file": Elsewhere(reads=_read(".k"), file="hostile/.k"),
    "a hidden folder": Elsewhere(reads=_read(".data/k.txt"), file="hostile/.data/k.txt"),
    "a cache": Elsewhere(reads=_read("__pycache__/k.txt"), file="hostile/__pycache__/k.txt"),
    "a folder with results": Elsewhere(
        reads=both(_read("data/k.txt"), _beside("hostile/data/results.json", "{}")),
        file="hostile/data/k.txt",
    ),
    "data of a space outside": Elsewhere(
        reads=_read("../shared.txt", model="space.py"), file="shared.txt", model="space.py"
    ),
    "an include by another ending": Elsewhere(
        reads=_included("joint.part"), file="hostile/joint.part", text=_PART
    ),
    "an include of an include": Elsewhere(
        reads=_included("outer.part", written(
            "outer.part", '<mujocoinclude><include file="joint.part"/></mujocoinclude>'
        )),
        file="hostile/joint.part", text=_PART,
    ),
    "an include by character references": Elsewhere(
        reads=_included("&#106;oint&#x2E;part"), file="hostile/joint.part", text=_PART
    ),
    "an include outside": Elsewhere(
        reads=_included("../shared.xml"), file="shared.xml", text=_PART
    ),
}  # fmt: skip


def beyond() -> Iterator[Entry]:
    """Every entry of the kind."""
    for name, one in FILES.items():
        first = both(one.reads, _beside(one.file, one.text.format(47.0)))
        for what, value, codes in (("as it was", 47.0, (0,)), ("edited", 47.000047, (1,))):
            yield Entry(
                name=f"gate/{name}, {what}", first=first, model=one.model, before=(ACCEPT,),
                build=_beside(one.file, one.text.format(value)), command=GATE, codes=codes,
            )  # fmt: skip
    yield from _absent()


ENGINES = ("mujoco", "pybullet", "pymunk")


def _absent() -> Iterator[Entry]:
    """Where nothing ran, nothing passed."""
    run = ("run", "@hostile", "--out", "@out", "--baseline", "@baseline", "--jobs", "1")
    for command in (
        run,
        (*run, "--require-engines"),
        ("audit", "@hostile"),
        ("mutate", "@hostile", "--jobs", "1"),
        ACCEPT,
        ("compare", "@hostile/mujoco.xml", "@sound/mujoco.xml"),
        ("engines", "--conformance", "mujoco"),
    ):
        yield Entry(name=f"absent/{command[0]}{' as required' * ('--require-engines' in command)}",
                    build=lambda place: None, command=command, codes=(1, 2, 3), absent=ENGINES,
                    says="installed")  # fmt: skip
    # What was accepted stands, but was not seen again.
    changed = replaced("mujoco.xml", ('"47"', '"48"'))
    yield Entry(name="absent/gate of what has changed", build=changed, before=(ACCEPT,),
                command=GATE, codes=(1, 2, 3), absent=ENGINES)  # fmt: skip
