"""A robot's file with other texts, in a separate folder."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path


def copy_with_texts(file: Path, texts: Mapping[Path, bytes], folder: Path) -> Path:
    """Write a file and its includes with other texts, and link to the other files of the folder.

    Compiled Python stays behind: it would be taken for that of the copy.
    """
    top = Path(os.path.commonpath([path.parent.resolve() for path in texts]))
    for path, data in texts.items():
        copy = folder / path.resolve().relative_to(top)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(data)
    for neighbour in top.iterdir():
        if neighbour.name != "__pycache__" and not (folder / neighbour.name).exists():
            (folder / neighbour.name).symlink_to(neighbour)
    return folder / file.resolve().relative_to(top)
