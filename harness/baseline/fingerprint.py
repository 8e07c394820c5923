"""What the outcome of a case depends on, as hashes: files, engine version, numerics.

Read without running anything: this is what tells, in a moment, that nothing has changed.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from harness.engines.registry import model_formats
from harness.files.locations import LocationError
from harness.files.locations.location import Source
from harness.files.locations.xml import read_elements
from harness.files.sidecar import SidecarError, read_sidecar
from harness.numerics.version import VERSION

BESIDE = "(beside)"
"""Stands for the files of a folder that no model file names: a `space.py` may open any of them."""

_FILES = ("file", "filename")
_FOLDERS = ("meshdir", "texturedir", "assetdir")
_PARTS = ("include", "model")
"""Elements whose files are read for further names, whatever these end with."""

_MAY_NAME = re.compile(rb"file|dir|\0")
"""What a file has in it that names others; most have not, and need no parser."""

_QUOTED = re.compile(r"""(?<=["'])[^"'\0\n]{1,255}(?=["'])""")
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


@dataclass(frozen=True, kw_only=True)
class Dependencies:
    """All that the outcome of a case depends on.

    Attributes:
        files: hashes by name, as in `ModelFiles`.
        engine_version: the engine with its version, as `engine 4.0.0`.
        resolution: of the run.
        numerics: version of this package's numerics.
    """

    files: Mapping[str, str]
    engine_version: str
    resolution: float
    numerics: int


def dependencies(
    files: Mapping[str, str], engine: str, versions: Mapping[str, str | None], resolution: float
) -> Dependencies:
    """What a case depends on as things are now: the one place that knows the numerics' version."""
    return Dependencies(
        files=files,
        engine_version=f"{engine} {versions.get(engine)}",
        resolution=resolution,
        numerics=VERSION,
    )


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
    formats = model_formats()
    models = [p.name for p in sorted(folder.iterdir()) if p.suffix in formats]
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


@dataclass
class _Names:
    """What an XML file names.

    Attributes:
        files: each with whether it is a part of the model, to be read for further names.
        folders: where the files may be.
    """

    files: dict[str, bool]
    folders: list[str]


def _names_in(path: Path) -> _Names:
    """The files and folders that a file names in its elements' attributes.

    Of a file that this parser refuses though an engine may read it (two roots, an entity), every
    quoted word is taken for one.
    """
    data = path.read_bytes()
    if not _MAY_NAME.search(data):
        return _Names({}, [])
    try:
        elements = read_elements(Source(path, data))
    except LocationError:
        words = _QUOTED.findall(data.decode("utf-8", errors="replace"))
        return _Names(dict.fromkeys(words, True), words)
    names = _Names({}, [])
    for element in elements:
        for attribute, value in element.attributes.items():
            if attribute in _FOLDERS:
                names.folders.append(value)
            elif attribute in _FILES and value:
                part = element.tag in _PARTS or Path(value).suffix in _MODEL
                names.files[value] = part or names.files.get(value, False)
    return names


def _named_by(model: Path) -> tuple[Path, ...]:
    """Files that a model file names, and those that these name: includes, meshes, height fields."""
    found: dict[Path, None] = {}
    waiting = [model] if model.suffix in _MODEL else []
    folders = [model.parent]
    while waiting:
        path = waiting.pop()
        names = _names_in(path)
        folders += [base / name for name in names.folders for base in (path.parent, model.parent)]
        for name, part in names.files.items():
            for candidate in _candidates(name, (path.parent, *folders)):
                if candidate in found or not candidate.is_file():
                    continue
                if candidate.resolve() != model.resolve():
                    found[candidate] = None
                    waiting += [candidate] * part
    return tuple(found)


def _candidates(name: str, folders: Iterable[Path]) -> Iterator[Path]:
    """Where a file may be: as named, without its package, by its last part (engines differ)."""
    name = name.split("://", 1)[-1]
    parts = Path(name).parts
    for folder in dict.fromkeys(folders):
        for i in range(len(parts)):
            yield folder / Path(*parts[i:])
        yield folder.parent / name
