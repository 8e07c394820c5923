"""Models below the working directory: the default targets of `run`, `list` and `gate`."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from physics_crosscheck.harness.modelfiles.folders import FORMATS, FolderError

MAX_DEPTH = 4
"""Folders below the working directory that are searched."""

SKIPPED = frozenset({"__pycache__", "build", "dist", "node_modules", "site-packages", "venv"})
"""Names of folders that hold no models of the user; hidden ones are skipped too."""

HEAD_BYTES = 4096
"""Of an XML file, in which its first element stands."""


def models_below(here: Path) -> list[str]:
    """Return the system folders below a folder; where there is none, its model files.

    Raises:
        FolderError: where there is neither.
    """
    folders, files = [], []
    for base, names in _walk(here):
        if "system.py" in names:
            folders.append(os.path.relpath(base, here))
        files += [os.path.relpath(base / n, here) for n in names if _is_model(base / n)]
    found = folders or files
    if not found:
        raise FolderError(
            "no models below this directory; name a file such as robot.urdf or a system folder,"
            " set folders in [tool.crosscheck] of pyproject.toml, or try `crosscheck demo`"
        )
    return sorted(found)


def _walk(here: Path) -> Iterator[tuple[Path, list[str]]]:
    """Yield folders and the names of their files, none below a system folder."""
    for base, folders, names in os.walk(here):
        depth = len(Path(base).relative_to(here).parts)
        deeper = depth < MAX_DEPTH and "system.py" not in names
        folders[:] = sorted(
            name for name in folders if deeper and not name.startswith(".") and name not in SKIPPED
        )
        yield Path(base), names


def _is_model(file: Path) -> bool:
    """Return whether a file is a robot's: by its ending, and MJCF by its first element."""
    if file.suffix not in FORMATS or file.name.startswith("."):
        return False
    if file.suffix != ".xml":
        return True
    try:
        with file.open("rb") as opened:
            head = opened.read(HEAD_BYTES)
    except OSError:
        return False
    return b"<mujoco" in head and b"<mujocoinclude" not in head
