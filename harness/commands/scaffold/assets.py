"""Meshes and textures of a model file, copied along with the same relative paths."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path, PurePosixPath

from physics_crosscheck.harness.commands.scaffold.folder import NewError
from physics_crosscheck.harness.documents.elements import XmlElement, read_elements
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.location import SourceFile
from physics_crosscheck.harness.documents.reading import read_regular

MEANT = (".py", ".pyc", ".toml")
"""File endings with a meaning in a system folder; a mesh can't have one."""

_SHAPES = ("mesh", "texture")
"""URDF elements whose files engines read; other elements name libraries of other programs."""


def neighbours(model: Path, data: bytes) -> dict[str, bytes]:
    """Return relative path -> content of every file that a model file names, in all search paths.

    Raises:
        NewError: if a file is missing, not a regular file, or not below the model's folder.
    """
    source = SourceFile(model, data)
    try:
        elements = read_elements(source)
    except LocationError as error:
        raise NewError(str(error)) from None
    compiler = {
        key: value for e in elements if e.tag == "compiler" for key, value in e.attributes.items()
    }
    urdf = model.suffix == ".urdf"
    contents: dict[str, bytes] = {}
    for element in elements:
        name = element.attributes.get("filename" if urdf else "file")
        if not name or element.tag == "include" or (urdf and element.tag not in _SHAPES):
            continue
        where = f"{model}:{source.line(element.start)}: it needs {name}"
        if (ending := PurePosixPath(name).suffix) in MEANT:
            raise NewError(
                f"{where}; a system folder runs or reads files that end with {ending}: rename it"
            )
        places = _places(name, element, compiler, urdf)
        contents |= _contents(model.parent, places, where)
    return contents


def _places(
    name: str, element: XmlElement, compiler: Mapping[str, str], urdf: bool
) -> tuple[PurePosixPath, ...]:
    """Return the possible paths of a file, relative to the model's folder.

    For an MJCF, the compiler sets the folder; with `strippath`, only the last part of a name
    counts. For a URDF, some engines follow a `<compiler>` in an element of their own, as in an
    MJCF. Other engines resolve the name in the URDF's own folder, without `package://`.
    """
    key = "texturedir" if element.tag == "texture" else "meshdir"
    folder = compiler.get(key, compiler.get("assetdir", ""))
    stripped = compiler.get("strippath") == "true"
    place = PurePosixPath(folder, PurePosixPath(name).name if stripped else name)
    if not urdf:
        return (place,)
    return (PurePosixPath(name.split("://", 1)[-1]), place)


def _contents(folder: Path, places: tuple[PurePosixPath, ...], where: str) -> dict[str, bytes]:
    """Return the content of the existing files, by path; an engine reads one of them.

    Raises:
        NewError: if none exists.
    """
    within = [path for path in places if not _leads_away(path)]
    contents: dict[str, bytes] = {}
    reasons = []
    for path in within:
        try:
            contents[str(path)] = read_regular(folder / path)
        except OSError as error:
            reasons.append(error.strerror)
    if not contents and len(within) < len(places):
        raise NewError(f"{where}, which is not below its folder; copy it into the folder")
    if not contents:
        looked = " or ".join(dict.fromkeys(map(str, within)))
        raise NewError(f"{where}, looked for as {looked}: {reasons[0]}")
    return contents


def _leads_away(path: PurePosixPath) -> bool:
    return path.is_absolute() or ".." in path.parts or ":" in str(path)
