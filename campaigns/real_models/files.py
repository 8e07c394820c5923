"""Robot files of a folder: URDFs and MJCFs; and the files that MJCFs include."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

_MJCF = re.compile(rb"<mujoco\b")
_WORLD = re.compile(rb"<worldbody\b|<include\b")
_INCLUDE = re.compile(rb"<include\s[^>]*?file\s*=\s*[\"']([^\"']+)[\"']")


def robot_files(folder: Path) -> list[Path]:
    """Return the robot files in a folder and its subfolders, sorted; or the file itself."""
    return [folder] if folder.is_file() else sorted(_files(folder))


def _files(folder: Path) -> Iterator[Path]:
    yield from folder.rglob("*.urdf")
    for path in folder.rglob("*.xml"):
        data = path.read_bytes()
        if _MJCF.search(data) and _WORLD.search(data):
            yield path


def included_paths(files: Iterable[Path]) -> frozenset[str]:
    """Return the resolved paths of the files that MJCFs include."""
    return frozenset(
        str(Path(file.parent, name.decode(errors="replace")).resolve())
        for file in files
        if file.suffix == ".xml" and file.is_file()
        for name in _INCLUDE.findall(file.read_bytes())
    )
