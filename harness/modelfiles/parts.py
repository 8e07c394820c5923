"""The files that a model file names, directly and indirectly."""

import contextlib
import os
import re
import stat
from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path

from physics_crosscheck.harness.documents.elements import check_harmless, read_elements
from physics_crosscheck.harness.documents.errors import LocationError
from physics_crosscheck.harness.documents.reading import (
    CRATE,
    MAX_MODEL_BYTES,
    USD_SUFFIXES,
    SourceFile,
    not_plain_file_error,
    read_regular,
)
from physics_crosscheck.harness.engines.registry import engines_reading
from .code_reads import digest

_FOLDERS = ("meshdir", "texturedir", "assetdir")
_PARTS = ("include", "model")
"""Elements whose files are searched for further names, whatever their suffix."""

_MAY_NAME = re.compile(rb"file|dir|uri|\0")
"""Content of files that name others; most files have none, and are not parsed."""

_QUOTED = re.compile(r"""(?<=["'])[^"'\0\n]{1,255}(?=["'])""")
_MODEL = (".xml", ".urdf", ".sdf")

MAX_INCLUDE_DEPTH = 100
"""The deepest nesting of includes: at some thousands, engines crash."""


class PartError(ValueError):
    """A model file, or a part of it, that is refused before an engine reads it; names file, line
    and reason.
    """

    kind = "file"


_Names = tuple[dict[str, bool], list[str]]
"""Names of files, each with whether it is a part of the model to be searched, and of folders."""


def named_files(model: Path) -> tuple[Path, ...]:
    """Return files that a model file names, directly and indirectly: includes, meshes, height
    fields.

    Raises:
        OSError: for a file that can't be read.
    """
    return tuple(_walk(model)[0])


def part_digests(model: Path) -> dict[str, str]:
    """Return the hashes of a model file and of all files that it names, by path.

    Raises:
        OSError: for a file that can't be read.
    """
    return {str(path): digest(path) for path in (model, *named_files(model))}


def parts(model: Path) -> dict[Path, bool]:
    """Return the named files, each with whether it is a part of the model: an include, or another
    model.

    Raises:
        OSError: for a file that can't be read.
    """
    return _walk(model)[0]


def included(model: Path) -> frozenset[Path]:
    """Return the parts of a model; empty if they can't be read."""
    try:
        return frozenset(path for path, part in parts(model).items() if part)
    except OSError:
        return frozenset()


def check_parts(model: Path) -> None:
    """Refuse a model that can't be read or may do harm, before an engine reads it.

    The model and its includes must be plain files of a reasonable size. XML must not declare
    entities or a DTD, nor nest too deeply.

    Raises:
        PartError: naming file, line and reason.
    """
    try:
        data = read_regular(model, MAX_MODEL_BYTES)
        if not _is_xml(model):
            return
        check_harmless(SourceFile(model, data))
        # An include has that attribute; a reference can't spell an attribute's name.
        if b"file" in data:
            named_paths, deepest = _walk(model)
            for path in (path for path, part in named_paths.items() if part):
                inner = read_regular(path, MAX_MODEL_BYTES)
                if inner.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<"):
                    check_harmless(SourceFile(path, inner))
            if deepest > MAX_INCLUDE_DEPTH:
                raise PartError(f"{model}: more than {MAX_INCLUDE_DEPTH} nested includes")
    except OSError as error:
        named = "" if error.filename == str(model) else f"{model}: it names "
        raise PartError(f"{named}{error.filename}: can't be read: {error.strerror}") from None
    except LocationError as error:
        raise PartError(str(error)) from None


def _is_xml(model: Path) -> bool:
    if model.suffix in (*_MODEL, ".py", ".toml"):
        return model.suffix in _MODEL
    return ".xml" in (e.syntax.get(model.suffix) for e in engines_reading(model.suffix))


_ASSET = re.compile(rb"@([^@\n]+)@")
"""Names of files in a text layer of USD."""

MAX_BESIDE = 500
"""The most layers beside a binary one that may be parts of it."""


