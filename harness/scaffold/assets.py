"""What a model file refers to, meshes and textures: copied along, at the same relative paths."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

from harness.files.locations.location import LocationError, Source
from harness.files.locations.xml import RawElement, read_elements
from harness.files.reading import read_regular
from harness.scaffold.folder import NewError

_MEANT = (".py", ".pyc", ".toml")
"""Endings that mean something in a system folder: no mesh may come in under them."""


def neighbours(model: Path, data: bytes) -> dict[str, bytes]:
    """Relative path -> content of every file that a model file names.

    Raises:
        NewError: for one that is not there, is no plain file, or not below the model's folder.
    """
    source = Source(model, data)
    try:
        elements = read_elements(source)
    except LocationError as error:
        raise NewError(str(error)) from None
    folders = {
        key: e.attributes[key]
        for e in elements
        if e.tag == "compiler"
        for key in ("meshdir", "texturedir", "assetdir")
        if key in e.attributes
    }
    found = {}
    for element in elements:
        name = element.attributes.get("filename" if model.suffix == ".urdf" else "file")
        if not name or element.tag == "include":
            continue
        path = PurePosixPath(_folder(element, folders), name)
        where = f"{model}:{source.line(element.start)}: it needs {name}"
        if path.suffix in _MEANT:
            raise NewError(
                f"{where}; in a folder, files that end with {path.suffix} are run or read:"
                " rename it"
            )
        if path.is_absolute() or ".." in path.parts or ":" in str(path):
            raise NewError(f"{where}, which is not below its folder; a folder holds all it needs")
        try:
            found[str(path)] = read_regular(model.parent / path)
        except OSError as error:
            raise NewError(f"{where}: {error.strerror}") from None
    return found


def _folder(element: RawElement, folders: dict[str, str]) -> str:
    key = "texturedir" if element.tag == "texture" else "meshdir"
    return folders.get(key, folders.get("assetdir", ""))
