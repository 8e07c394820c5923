"""Arguments of `crosscheck versions`: versions of an engine, and the models it runs."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from physics_crosscheck.harness.engines.registry import engines, engines_reading
from physics_crosscheck.harness.modelfiles.folders import FolderError
from physics_crosscheck.harness.modelfiles.model_files import model_files
from physics_crosscheck.harness.modelfiles.sidecar import Sidecar
from physics_crosscheck.harness.results.visible import visible

_VERSION = re.compile(r"\d[\w.!+-]*")
"""A version number (loosely PEP 440) that pip can't mistake for an option or a path."""


@dataclass(frozen=True)
class AskedVersion:
    """A requested version of the engine; `place` is its environment, None creates one."""

    version: str
    place: Path | None = None


def asked_versions(
    words: Sequence[str], option: str = "--engine", least: int = 2
) -> tuple[str, tuple[AskedVersion, ...]]:
    """Parse an engine's name and its versions, as in `NAME 1.2.3 1.3=path/to/venv`.

    Args:
        words: words of the command line.
        option: option that they follow.
        least: minimum number of versions.

    Raises:
        FolderError: giving the problem and the remedy.
    """
    name, *given = words
    if name not in (all_engines := engines()):
        raise FolderError(
            f"no engine {name!r} is known; known are {', '.join(sorted(all_engines))}"
        )
    requested = [_version(word, option) for word in given]
    numbers = [one.version for one in requested]
    if twice := [number for number in numbers if numbers.count(number) > 1]:
        raise FolderError(f"{option} {name}: {twice[0]} is asked for twice; name two versions")
    if len(requested) < least:
        raise FolderError(
            f"{option} {name}: name two versions of it or more, the older first, as in"
            f" `{option} {name} 1.2.3 1.3.0`"
        )
    return name, tuple(requested)


def _version(word: str, option: str) -> AskedVersion:
    number, equals, place = word.partition("=")
    if not _VERSION.fullmatch(number):
        raise FolderError(
            f"{option}: {visible(word)} is not a version; folders and files come before {option}"
        )
    if not equals:
        return AskedVersion(number)
    if not Path(place).is_dir():
        raise FolderError(f"{option}: {visible(place)}: there is no such environment")
    return AskedVersion(number, Path(place))


@dataclass(frozen=True)
class AskedModels:
    """Models that run in the engine, and a sentence for each named one that does not."""

    folders: tuple[Path, ...]
    robots: tuple[Path, ...]
    left_out: tuple[str, ...]


def asked_models(engine: str, folders: Sequence[Path], robots: Sequence[Path]) -> AskedModels:
    """Return the folders and files that an engine runs.

    Raises:
        FolderError: if nothing runs in the engine.
    """
    left_out = []
    mine = []
    for folder in folders:
        if _runs(folder, engine):
            mine.append(folder)
        else:
            left_out.append(f"{folder}: no model of it names {engine}; left out")
    robot_files = []
    for file in robots:
        if any(reader.name == engine for reader in engines_reading(file.suffix)):
            robot_files.append(file)
        else:
            left_out.append(f"{file}: {engine} reads no {file.suffix} files; left out")
    if not mine and not robot_files:
        raise FolderError("; ".join(left_out))
    return AskedModels(tuple(mine), tuple(robot_files), tuple(left_out))


def _runs(folder: Path, engine: str) -> bool:
    """Return whether a sidecar names an engine, or can't be read (a run reports it)."""
    return any(
        not isinstance(one, Sidecar) or engine in (*one.engines, *one.absent)
        for one in model_files(folder)
    )
