"""Models that depend on hidden, cached or external files, and runs without installed engines."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from soak.corpus.baselines import ACCEPT, RUN
from soak.corpus.entry import GATE, Build, CorpusEntry, chain_builds, replace_text, write_file
from soak.corpus.sound import MJCF

_BARE = 'engines = ["mujoco"]\n'
_HERE = "__import__('pathlib').Path(__file__).parent"
_JOINT = '<joint name="x" type="slide" axis="1 0 0" stiffness="{}" damping="0.9"/>'


def _write_in_workspace(name: str, text: str) -> Build:
    """Return a build that writes a file at a path in the workspace."""

    def build(workspace: Path) -> None:
        path = workspace / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, "utf-8")

    return build


@dataclass(frozen=True, kw_only=True)
class ExternalStiffness:
    """A stiffness that the model reads from another file.

    Attributes:
        use: build that makes the model read the file.
        path: path of the file in the workspace.
        text: content of the file, with `{}` for the stiffness.
        model: model file of the folder.
    """

    use: Build
    path: str
    text: str = "{}"
    model: str = "mujoco.xml"


def _read_external(path: str, *, model: str = "system.py") -> Build:
    old = '"k", 47.0' if model == "system.py" else "STIFFNESS, DAMPING)"
    new = f"float({_HERE}.joinpath('{path}').read_text())"
    return replace_text(model, (old, f'"k", {new}' if model == "system.py" else f"{new}, DAMPING)"))


def _include_external(name: str, *further: Build) -> Build:
    """Return a build that moves the joint to an included file and removes the bindings."""
    text = MJCF.replace(_JOINT.format(47), f'<include file="{name}"/>')
    return chain_builds(
        write_file("mujoco.xml", text), write_file("mujoco.xml.toml", _BARE), *further
    )


_PART = f"<mujocoinclude>{_JOINT}</mujocoinclude>"

FILES = {
    "data outside": ExternalStiffness(use=_read_external("../shared.txt"), path="shared.txt"),
    "a module outside": ExternalStiffness(
        use=replace_text(
            "system.py",
            (
                '"k", 47.0',
                f"\"k\", (__import__('sys').path.insert(0, str({_HERE}.parent / 'lib')),"
                " __import__('own_k').K)[1]",
            ),
        ),
        path="lib/own_k.py",
        text="K = {}\n",
    ),
    "a hidden file": ExternalStiffness(use=_read_external(".k"), path="hostile/.k"),
    "a hidden folder": ExternalStiffness(
        use=_read_external(".data/k.txt"), path="hostile/.data/k.txt"
    ),
    "a cache": ExternalStiffness(
        use=_read_external("__pycache__/k.txt"), path="hostile/__pycache__/k.txt"
    ),
    "a folder with results": ExternalStiffness(
        use=chain_builds(
            _read_external("data/k.txt"), _write_in_workspace("hostile/data/results.json", "{}")
        ),
        path="hostile/data/k.txt",
    ),
    "data of a space outside": ExternalStiffness(
        use=_read_external("../shared.txt", model="space.py"), path="shared.txt", model="space.py"
    ),
    "an include by another ending": ExternalStiffness(
        use=_include_external("joint.part"), path="hostile/joint.part", text=_PART
    ),
    "an include of an include": ExternalStiffness(
        use=_include_external(
            "outer.part",
            write_file("outer.part", '<mujocoinclude><include file="joint.part"/></mujocoinclude>'),
        ),
        path="hostile/joint.part",
        text=_PART,
    ),
    "an include by character references": ExternalStiffness(
        use=_include_external("&#106;oint&#x2E;part"), path="hostile/joint.part", text=_PART
    ),
    "an include outside": ExternalStiffness(
        use=_include_external("../shared.xml"), path="shared.xml", text=_PART
    ),
}


def dependency_entries() -> Iterator[CorpusEntry]:
    """Yield the entries on external files and on missing engines."""
    gate = partial(CorpusEntry, before=(ACCEPT,), command=GATE)
    for name, external in FILES.items():
        right, wrong = (
            _write_in_workspace(external.path, external.text.format(value))
            for value in (47.0, 47.000047)
        )
        entry = partial(gate, setup=chain_builds(external.use, right), model=external.model)
        yield entry(f"gate/{name}, as it was", right, codes=(0,))
        yield entry(f"gate/{name}, edited", wrong, codes=(1,))
    # Without any engine, no run may pass.
    absent = partial(CorpusEntry, codes=(1, 2, 3), absent=("mujoco", "pybullet", "pymunk"))
    for command in (
        RUN,
        (*RUN, "--require-engines"),
        ("audit", "@hostile"),
        ("mutate", "@hostile", "--jobs", "1"),
        ACCEPT,
        ("compare", "@hostile/mujoco.xml", "@sound/mujoco.xml"),
        ("engines", "--conformance", "mujoco"),
    ):
        name = f"absent/{command[0]}{' as required' * ('--require-engines' in command)}"
        yield absent(name, chain_builds(), command=command, match="installed")
    # The accepted results remain, but nothing confirms them.
    changed = replace_text("mujoco.xml", ('"47"', '"48"'))
    yield absent("absent/gate of what has changed", changed, before=(ACCEPT,), command=GATE)
