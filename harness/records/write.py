"""Write records as JSON, and files whole or not at all."""

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


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a file whole or not at all: write a temporary file next to it, then rename it.

    An existing file keeps its permissions; of a link, the file that it points to is written.

    Raises:
        OSError: with the file's own name if it can't be written; an existing file stays unchanged.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        target = path.resolve()
        mode = target.stat().st_mode & 0o7777 if target.is_file() else 0o644
        handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=f".{path.name}.")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(content.encode() if isinstance(content, str) else content)
                file.flush()
                os.fsync(file.fileno())
            os.chmod(temporary, mode)
            os.replace(temporary, target)
        except BaseException:
            os.unlink(temporary)
            raise
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(path)) from None
