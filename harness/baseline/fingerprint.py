"""What the outcome of a case depends on, as hashes: files, engine version, numerics.

Read without running anything: this is what tells, in a moment, that nothing has changed.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from harness.files.sidecar import SidecarError, read_sidecar

BESIDE = "(beside)"
"""Stands for the files of a folder that no model file names: a `space.py` may open any of them."""

_NAMED = re.compile(r"""\b(?:file|filename)\s*=\s*["']([^"']+)["']""")
_FOLDER = re.compile(r"""\b(?:meshdir|texturedir|assetdir)\s*=\s*["']([^"']+)["']""")
_MODEL = (".xml", ".urdf")


@dataclass(frozen=True)
class ModelFiles:
    """A model file of a folder, with everything that it is made of.

    Attributes:
        folder: the system folder.
        model: the file's name.
        engines: those that run it.
        hashes: name of each file, relative to the folder, and the hash of its content.
        copies: of these, the ones that a reader may want to see the differences of.
    """

    folder: Path
    model: str
    engines: tuple[str, ...]
    hashes: dict[str, str]
    copies: tuple[str, ...]


@dataclass(frozen=True)
class FolderFiles:
    """A system folder: its models, and what there is that can't be run.

    Attributes:
        system: hash of `system.py` and of the files that it may read.
        broken: sentences: sidecars that can't be read, model files without one.
    """

    folder: Path
    system: str
    models: tuple[ModelFiles, ...]
    broken: tuple[str, ...]


def folder_files(folder: Path, apart: Path | None = None) -> FolderFiles:
    """Hash a system folder; `apart` is a folder inside that is none of its own (the baseline).

    Raises:
        OSError: for a file that can't be read. What can't be read is not taken as unchanged.
    """
    sidecars, broken, own = {}, [], {"system.py"}
    for path in sorted(folder.glob("*.toml")):
        own |= {path.name, path.with_suffix("").name}
        try:
            sidecars[path.with_suffix("").name] = read_sidecar(path)
        except SidecarError as error:
            broken.append(str(error))
    models = [p.name for p in sorted(folder.iterdir()) if p.suffix in _MODEL]
    broken += [f"{folder / name}: has no sidecar" for name in models if name not in sidecars]
    beside = {name: digest(folder / name) for name in _inside(folder, apart) if name not in own}
    system = digest(folder / "system.py")
    found = []
    for name, sidecar in sidecars.items():
        copies = (name, f"{name}.toml", "system.py")
        hashes = {copy: digest(folder / copy) for copy in copies}
        named = {}
        for path in _named_by(sidecar.model):
            where = Path(os.path.relpath(path, folder)).as_posix()
            if where not in hashes:
                named[where] = digest(path)
        rest = {other: beside[other] for other in beside if other not in named}
        if rest:
            named[BESIDE] = _together(rest)
        found.append(ModelFiles(folder, name, sidecar.engines, hashes | named, copies))
    declared = _together({"system.py": system, **beside})
    return FolderFiles(folder, declared, tuple(found), tuple(broken))


def digest(path: Path) -> str:
    """Hash of a file's content, 16 hexadecimal digits; line ends of a text don't count."""
    return digest_of(path.read_bytes())


def digest_of(data: bytes) -> str:
    """Hash of the content of a file. Git may hand out the same text with other line ends."""
    if b"\0" not in data:
        data = data.replace(b"\r\n", b"\n")
    return hashlib.sha256(data).hexdigest()[:16]


def _together(hashes: dict[str, str]) -> str:
    text = "\n".join(f"{name} {value}" for name, value in sorted(hashes.items()))
    return digest_of(text.encode())


def _inside(folder: Path, apart: Path | None) -> Iterator[str]:
    """Names of all files in a folder and below, but hidden ones, caches and this tool's own."""
    apart = None if apart is None else apart.resolve()
    seen = set()
    for base, folders, names in os.walk(folder, followlinks=True):
        here = Path(base)
        real = here.resolve()
        if real in seen or real == apart or (here != folder and "results.json" in names):
            folders.clear()
            continue
        seen.add(real)
        folders[:] = sorted(f for f in folders if not f.startswith((".", "__pycache__")))
        for name in sorted(names):
            if not name.startswith(".") and (here / name).is_file():
                yield (here / name).relative_to(folder).as_posix()


def _named_by(model: Path) -> tuple[Path, ...]:
    """Files that a model file names, and those that these name: includes, meshes, height fields.

    More may be taken for named than is: that costs a run, where one too few would cost a change.
    """
    found: dict[Path, None] = {}
    waiting = [model]
    folders = [model.parent]
    while waiting:
        path = waiting.pop()
        if path.suffix not in _MODEL:
            continue
        text = path.read_text(encoding="utf-8", errors="replace")
        folders += [base / f for f in _FOLDER.findall(text) for base in (path.parent, model.parent)]
        for name in _NAMED.findall(text):
            for candidate in _candidates(name, (path.parent, *folders)):
                known = candidate in found or candidate.resolve() == model.resolve()
                if candidate.is_file() and not known:
                    found[candidate] = None
                    waiting.append(candidate)
    return tuple(found)


def _candidates(name: str, folders: Iterable[Path]) -> Iterator[Path]:
    """Where a file may be: as named, without its package, by its last part (MuJoCo strips it)."""
    name = name.split("://", 1)[-1]
    parts = Path(name).parts
    for folder in dict.fromkeys(folders):
        for i in range(len(parts)):
            yield folder / Path(*parts[i:])
        yield folder.parent / name
