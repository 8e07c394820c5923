"""Serialized tasks and values for other machines, with their files.

A remote worker has copies of a run's files below its own folder, the root, each at its local path:
`/home/me/arm/system.py` is `ROOT/home/me/arm/system.py`. Its working folder is the copy of ours. So
relative paths are the same on both machines, and absolute paths differ by the root. Unpacking adds
the root, and packing a value removes it, also in texts.
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
"""Maximum size of the files that one run may send, bytes."""


class PayloadError(RuntimeError):
    """An object that cannot be serialized; the message gives the reason."""


class _Packer(pickle.Pickler):
    """Pickler that marks local paths.

    Args:
        file: output file.
        root: root to remove from paths; empty: none.
        places: folders and files below which an absolute path is local; with a root, all paths are
            local.
    """

    def __init__(self, file: io.BytesIO, root: str, places: frozenset[str]) -> None:
        super().__init__(file, protocol=pickle.HIGHEST_PROTOCOL)
        self._root, self._places = root, places

    def persistent_id(self, value: Any) -> str | None:
        """Return the type and the text of a local path, or of a text that contains one."""
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
    """Unpickler that completes the marked paths.

    Args:
        file: input file.
        root: root to add to paths.
    """

    def __init__(self, file: io.BytesIO, root: str) -> None:
        super().__init__(file)
        self._root = root

    def persistent_load(self, named: str) -> object:
        """Return a marked path as it is named on this machine."""
        text = self._root + named[1:]
        return Path(text) if named[0] == _PATH else text


def serialize(value: object, *, root: str = "", places: frozenset[str] = frozenset()) -> bytes:
    """Serialize a value; if there is a root, remove it from each text and path.

    Raises:
        Exception: any error of pickle.
    """
    file = io.BytesIO()
    _Packer(file, root, places).dump(value)
    return file.getvalue()


def unpacked(data: bytes, root: str = "") -> Any:
    """Return the value, with the root added to the marked paths."""
    return _Unpacker(io.BytesIO(data), root).load()


def done(sent: tuple[bytes, str]) -> bytes:
    """Run a serialized task, and serialize its value, in a process on a machine of the cluster.

    Args:
        sent: the task, which is a function and its argument, and the root of the copies.

    Raises:
        PayloadError: for an unreadable task, or a value that cannot be serialized.
        Exception: any error of the task.
    """
    data, root = sent
    try:
        function, argument = unpacked(data, root)
    except Exception as error:
        raise PayloadError(f"its task can't be sent: {type(error).__name__}: {error}") from None
    value = function(argument)
    try:
        return serialize(value, root=root)
    except Exception as error:
        raise PayloadError(f"its value can't be sent: {type(error).__name__}: {error}") from None


def input_files(files: Iterable[Path]) -> bytes:
    """Serialize copies of files, and of all files in folders.

    Raises:
        OSError: for an unreadable file.
        PayloadError: if they exceed the maximum size.
    """
    packet, size = io.BytesIO(), 0
    with tarfile.open(fileobj=packet, mode="w:gz", compresslevel=_FASTEST) as tar:
        for path in sorted({one for file in files for one in _within(Path(os.path.abspath(file)))}):
            data = path.read_bytes()
            size += len(data)
            if size > MOST_SENT:
                raise PayloadError(
                    f"the input files of the run exceed {MOST_SENT >> 20} MiB with "
                    f"{path}, too much to send to workers; run fewer folders at "
                    "once, or remove files that are not models"
                )
            entry = tarfile.TarInfo(str(path).lstrip(os.sep))
            entry.size = len(data)
            tar.addfile(entry, io.BytesIO(data))
    return packet.getvalue()


def _within(path: Path) -> Iterable[Path]:
    """Return a file, or the files in a folder except hidden files and bytecode."""
    if not path.is_dir():
        return [path]
    paths = []
    for folder, inner, names in os.walk(path):
        inner[:] = [name for name in inner if not (name[0] == "." or name == "__pycache__")]
        paths += [inner_path for name in names if (inner_path := Path(folder, name)).is_file()]
    return paths


def extract(packet: bytes, root: Path) -> None:
    """Extract the copies below a root.

    Raises:
        OSError: if the disk is full.
    """
    with tarfile.open(fileobj=io.BytesIO(packet), mode="r:gz") as tar:
        tar.extractall(root, filter="data")
