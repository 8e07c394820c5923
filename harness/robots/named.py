"""Which names of a command line are robots' files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from harness.files.folders import FolderError
from harness.robots.compiled import read_compiled_robot
from harness.robots.robot import Robot
from harness.robots.urdf import read_urdf_robot
from harness.text.visible import odd_name, visible

FORMATS = (".urdf", ".xml")
"""Endings of the files that are read as robots."""


def robot_files(names: Sequence[str]) -> tuple[list[Path], list[str]]:
    """Those that are files, each once, and the other names.

    Raises:
        FolderError: for a file that can't be checked alone, naming the remedy.
    """
    files, others = list[Path](), list[str]()
    for name in names:
        path = Path(name)
        if not path.is_file():
            others.append(name)
            continue
        if path.suffix not in FORMATS:
            raise FolderError(
                f"{visible(name)}: of files alone, {' and '.join(FORMATS)} are read; make a folder"
                f" of it, `crosscheck new --from {visible(name)} FOLDER`"
            )
        if (why := odd_name(name)) is not None:
            raise FolderError(f"{visible(name)}: its name has {why}; rename it")
        if path not in files:
            files.append(path)
    return files, others


def read_robot(file: Path) -> Robot:
    """A robot's file, by its ending."""
    return read_urdf_robot(file) if file.suffix == ".urdf" else read_compiled_robot(file)
