"""Journal of a run, written case by case, so that an interrupted run loses no case.

Each entry is a line of JSON, synchronized to disk. A task runs again if one of its inputs has
changed. A failed task always runs again.
"""

from __future__ import annotations

import contextlib
import errno
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec

from physics_crosscheck.harness.records.base import Record
from physics_crosscheck.harness.records.hold import hold
from physics_crosscheck.harness.records.read import ResultsError

NAME = "results.partial.jsonl"


class CacheKey(Record, frozen=True, kw_only=True):
    """The key of a stored result: a task, and the hash of its dependencies.

    Attributes:
        kind: Kind of the task.
        folder: System folder, or the robot file.
        model: Name of the model file; empty for the whole folder.
        engine: Name of the engine; empty for the whole folder.
        scenario: Name of the scenario; empty for tasks other than cases.
        inputs: Hash of all inputs that are known in advance; empty if unknown.
    """

    kind: str
    folder: str
    model: str = ""
    engine: str = ""
    scenario: str = ""
    inputs: str


class _Done(Record, frozen=True, kw_only=True):
    """A line: a task and its result."""

    key: CacheKey
    value: msgspec.Raw


class Journal:
    """The journal file of one run.

    Attributes:
        path: path of the file.
        problem: why nothing is written any more; empty as long as writing works.
    """

    def __init__(self, path: Path, file: int, kept: dict[CacheKey, msgspec.Raw]) -> None:
        self.path, self.problem = path, ""
        self._file, self._kept = file, kept

    def find(self, key: CacheKey, result: Any) -> Any | None:
        """Return the result of an earlier run, of the given type; None without a valid one."""
        with contextlib.suppress(msgspec.MsgspecError, RecursionError):
            return msgspec.json.decode(self._kept[key], type=result) if key in self._kept else None
        return None

    def store(self, key: CacheKey, value: object) -> None:
        """Write the result of a task; if that fails, the run continues without a journal."""
        if self.problem:
            return
        done = _Done(key=key, value=msgspec.Raw(msgspec.json.encode(value)))
        line = msgspec.json.encode(done) + b"\n"
        try:
            _write(self._file, line)
            os.fsync(self._file)
        except OSError as error:
            self.problem = f"{self.path}: {error.strerror}"

    def remove(self) -> None:
        """Remove the journal after the results are written."""
        with contextlib.suppress(OSError):
            self.path.unlink()


@contextlib.contextmanager
def journal(folder: Path, *, resume: bool) -> Iterator[Journal]:
    """Open the journal of a run and lock its folder against other runs.

    Args:
        folder: folder of the results, created if missing.
        resume: whether to reuse the results of an earlier run.

    Raises:
        ResultsError: if another run uses the folder.
        OSError: if the journal can't be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / NAME
    file = _opened(path)
    try:
        kept, length = _read(path) if resume else ({}, 0)
        os.ftruncate(file, length)
        _write(file, b"" if length else b'{"pid":%d}\n' % os.getpid())
        yield Journal(path, file, kept)
    finally:
        os.close(file)


def _opened(path: Path) -> int:
    """Open and lock the file, unless another run has removed it since."""
    while True:
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_NONBLOCK, 0o644)
        try:
            if not stat.S_ISREG(os.fstat(file).st_mode):
                raise OSError(errno.EINVAL, "is not a regular file", str(path))
            _lock(file, path)
            with contextlib.suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(file), path.stat()):
                    return file
        except BaseException:
            os.close(file)
            raise
        os.close(file)


def _lock(file: int, path: Path) -> None:
    if not hold(file):
        raise ResultsError(
            f"another run{_owner(path)} is writing to {path.parent}; choose another folder: --out"
        )


class _JournalHead(msgspec.Struct):
    """The first line."""

    pid: int


def _owner(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return f" (process {msgspec.json.decode(file.readline(200), type=_JournalHead).pid})"
    except (OSError, msgspec.MsgspecError):
        return ""


def _read(path: Path) -> tuple[dict[CacheKey, msgspec.Raw], int]:
    """Return the stored results, and the number of bytes in complete lines."""
    kept: dict[CacheKey, msgspec.Raw] = {}
    length = 0
    with path.open("rb") as file:
        for line in file:
            if not line.endswith(b"\n"):
                break  # the run ended while writing this
            length += len(line)
            with contextlib.suppress(msgspec.MsgspecError, RecursionError, UnicodeDecodeError):
                done = msgspec.json.decode(line, type=_Done)
                kept[done.key] = done.value
    return kept, length


def _write(file: int, data: bytes) -> None:
    """Write all data: a nearly full disk may accept a part only."""
    while data:
        data = data[os.write(file, data) :]
