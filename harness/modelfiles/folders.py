"""Locations of system folders: those that the user names, or the built-in ones."""

import os
import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.documents.elements import xml_problem
from physics_crosscheck.harness.documents.expanded import RENAMED
from physics_crosscheck.harness.documents.reading import MAX_MODEL_BYTES, USD_HEAD, USD_SUFFIXES
from physics_crosscheck.harness.paths import HARNESS, IMPORT_ROOT
from physics_crosscheck.harness.results.visible import odd_name, visible

HEAD_BYTES = 4096
"""Bytes of a file that contain its first element."""


@dataclass(frozen=True, kw_only=True)
class Format:
    """One format.

    Attributes:
        package: name of the package that reads it.
        is_xml: whether a file must be XML.
        strict: whether it must be well-formed; otherwise an engine's parser decides.
        head: pattern near the start of a robot's file; empty if only robots have the suffix.
    """

    package: str
    is_xml: bool = True
    strict: bool = True
    head: bytes = b""


FORMATS: Mapping[str, Format] = {
    ".urdf": Format(package="urdf"),
    ".sdf": Format(package="sdf"),
    ".xml": Format(package="mjcf", strict=False, head=rb"<mujoco(?!include)"),
    **dict.fromkeys(USD_SUFFIXES, Format(package="usd", is_xml=False, head=USD_HEAD)),
}
"""Formats by suffix. A new one is a package beside this module, with two functions of a file and of
settings of the engines that run it: `read` returns a `Robot`, `numbers` a `ModelFile`.
"""


def syntax_problem(file: Path) -> str:
    """Return why a robot's file is not XML, with its line and the remedy; empty if it may be, or
    has another syntax.
    """
    kind = FORMATS.get(file.suffix)
    return xml_problem(file, strict=kind.strict) if kind is not None and kind.is_xml else ""


def is_robot(file: Path) -> bool:
    """Return whether a file is a robot's: by its suffix and its first bytes."""
    kind = FORMATS.get(RENAMED.get(file.suffix, file.suffix))
    if kind is None or file.name.startswith("."):
        return False
    if not kind.head:
        return True
    if not file.is_file():  # opening a pipe could block
        return False
    try:
        with file.open("rb") as opened:
            head = opened.read(HEAD_BYTES if kind.is_xml else MAX_MODEL_BYTES)
            return re.search(kind.head, head) is not None
    except OSError:
        return False


class FolderError(ValueError):
    """A folder that does not exist or is not a system folder; the message states a remedy."""


def builtin() -> Path:
    """Return the folder of the built-in systems: `models/` of a checkout, or the wheel's copy."""
    return _data("models")


def template() -> Path:
    """Return the folder that `crosscheck new` copies: `template/` of a checkout, or the wheel's
    copy.
    """
    return _data("template")


def _data(name: str) -> Path:
    installed = HARNESS / name
    return installed if installed.is_dir() else IMPORT_ROOT / name


@dataclass(frozen=True)
class NamedFolders:
    """The meaning of names on a command line.

    Attributes:
        folders: the system folders, without duplicates, in the order of their names.
        faults: name -> why it is not a system folder, and the remedy.
    """

    folders: list[Path]
    faults: Mapping[str, str]


def system_folders(named: Sequence[str]) -> list[Path]:
    """Return the named system folders; without names all built-in ones.

    A name is a path. A folder without `system.py` stands for the system folders in it. A bare name
    such as `drum_pendulum` that is not a path stands for the built-in system.

    Raises:
        FolderError: naming each folder that does not exist, and the remedy.
    """
    result = named_folders(named)
    if result.faults:
        raise FolderError("; ".join(result.faults.values()))
    return result.folders


