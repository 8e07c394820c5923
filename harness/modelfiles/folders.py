"""Where system folders are: those that the user names, or the built-in ones."""

from __future__ import annotations

import os
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.paths import HARNESS, IMPORT_ROOT
from physics_crosscheck.harness.results.visible import odd_name, visible

FORMATS = (".urdf", ".sdf", ".xml")
"""Endings of the files that are read as robots."""


class FolderError(ValueError):
    """A folder that is not there or is no system folder; the message says what to do."""


def builtin() -> Path:
    """The folder of the built-in systems: `models/` of a checkout, or the wheel's copy."""
    return _data("models")


def template() -> Path:
    """The folder that `crosscheck new` copies: `template/` of a checkout, or the wheel's copy."""
    return _data("template")


def _data(name: str) -> Path:
    installed = HARNESS / name
    return installed if installed.is_dir() else IMPORT_ROOT / name


@dataclass(frozen=True)
class NamedFolders:
    """What names of a command line mean.

    Attributes:
        folders: the system folders, each once, in the order of their names.
        faults: name -> why it means no system folder, and the remedy.
    """

    folders: list[Path]
    faults: Mapping[str, str]


def system_folders(named: Sequence[str]) -> list[Path]:
    """Return the system folders that are meant: none named means every built-in one.

    A name is a path; a folder without `system.py` stands for the system folders in it; a bare name
    such as `drum_pendulum` that is no path stands for the built-in system.

    Raises:
        FolderError: naming each folder that is not there, and the remedy.
    """
    found = named_folders(named)
    if found.faults:
        raise FolderError("; ".join(found.faults.values()))
    return found.folders


def named_folders(named: Sequence[str], *, beside: bool = False) -> NamedFolders:
    """Those that are there, and what is wrong with the other names.

    Args:
        named: as in `system_folders`.
        beside: whether there is anything else to do, so that none need be there.

    Raises:
        FolderError: where none is there.
    """
    if not named:
        return NamedFolders(_inside(builtin()), {})
    folders: list[Path] = []
    faults: dict[str, str] = {}
    for name in named:
        try:
            folders += [folder for folder in _meant(name) if folder not in folders]
        except FolderError as error:
            faults[name] = str(error)
    if not folders and not beside:
        raise FolderError("; ".join(faults.values()))
    return NamedFolders(folders, faults)


def _meant(name: str) -> list[Path]:
    if not name:  # an unset variable, which would mean the working folder
        raise FolderError("a name is empty; name a folder, or . for the folders in the current one")
    path = Path(name)
    if not path.exists() and (builtin() / name / "system.py").is_file():
        path = builtin() / name
    if path.is_file():
        raise FolderError(_no_folder(path))
    if not path.is_dir():
        known = ", ".join(p.name for p in _inside(builtin()))
        raise FolderError(f"{visible(name)}: no such folder; the built-in systems are {known}")
    found = [path] if _declares(path) else _inside(path)
    if not found:
        raise FolderError(f"{visible(name)}: neither it nor any folder in it has a system.py")
    for folder in found:
        if (why := odd_name(str(folder))) is not None:
            raise FolderError(f"{visible(str(folder))}: its name has {why}; rename it")
    return found


def _no_folder(file: Path) -> str:
    """What to do with a file where a system folder belongs."""
    name = visible(str(file))
    wanted = f"{name}: a file; expected a system folder"
    if _declares(file.parent):
        return f"{wanted}; name its folder, {visible(str(file.parent))}"
    if file.suffix not in FORMATS:
        return f"{wanted}; name a folder with a system.py"
    shown = visible(shlex.quote(str(file)))
    return (
        f"{wanted}; `crosscheck run {shown}` checks the file alone, and"
        f" `crosscheck new NAME --from {shown}` makes a folder of it"
    )


def _inside(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if path.is_dir() and _declares(path))


def _declares(folder: Path) -> bool:
    """Whether it has a `system.py`, be it a link to nowhere: reading that says what is wrong."""
    return os.path.lexists(folder / "system.py")


def check_engines(names: Sequence[str]) -> None:
    """Refuse engines that nobody knows, and those of extras that aren't installed.

    Raises:
        FolderError: naming those that are known.
    """
    # Imported here: the adapters bring numpy, which no help text needs.
    from physics_crosscheck.harness.engines.registry import absent_extras, engines

    for name in names:
        if name not in (known := engines()):
            raise FolderError(f"unknown engine {name!r}; known engines: {', '.join(sorted(known))}")
        if name in (absent := absent_extras()):
            raise FolderError(absent[name])
