"""A robot's file with other texts, in a folder of its own."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path


def copied(file: Path, texts: Mapping[Path, bytes], folder: Path) -> Path:
    """A file with other texts, its own and those it includes, and links to all beside it."""
    top = Path(os.path.commonpath([path.parent.resolve() for path in texts]))
    for path, data in texts.items():
        copy = folder / path.resolve().relative_to(top)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(data)
    for beside in top.iterdir():
        if not (folder / beside.name).exists():
            (folder / beside.name).symlink_to(beside)
    return folder / file.resolve().relative_to(top)
