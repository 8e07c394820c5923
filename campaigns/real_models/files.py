"""Which files of a folder are robots: URDFs, and MJCFs; and which are but parts of another."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

_MJCF = re.compile(rb"<mujoco\b")
_WORLD = re.compile(rb"<worldbody\b|<include\b")
_INCLUDE = re.compile(rb"<include\s[^>]*?file\s*=\s*[\"']([^\"']+)[\"']")


def robot_files(folder: Path) -> list[Path]:
    """All of a folder and those below it, by name; a file's own name stands for it alone."""
    return [folder] if folder.is_file() else sorted(_files(folder))


def _files(folder: Path) -> Iterator[Path]:
    yield from folder.rglob("*.urdf")
    for path in folder.rglob("*.xml"):
        data = path.read_bytes()
        if _MJCF.search(data) and _WORLD.search(data):
            yield path


def included(files: Iterable[Path]) -> frozenset[str]:
    """Paths of what MJCFs include, as their folders name them."""
    return frozenset(
        str(Path(file.parent, name.decode(errors="replace")).resolve())
        for file in files
        if file.suffix == ".xml" and file.is_file()
        for name in _INCLUDE.findall(file.read_bytes())
    )