def _layers(model: Path) -> dict[Path, bool]:
    """Return files that a stage of USD names; beside a binary layer, which hides names, each
    layer of the folder.
    """
    result: dict[Path, bool] = {}
    waiting = [model]
    while waiting:
        path = waiting.pop()
        data = read_regular(path, MAX_MODEL_BYTES)
        names = [name.decode(errors="replace") for name in _ASSET.findall(data)]
        files = [path.parent / name.partition("[")[0].partition(":SDF_")[0] for name in names]
        if data.startswith(CRATE):
            layers = (one for one in model.parent.rglob("*.usd*") if one.suffix in USD_SUFFIXES)
            files = sorted(islice(layers, MAX_BESIDE))
        for file in map(Path, map(os.path.normpath, files)):
            if file not in result and file != model and _is_file(file):
                result[file] = file.suffix in USD_SUFFIXES
                waiting += [file] if result[file] else []
    return result


def _walk(model: Path) -> tuple[dict[Path, bool], int]:
    """Return named files, each with whether it is a part of the model, and the depth of parts."""
    if model.suffix in USD_SUFFIXES:
        return _layers(model), 0
    result: dict[Path, bool] = {}
    first = {os.path.realpath(model): model}  # a file has one spelling, the first that occurs
    level = [model] if _is_xml(model) else []
    named: list[tuple[Path, str, bool]] = []
    folders = {os.path.realpath(model.parent): model.parent}
    deepest = -1
    while level and deepest <= MAX_INCLUDE_DEPTH:
        deepest += 1
        for path in level:
            files, places = _names_in(path)
            for folder in (b / n for n in places for b in (path.parent, model.parent)):
                if os.path.isdir(folder):
                    folders.setdefault(os.path.realpath(folder), folder)
            named += [(path.parent, name, part) for name, part in files.items()]
        # All names again: a part's folders apply to the names in all others.
        level = []
        for base, name, part in named:
            for candidate in filter(_is_file, _candidates(name, (base, *folders.values()))):
                path = first.setdefault(os.path.realpath(candidate), candidate)
                if path != model and part > result.get(path, False):
                    level.append(path)
                if path != model:
                    result[path] = part or result.get(path, False)
    return result, deepest


def _is_file(path: Path) -> bool:
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):  # not there, or a name that the file system rejects
        return False
    if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
        raise not_plain_file_error(path, mode)
    return stat.S_ISREG(mode)


def _names_in(path: Path) -> _Names:
    """Return the files and folders in the attributes of a file's elements.

    If this parser refuses a file that an engine may read (two roots, an entity), every quoted word
    counts as a name.
    """
    data = read_regular(path)
    if not _MAY_NAME.search(data):
        return {}, []
    try:
        elements = read_elements(SourceFile(path, data))
    except LocationError:
        words = _QUOTED.findall(data.decode("utf-8", errors="replace"))
        return dict.fromkeys(words, True), words
    files, folders = dict[str, bool](), list[str]()
    for element in elements:
        if element.tag == "uri" and (uri := element.text.strip()):  # of SDF
            files.setdefault(uri, Path(uri).suffix in _MODEL)
        for attribute, value in element.attributes.items():
            if attribute in _FOLDERS:
                folders.append(value)
            # A texture has fileright, fileleft and four more.
            elif attribute.startswith("file") and value:
                part = element.tag in _PARTS or Path(value).suffix in _MODEL
                files[value] = part or files.get(value, False)
    return files, folders


def _candidates(name: str, folders: Iterable[Path]) -> Iterator[Path]:
    """Yield possible paths of a file: as named, without its package, by its last parts (engines
    differ).
    """
    name = name.split("://", 1)[-1]
    parts = Path(name).parts
    for folder in dict.fromkeys(folders):
        for i in range(len(parts)):
            yield folder / Path(*parts[i:])
        yield folder.parent / name


def input_files(places: Iterable[Path]) -> Iterator[Path]:
    """Yield system folders and robots' files, and files outside of them that their models name.

    Files that `system.py` opens or imports from elsewhere are unknown before it runs.
    """
    for place in places:
        yield place
        models = [one for one in place.iterdir() if one.is_file()] if place.is_dir() else [place]
        for model in models:
            with contextlib.suppress(OSError):  # its case reports the error
                yield from named_files(model)
