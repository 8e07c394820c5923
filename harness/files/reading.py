"""Reading what somebody else has put into a folder: plain files alone, and none without an end."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

MOST_MODEL = 64 * 2**20
"""Bytes of a model file, or of a part of one."""

MOST_SIDECAR = 2**20
"""Bytes of a sidecar: more than ten thousand bindings."""

_KINDS = {
    stat.S_IFIFO: "a named pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFDIR: "a folder",
}


def read_regular(path: Path, most: int | None = None) -> bytes:
    """The bytes of a plain file; what might never end, a pipe or a device, is not even opened.

    Args:
        path: of the file, or of a link to it.
        most: bytes that it may have.

    Raises:
        OSError: for what is no plain file, is larger, or can't be read.
    """
    found = os.stat(path)
    kind = stat.S_IFMT(found.st_mode)
    if kind != stat.S_IFREG:
        raise _refused(errno.EINVAL, f"is {_KINDS.get(kind, 'no file')}, where a file belongs", path)
    if most is not None and found.st_size > most:
        size = f"{found.st_size / 2**20:.1f} MB, where at most {most / 2**20:g} MB are read"
        raise _refused(errno.EFBIG, f"has {size}", path)
    return path.read_bytes()


def _refused(number: int, sentence: str, path: Path) -> OSError:
    return OSError(number, sentence, str(path))
