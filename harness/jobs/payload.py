"""Tasks and values on their way to another machine, and files with them.

A worker there has copies of a run's files below a folder of its own, its root, each at the path
that it has here: `/home/me/arm/system.py` is `ROOT/home/me/arm/system.py`. Its working folder is
the copy of ours. So relative paths mean the same there as here, and an absolute one differs by the
root alone: it gets that as it is unpacked there, and loses it as a value is packed, in texts too.
"""

from __future__ import annotations

import io
import os
import pickle
import tarfile
from collections.abc import Iterable
from pathlib import Path, PurePath
from typing import Any

_FASTEST = 1
_TEXT, _PATH = "tp"

MOST_SENT = 2**28
"""Bytes of files that one run may send."""


class ParcelError(RuntimeError):
    """What can't be packed; the message says why."""


class _Packer(pickle.Pickler):
    """Pickles with some paths as they are named here.

    Args:
        file: to write to.
        root: that they lose; empty: they have none.
        places: folders and files below which an absolute path is one of them; where there is a
            root, all are.
    """

    def __init__(self, file: io.BytesIO, root: str, places: frozenset[str]) -> None:
        super().__init__(file, protocol=pickle.HIGHEST_PROTOCOL)
        self._root, self._places = root, places

    def persistent_id(self, value: Any) -> str | None:
        """A path, or a text with some, in place of an object: what it is, and its text."""
        kind = type(value)
        if kind is str:
            mark, text = _TEXT, value
        elif isinstance(value, Path):
            mark, text = _PATH, str(value)
        else:
            return None
        if self._root:
            named = text.replace(self._root, "")
            return None if named == text else mark + named
        return mark + text if self._is_sent(text) else None

    def _is_sent(self, text: str) -> bool:
        if not text.startswith(os.sep):
            return False
        return any(str(part) in self._places for part in (text, *PurePath(text).parents))


class _Unpacker(pickle.Unpickler):
    """Unpickles, with some paths as they are named there.

    Args:
        file: to read.
        root: that they get.
    """

    def __init__(self, file: io.BytesIO, root: str) -> None:
        super().__init__(file)
        self._root = root

    def persistent_load(self, named: str) -> object:
        """What such a path means where it is unpacked."""
        text = self._root + named[1:]
        return Path(text) if named[0] == _PATH else text


def packed(value: object, *, root: str = "", places: frozenset[str] = frozenset()) -> bytes:
    """A value as it is sent; where there is a root, each text and path loses it.

    Raises:
        Exception: whatever pickling it raises.
    """
    file = io.BytesIO()
    _Packer(file, root, places).dump(value)
    return file.getvalue()


def unpacked(data: bytes, root: str = "") -> Any:
    """The value; the paths that were sent get the root before them."""
    return _Unpacker(io.BytesIO(data), root).load()


def done(sent: tuple[bytes, str]) -> bytes:
    """Do a task that was sent, and pack its value: what a process on a cluster's machine does.

    Args:
        sent: the task, a function and its argument; and the root of the copies.

    Raises:
        ParcelError: for a task that can't be read, or a value that can't be sent.
        Exception: whatever the task raises.
    """
    data, root = sent
    try:
        function, argument = unpacked(data, root)
    except Exception as error:
        raise ParcelError(f"its task can't be sent: {type(error).__name__}: {error}") from None
    value = function(argument)
    try:
        return packed(value, root=root)
    except Exception as error:
        raise ParcelError(f"its value can't be sent: {type(error).__name__}: {error}") from None


def luggage(files: Iterable[Path]) -> bytes:
    """Copies of files and of all in folders, as they are sent.

    Raises:
        OSError: for one that can't be read.
        ParcelError: where they are too many bytes.
    """
    packet, size = io.BytesIO(), 0
    with tarfile.open(fileobj=packet, mode="w:gz", compresslevel=_FASTEST) as tar:
        for path in sorted({one for file in files for one in _within(Path(os.path.abspath(file)))}):
            data = path.read_bytes()
            size += len(data)
            if size > MOST_SENT:
                raise ParcelError(
                    f"the input files of the run exceed {MOST_SENT >> 20} MiB with "
                    f"{path}, too much to send to workers; run fewer folders at "
                    "once, or remove files that are not models"
                )
            entry = tarfile.TarInfo(str(path).lstrip(os.sep))
            entry.size = len(data)
            tar.addfile(entry, io.BytesIO(data))
    return packet.getvalue()


def _within(path: Path) -> Iterable[Path]:
    """A file, or those of a folder; not what programs keep there hidden, nor bytecode."""
    if not path.is_dir():
        return [path]
    found = []
    for folder, inner, names in os.walk(path):
        inner[:] = [name for name in inner if not (name[0] == "." or name == "__pycache__")]
        found += [one for name in names if (one := Path(folder, name)).is_file()]
    return found


def unload(packet: bytes, root: Path) -> None:
    """Put the copies below a root.

    Raises:
        OSError: where there is no room.
    """
    with tarfile.open(fileobj=io.BytesIO(packet), mode="r:gz") as tar:
        tar.extractall(root, filter="data")
