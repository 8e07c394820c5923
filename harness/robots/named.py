"""Which names of a command line are robots' files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from harness.files.folders import FolderError
from harness.text.visible import odd_name, visible

FORMATS = (".urdf",)
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