def named_folders(named: Sequence[str], *, allow_none: bool = False) -> NamedFolders:
    """Return the existing folders, and the problems of the other names.

    Args:
        named: as in `system_folders`.
        allow_none: whether the result may be empty, because there are other targets.

    Raises:
        FolderError: if no folder exists and `allow_none` is false.
    """
    if not named:
        return NamedFolders(_inside(builtin()), {})
    folders: list[Path] = []
    faults: dict[str, str] = {}
    for name in named:
        try:
            folders += [folder for folder in _resolve(name) if folder not in folders]
        except FolderError as error:
            faults[name] = str(error)
    if not folders and not allow_none:
        raise FolderError("; ".join(faults.values()))
    return NamedFolders(folders, faults)


def _resolve(name: str) -> list[Path]:
    if not name:  # an unset variable, which would mean the working folder
        raise FolderError("a name is empty; name a folder, or . for the folders in the current one")
    path = Path(name)
    if not path.exists() and (builtin() / name / "system.py").is_file():
        path = builtin() / name
    if path.is_file():
        raise FolderError(expected_folder(path))
    if not path.is_dir():
        if path.suffix:
            raise FolderError(f"{visible(name)}: there is no such file{similar_path(path)}")
        names = [p.name for p in _inside(builtin())]
        hint = similar_path(path, names) or f"; the built-in systems are {', '.join(names)}"
        raise FolderError(f"{visible(name)}: no such folder{hint}")
    folders = [path] if is_system(path) else _inside(path)
    if not folders:
        raise FolderError(f"{visible(name)}: neither it nor any folder in it has a system.py")
    for folder in folders:
        if (why := odd_name(str(folder))) is not None:
            raise FolderError(f"{visible(str(folder))}: its name has {why}; rename it")
    return folders


def similar_path(path: Path, others: Iterable[str] = ()) -> str:
    """Return `; did you mean X?` if an existing path resembles a missing one; empty otherwise.

    Args:
        path: the missing path; its folder may be misspelled too.
        others: further valid names in the working folder.
    """
    close = _similar(path, others)
    return "" if close is None else f"; did you mean {visible(str(close))}?"


def _similar(path: Path, others: Iterable[str] = ()) -> Path | None:
    # Imported here: only a wrong name needs it.
    from difflib import get_close_matches

    folder = path.parent
    if not folder.is_dir():
        similar = _similar(folder)
        if similar is None or (similar / path.name).exists():
            return similar and similar / path.name
        folder = similar
    try:
        names = [one for one in os.listdir(folder) if not one.startswith(".")]
    except OSError:
        return None
    if folder == Path():
        names += others
    # Suffixes make all names of a format similar.
    stems: dict[str, list[str]] = {}
    for name in sorted(names, key=lambda one: Path(one).suffix != path.suffix):
        stems.setdefault(Path(name).stem, []).append(name)
    close = get_close_matches(path.stem, stems, n=1)
    return folder / stems[close[0]][0] if close else None


def expected_folder(file: Path) -> str:
    """Return the message about a file in place of a system folder."""
    name = visible(str(file))
    wanted = f"{name}: a file; expected a system folder"
    if is_system(file.parent):
        return f"{wanted}; name its folder, {visible(str(file.parent))}"
    if file.suffix not in FORMATS:
        return f"{wanted}; name a folder with a system.py"
    shown = visible(shlex.quote(str(file)))
    return (
        f"{wanted}; `crosscheck run {shown}` checks the file alone, and"
        f" `crosscheck new NAME --from {shown}` makes a folder of it"
    )


def _inside(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if path.is_dir() and is_system(path))


def is_system(folder: Path) -> bool:
    """Return whether it has a `system.py`, or a folder or a broken link of that name: reading it
    reports the problem.
    """
    return os.path.lexists(folder / "system.py")


def check_engines(names: Sequence[str]) -> None:
    """Refuse unknown engines, and engines of extras that are not installed.

    Raises:
        FolderError: naming the known engines.
    """
    # Imported here: the adapters import numpy, which no help text needs.
    from physics_crosscheck.harness.engines.registry import absent_extras, engines

    for name in names:
        if name not in (available := engines()):
            raise FolderError(
                f"unknown engine {name!r}; known engines: {', '.join(sorted(available))}"
            )
        if name in (absent := absent_extras()):
            raise FolderError(absent[name])
