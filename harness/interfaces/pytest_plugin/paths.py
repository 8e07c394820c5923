"""System folders and robot files of a session, and the files that pytest collects for them."""

from __future__ import annotations

import fnmatch
import os
from collections.abc import Sequence
from pathlib import Path

import pytest

from physics_crosscheck.harness.modelfiles.choice import named_model
from physics_crosscheck.harness.modelfiles.folders import FolderError, system_folders
from physics_crosscheck.harness.modelfiles.robot_targets import (
    NamedRobots,
    is_robot,
    robot_files,
)

DECLARATION = "system.py"


def targets_under(name: str, unwanted: Sequence[str]) -> list[Path]:
    """Return the system folders at or below a path; without any, the robot files.

    A name that is not a path means the built-in system, as in `crosscheck run`.

    Args:
        name: name of the path; a robot file stands for itself.
        unwanted: patterns of folder names to skip, pytest's `norecursedirs`.

    Raises:
        FolderError: if the path has neither.
    """
    if not name:  # an unset variable, which would mean all targets
        raise FolderError("PATH is empty; name a folder, or . for all that lie here")
    path = Path(os.path.abspath(name))
    if path.name == DECLARATION and path.is_file():
        path = path.parent
    if os.path.lexists(path / DECLARATION):  # also a dangling link, which reading reports
        return [path]
    if not path.is_dir():
        return _named(name)
    folders, files = list[Path](), list[Path]()
    for here, inner, names in os.walk(path):
        if DECLARATION in names:
            folders.append(Path(here))
            inner.clear()
        files += [Path(here, file) for file in names if is_robot(Path(here, file))]
        # Sorted and in place: the walk is then the same in every xdist worker.
        inner[:] = sorted(name for name in inner if _enters(name, unwanted))
    if not (folders or files):
        raise FolderError(f"{name}: no {DECLARATION} and no robot file in it or below it")
    return sorted(folders or files)


def _named(name: str) -> list[Path]:
    """Return the robot file or the built-in system of a name."""
    robots = NamedRobots([], [name], {}) if named_model(name) else robot_files([name])
    if robots.faults:
        raise FolderError("; ".join(robots.faults.values()))
    return [Path(os.path.abspath(path)) for path in robots.files or system_folders([name])]


def meant(config: pytest.Config) -> dict[str, list[Path]]:
    """Return the targets by path, from the command line or else from the ini file.

    Robot files among pytest's own arguments are targets too: a shell writes `--crosscheck *.urdf`
    as one path of --crosscheck and such arguments.

    Raises:
        pytest.UsageError: if a path has no target.
    """
    named = config.getoption("crosscheck") or [str(p) for p in config.getini("crosscheck_paths")]
    if config.args_source is config.ArgsSource.ARGS:
        files = [argument.split("::")[0] for argument in config.args]
        named = [*named, *(file for file in files if is_robot(Path(file)))]
    try:
        return {name: targets_under(name, _unwanted(config)) for name in named}
    except FolderError as error:
        raise pytest.UsageError(f"--crosscheck {error}") from None


def to_collect(config: pytest.Config, targets: dict[str, list[Path]]) -> list[str]:
    """Return what pytest collects: the command line's arguments, declarations and robot files.

    `--crosscheck PATH` counts as an argument PATH: without others, nothing else is collected. An
    argument inside PATH, such as a test's id, selects from it. The ini file's paths, like
    `testpaths`, apply if the command line names nothing.
    """
    is_requested = bool(config.getoption("crosscheck"))
    named = config.args_source is config.ArgsSource.ARGS
    given = [] if is_requested and not named else list(config.args)
    if named and not is_requested:
        return given
    inside = [Path(argument.split("::")[0]).resolve() for argument in given]
    unwanted = _unwanted(config)
    for name, paths in targets.items():
        roots = [Path(name).resolve(), *(target.resolve() for target in paths)]
        if named and any(path.is_relative_to(root) for path in inside for root in roots):
            continue
        # Skip paths that pytest collects anyway: pytest 8 loses tests if arguments overlap.
        given += [
            str(file)
            for file in (one / DECLARATION if one.is_dir() else one for one in paths)
            if not any(_reached(file.resolve().parent, path, unwanted) for path in inside)
        ]
    return list(dict.fromkeys(given))


def _unwanted(config: pytest.Config) -> list[str]:
    return [*config.getini("norecursedirs"), "__pycache__"]


def _enters(name: str, unwanted: Sequence[str]) -> bool:
    return not any(fnmatch.fnmatch(name, pattern) for pattern in unwanted)


def _reached(folder: Path, start: Path, unwanted: Sequence[str]) -> bool:
    """Return whether pytest, collecting `start`, enters a folder."""
    if not folder.is_relative_to(start):
        return False
    return all(_enters(name, unwanted) for name in folder.relative_to(start).parts)
