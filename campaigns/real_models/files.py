"""Which files of a folder are robots: URDFs, and MJCFs that are no part of another."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

_MJCF = re.compile(rb"<mujoco\b")
_WORLD = re.compile(rb"<worldbody\b|<include\b")


def robot_files(folder: Path) -> list[Path]:
    """All of a folder and those below it, by name."""
    return sorted(_files(folder))


def _files(folder: Path) -> Iterator[Path]:
    yield from folder.rglob("*.urdf")
    for path in folder.rglob("*.xml"):
        data = path.read_bytes()
        if _MJCF.search(data) and _WORLD.search(data):
            yield path
