"""Standard streams whose reader has closed: `| head`, `>&-`. The run and its verdict continue.

A full disk does not end the run either, but the printed text is incomplete then.
"""

from __future__ import annotations

import errno
import io
import os
import sys
from typing import TextIO, cast


def protect_streams() -> None:
    """Make the standard streams writable, however the shell left them.

    A closed stream becomes the null device. Otherwise the next opened file would get its number,
    and the output of libraries.
    """
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            null = os.open(os.devnull, os.O_RDWR)
            if null != number:
                os.dup2(null, number)
                os.close(null)
            os.set_inheritable(number, True)  # our own processes would find it closed again
    sys.stdout, sys.stderr = _tolerant(sys.stdout, 1), _tolerant(sys.stderr, 2)


def output_error() -> str:
    """Return why standard output is incomplete; empty if its reader just stopped reading."""
    stream = sys.stdout
    if not isinstance(stream, io.TextIOWrapper):
        return ""
    stream.flush()
    raw = getattr(stream.buffer, "raw", None)
    return raw.error if isinstance(raw, _DiscardingFile) else ""


def _tolerant(stream: TextIO | None, number: int) -> TextIO:
    """Return a stream like another that raises no error after its reader has closed."""
    wrapper = stream if isinstance(stream, io.TextIOWrapper) else None
    return cast(
        TextIO,
        io.TextIOWrapper(
            io.BufferedWriter(_DiscardingFile(number, "w", closefd=False)),
            encoding=wrapper.encoding if wrapper else "utf-8",
            errors="backslashreplace",
            line_buffering=wrapper.line_buffering if wrapper else number == 2,
        ),
    )


class _DiscardingFile(io.FileIO):
    """A file that discards data after it becomes unwritable."""

    _is_broken = False
    error = ""

    def write(self, data: object) -> int:
        """Write data until the reader is gone or the disk is full; discard it from then on."""
        view = memoryview(data)  # type: ignore[arg-type]  # any object with a buffer
        if self._is_broken:
            return view.nbytes
        try:
            return super().write(view)
        except OSError as error:
            if error.errno not in (errno.EPIPE, errno.ENOSPC, errno.EIO, errno.ESHUTDOWN):
                raise
            self._is_broken = True
            if error.errno != errno.EPIPE:
                self.error = error.strerror or str(error)
            return view.nbytes
