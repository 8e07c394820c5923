"""The state of a path: the hash of a file's content, `names:HASH` of a folder, or `absent`."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from pathlib import Path

from physics_crosscheck.harness.documents.reading import read_regular

ABSENT = "absent"
UNKNOWN = "unknown"
"""State of a path that can't be read, or is outside the folder; never accepted as equal."""


def digest(path: Path) -> str:
    """Return the hash of a file's content, 16 hexadecimal digits, ignoring the line ends of a
    text.
    """
    return digest_of(read_regular(path))


def digest_of(data: bytes) -> str:
    """Return the hash of a file's content. Git may check out the same text with other line ends."""
    if b"\0" not in data:
        data = data.replace(b"\r\n", b"\n")
    return hashlib.sha256(data).hexdigest()[:16]


def content(path: str) -> str:
    """Return the state of a path; the names in a folder without bytecode.

    Raises:
        OSError: for a path that can't be read.
    """
    try:
        if not os.path.isdir(path):
            return digest(Path(path)) if os.path.lexists(path) else ABSENT
        with os.scandir(path) as scan:
            names = [f"{one.name}{'/' * one.is_dir()}" for one in scan if one.name != "__pycache__"]
    except (FileNotFoundError, NotADirectoryError):
        return ABSENT
    return f"names:{digest_of(os.fsencode(chr(10).join(sorted(names))))}"


def is_content(state: str) -> bool:
    """Return whether a state is the hash of a file's content."""
    return len(state) == 16 and ":" not in state


def states_now(folder: Path, before: Mapping[str, str]) -> dict[str, str]:
    """Return the present states of paths, by name relative to a folder.

    Args:
        folder: base of the names.
        before: earlier states; what was unknown remains so.
    """
    return {name: _state_now(folder / name, before[name]) for name in before}


def _state_now(path: Path, before: str) -> str:
    try:
        return before if before == UNKNOWN else content(os.path.abspath(path))
    except (OSError, ValueError):
        return UNKNOWN
