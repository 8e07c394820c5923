"""Robot files among the names of a command line, and below a folder."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.results.visible import odd_name, visible
from .folders import FolderError, is_system, similar_path
from .formats import FORMATS, is_robot
from .robot_sources import source_files

MAX_DEPTH = 4
"""Folders below a folder that are searched."""

SKIPPED = frozenset({"__pycache__", "build", "dist", "node_modules", "site-packages", "venv"})
"""Names of folders that hold no models of the user; hidden ones are skipped too."""

_FORMAT_LIST = f"{', '.join([*FORMATS][:-1])} and {[*FORMATS][-1]}"


@dataclass(frozen=True)
class NamedRobots:
    """The meaning of the names of a command line.

    Attributes:
        files: robot files, each once.
        others: names of other targets.
        faults: message about each file that is missing or can't be checked alone, by its name.
    """

    files: list[Path]
    others: list[str]
    faults: Mapping[str, str]


def robot_files(names: Sequence[str], model: str | None = "") -> NamedRobots:
    """Separate robot files, also missing ones, from the other names.

    Args:
        names: of a command line.
        model: as in `source_files`.
    """
    files, others, faults = list[Path](), list[str](), dict[str, str]()
    for name in names:
        try:
            paths = source_files(name, model)
        except FolderError as error:
            faults[name] = visible(str(error))
            continue
        path = paths[0]
        if path.suffix in FORMATS and not path.exists():
            faults[name] = f"{visible(name)}: there is no such file{similar_path(path)}"
            continue
        if not path.is_file():
            others.append(name)
            continue
        if path.suffix not in FORMATS:
            formats = (
                f"only {_FORMAT_LIST} run without a folder; name one of these, or a system folder"
            )
            faults[name] = f"{visible(name)}: {formats}"
        elif (why := odd_name(name)) is not None:
            faults[name] = f"{visible(name)}: its name has {why}; rename it"
        else:
            files += [one for one in paths if one not in files]
    return NamedRobots(files, others, faults)


def models_below(here: Path) -> list[str]:
    """Return the system folders below a folder; without any, its model files.

    Raises:
        FolderError: for a folder with neither.
    """
    folders, files = _below(here)
    if not (folders or files):
        raise FolderError(
            "no models below this directory; name a file such as robot.urdf or a system folder,"
            " set folders in [tool.crosscheck] of pyproject.toml, or try `crosscheck demo`"
        )
    return sorted(map(str, folders or files))


def robots_below(folder: Path) -> list[Path]:
    """Return the robot files below a folder, sorted; none where a system folder is below it."""
    folders, files = _below(folder)
    return [] if folders else sorted(files)


def expand_folders(names: Sequence[str]) -> list[str]:
    """Return the names, each folder of robot files replaced by these files."""
    return [
        file
        for name in names
        for file in ([str(one) for one in robots_below(Path(name))] if name else []) or [name]
    ]


def _below(here: Path) -> tuple[list[Path], list[Path]]:
    """Return the system folders and the robot files below a folder."""
    folders, files = list[Path](), list[Path]()
    for base, names in _walk(here):
        if is_system(base):
            folders.append(base)
        files += [base / name for name in names if is_robot(base / name)]
    return folders, files


def _walk(here: Path) -> Iterator[tuple[Path, list[str]]]:
    """Yield folders and the names of their files, none below a system folder."""
    for base, folders, names in os.walk(here):
        depth = len(Path(base).relative_to(here).parts)
        deeper = depth < MAX_DEPTH and not is_system(Path(base))
        folders[:] = sorted(
            name for name in folders if deeper and not name.startswith(".") and name not in SKIPPED
        )
        yield Path(base), names
