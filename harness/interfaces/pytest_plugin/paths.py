"""Which system folders are meant, and what pytest is told to collect for them."""

from __future__ import annotations

import fnmatch
import os
from collections.abc import Sequence
from pathlib import Path

import pytest

from physics_crosscheck.harness.modelfiles.folders import FolderError, system_folders

DECLARATION = "system.py"


def folders_under(name: str, unwanted: Sequence[str]) -> list[Path]:
    """Every system folder that is `name`, or lies under it at any depth, sorted.

    A bare name that is no path stands for the built-in system, as in `crosscheck run`.

    Args:
        unwanted: patterns of folder names that are not entered, pytest's `norecursedirs`.

    Raises:
        FolderError: where there is none.
    """
    if not name:  # an unset variable, which would mean all there is
        raise FolderError("PATH is empty; name a folder, or . for all that lie here")
    path = Path(os.path.abspath(name))
    if path.name == DECLARATION and path.is_file():
        path = path.parent
    if os.path.lexists(path / DECLARATION):  # a link to nowhere too: reading it says so
        return [path]
    if not path.is_dir():
        return [Path(os.path.abspath(folder)) for folder in system_folders([name])]
    found = []
    for here, inner, files in os.walk(path):
        if DECLARATION in files:
            found.append(Path(here))
            inner.clear()
        # Sorted and in place: the walk is then the same in every xdist worker.
        inner[:] = sorted(name for name in inner if _enters(name, unwanted))
    if not found:
        raise FolderError(f"{name}: neither it nor a folder under it has a {DECLARATION}")
    return sorted(found)


def meant(config: pytest.Config) -> dict[str, list[Path]]:
    """System folders by the path that was named, on the command line or else in the ini file.

    Raises:
        pytest.UsageError: for a path without a system folder.
    """
    named = config.getoption("crosscheck") or [str(p) for p in config.getini("crosscheck_paths")]
    try:
        return {name: folders_under(name, _unwanted(config)) for name in named}
    except FolderError as error:
        raise pytest.UsageError(f"--crosscheck {error}") from None


def to_collect(config: pytest.Config, folders: dict[str, list[Path]]) -> list[str]:
    """What pytest shall collect: the command line's arguments, and the folders' declarations.

    `--crosscheck PATH` counts as an argument PATH: without others, nothing else is collected. An
    argument inside PATH, such as a test's id, selects from it. The ini file's paths, like
    `testpaths`, serve where the command line names nothing.
    """
    asked = bool(config.getoption("crosscheck"))
    named = config.args_source is config.ArgsSource.ARGS
    given = [] if asked and not named else list(config.args)
    if named and not asked:
        return given
    inside = [Path(argument.split("::")[0]).resolve() for argument in given]
    unwanted = _unwanted(config)
    for name, found in folders.items():
        roots = [Path(name).resolve(), *(folder.resolve() for folder in found)]
        if named and any(path.is_relative_to(root) for path in inside for root in roots):
            continue
        # Not what pytest comes by anyway: pytest 8 loses tests where arguments overlap.
        given += [
            str(folder / DECLARATION)
            for folder in found
            if not any(_reached(folder.resolve(), path, unwanted) for path in inside)
        ]
    return list(dict.fromkeys(given))


def _unwanted(config: pytest.Config) -> list[str]:
    return [*config.getini("norecursedirs"), "__pycache__"]


def _enters(name: str, unwanted: Sequence[str]) -> bool:
    return not any(fnmatch.fnmatch(name, pattern) for pattern in unwanted)


def _reached(folder: Path, start: Path, unwanted: Sequence[str]) -> bool:
    """Whether pytest, collecting `start`, enters a folder."""
    if not folder.is_relative_to(start):
        return False
    return all(_enters(name, unwanted) for name in folder.relative_to(start).parts)
