"""Write records as JSON, and files whole or not at all."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import msgspec

from .base import Record


def encoded(record: Record, indent: int = 0) -> str:
    """Return a record as JSON with a final newline; `indent`: spaces per level, 0 for one line."""
    data = msgspec.json.encode(record)
    if indent:
        data = msgspec.json.format(data, indent=indent)
    return data.decode() + "\n"


def write_whole(path: Path, text: str) -> None:
    """Write a file whole or not at all: write a temporary file next to it, then rename it.

    Raises:
        OSError: with the file's own name if it can't be written; an existing file stays unchanged.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
            os.chmod(temporary, 0o644)
            os.replace(temporary, path)
        except BaseException:
            os.unlink(temporary)
            raise
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from None
