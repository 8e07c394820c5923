"""What a model file is made of: the files that it names, and those that these name."""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.engines.registry import readers
from physics_crosscheck.harness.modelfiles.locations.location import LocationError, Source
from physics_crosscheck.harness.modelfiles.locations.xml import check_harmless, read_elements
from physics_crosscheck.harness.modelfiles.path_states import digest
from physics_crosscheck.harness.modelfiles.reading import MOST_MODEL, no_plain_file, read_regular

_FOLDERS = ("meshdir", "texturedir", "assetdir")
_PARTS = ("include", "model")
"""Elements whose files are read for further names, whatever these end with."""

_MAY_NAME = re.compile(rb"file|dir|uri|\0")
"""What a file has in it that names others; most have not, and need no parser."""

_QUOTED = re.compile(r"""(?<=["'])[^"'\0\n]{1,255}(?=["'])""")
_MODEL = (".xml", ".urdf", ".sdf")

MOST_INCLUDED = 100
"""Includes within includes: at some thousands, engines crash."""


class PartError(ValueError):
    """A model file, or a part of it, that no engine is given; names file, line and reason."""

    kind = "file"


@dataclass
class _Names:
    """What an XML file names.

    Attributes:
        files: each with whether it is a part of the model, to be read for further names.
        folders: where the files may be.
    """

    files: dict[str, bool]
    folders: list[str]


def named_files(model: Path) -> tuple[Path, ...]:
    """Files that a model file names, and those that these name: includes, meshes, height fields.

    Raises:
        OSError: for one that can't be read.
    """
    return tuple(_walk(model)[0])


def part_digests(model: Path) -> dict[str, str]:
    """Return the hashes of a model file and of all files that it names, by their paths.

    Raises:
        OSError: for one that can't be read.
    """
    return {str(path): digest(path) for path in (model, *named_files(model))}


def parts(model: Path) -> dict[Path, bool]:
    """The same, each with whether it is a part of the model: an include, or a model put into it.

    Raises:
        OSError: for one that can't be read.
    """
    return _walk(model)[0]


def included(model: Path) -> frozenset[Path]:
    """Parts of a model, as they are named beside it; none where that can't be told."""
    try:
        return frozenset(path for path, part in parts(model).items() if part)
    except OSError:
        return frozenset()


def check_parts(model: Path) -> None:
    """Refuse a model that can't be read or may do harm, before an engine gets it.

    It and what it includes are plain files of a reasonable size; XML declares no entities and no
    DTD, and does not nest without end.

    Raises:
        PartError: naming file, line and reason.
    """
    try:
        data = read_regular(model, MOST_MODEL)
        if not _is_xml(model):
            return
        check_harmless(Source(model, data))
        # An include is named by that attribute; a reference in it is none of an attribute's name.
        if b"file" in data:
            found, deepest = _walk(model)
            for path in (path for path, part in found.items() if part):
                inner = read_regular(path, MOST_MODEL)
                if inner.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<"):
                    check_harmless(Source(path, inner))
            if deepest > MOST_INCLUDED:
                raise PartError(f"{model}: more than {MOST_INCLUDED} nested includes")
    except OSError as error:
        named = "" if error.filename == str(model) else f"{model}: it names "
        raise PartError(f"{named}{error.filename}: can't be read: {error.strerror}") from None
    except LocationError as error:
        raise PartError(str(error)) from None


def _is_xml(model: Path) -> bool:
    if model.suffix in (*_MODEL, ".py", ".toml"):
        return model.suffix in _MODEL
    return ".xml" in (e.written_like.get(model.suffix) for e in readers(model.suffix))


def _walk(model: Path) -> tuple[dict[Path, bool], int]:
    """Named files, each with whether it is a part of the model, and how deep parts lie."""
    found: dict[Path, bool] = {}
    first = {os.path.realpath(model): model}  # a file has one spelling, the first that is met
    level = [model] if _is_xml(model) else []
    named: list[tuple[Path, str, bool]] = []
    folders = {os.path.realpath(model.parent): model.parent}
    deepest = -1
    while level and deepest <= MOST_INCLUDED:
        deepest += 1
        for path in level:
            names = _names_in(path)
            for folder in (b / n for n in names.folders for b in (path.parent, model.parent)):
                folders.setdefault(os.path.realpath(folder), folder)
            named += [(path.parent, name, part) for name, part in names.files.items()]
        # All names anew: what a part says of folders holds for the names in all others.
        level = []
        for base, name, part in named:
            for candidate in filter(_is_file, _candidates(name, (base, *folders.values()))):
                path = first.setdefault(os.path.realpath(candidate), candidate)
                if path != model and part > found.get(path, False):
                    level.append(path)
                if path != model:
                    found[path] = part or found.get(path, False)
    return found, deepest


def _is_file(path: Path) -> bool:
    """Whether there is a plain file.

    Raises:
        OSError: for a pipe or a device: an engine would wait for its end.
    """
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):  # not there, or a name that no file system takes
        return False
    if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
        raise no_plain_file(path, mode)
    return stat.S_ISREG(mode)


def _names_in(path: Path) -> _Names:
    """The files and folders that a file names in its elements' attributes.

    Of a file that this parser refuses though an engine may read it (two roots, an entity), every
    quoted word is taken for one.
    """
    data = read_regular(path)
    if not _MAY_NAME.search(data):
        return _Names({}, [])
    try:
        elements = read_elements(Source(path, data))
    except LocationError:
        words = _QUOTED.findall(data.decode("utf-8", errors="replace"))
        return _Names(dict.fromkeys(words, True), words)
    names = _Names({}, [])
    for element in elements:
        if element.tag == "uri" and (uri := element.text.strip()):  # of SDF
            names.files.setdefault(uri, Path(uri).suffix in _MODEL)
        for attribute, value in element.attributes.items():
            if attribute in _FOLDERS:
                names.folders.append(value)
            # A texture has fileright, fileleft and four more.
            elif attribute.startswith("file") and value:
                part = element.tag in _PARTS or Path(value).suffix in _MODEL
                names.files[value] = part or names.files.get(value, False)
    return names


def _candidates(name: str, folders: Iterable[Path]) -> Iterator[Path]:
    """Where a file may be: as named, without its package, by its last part (engines differ)."""
    name = name.split("://", 1)[-1]
    parts = Path(name).parts
    for folder in dict.fromkeys(folders):
        for i in range(len(parts)):
            yield folder / Path(*parts[i:])
        yield folder.parent / name
