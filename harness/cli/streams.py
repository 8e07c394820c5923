"""Standard streams that nobody reads any more: `| head`, `>&-`. The work and its verdict go on.

One whose disk is full does not end the work either, but what was printed is not whole then.
"""

from __future__ import annotations

import errno
import io
import os
import sys
from typing import TextIO, cast


def claim_streams() -> None:
    """Make the standard streams ones that can be written to, whatever the shell left of them.

    One that is closed is nothing: without this, the next file that is opened would take its number,
    and get what a library prints.
    """
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            nowhere = os.open(os.devnull, os.O_RDWR)
            if nowhere != number:
                os.dup2(nowhere, number)
                os.close(nowhere)
            os.set_inheritable(number, True)  # a process of ours would find it closed again
    sys.stdout, sys.stderr = _patient(sys.stdout, 1), _patient(sys.stderr, 2)


def unprinted() -> str:
    """Why not all that was printed is in standard output; empty where nobody wanted more of it."""
    stream = sys.stdout
    if not isinstance(stream, io.TextIOWrapper):
        return ""
    stream.flush()
    raw = getattr(stream.buffer, "raw", None)
    return raw.lost if isinstance(raw, _Unheard) else ""


def _patient(stream: TextIO | None, number: int) -> TextIO:
    """A stream like another, from which nothing is raised where its reader is gone."""
    known = stream if isinstance(stream, io.TextIOWrapper) else None
    return cast(
        TextIO,
        io.TextIOWrapper(
            io.BufferedWriter(_Unheard(number, "w", closefd=False)),
            encoding=known.encoding if known else "utf-8",
            errors="backslashreplace",
            line_buffering=known.line_buffering if known else number == 2,
        ),
    )


class _Unheard(io.FileIO):
    """A file that forgets what can't be written any more."""

    _gone = False
    lost = ""

    def write(self, data: object) -> int:
        """As a file does, until its reader is gone or its disk is full; then nothing."""
        view = memoryview(data)  # type: ignore[arg-type]  # whatever a buffer is
        if self._gone:
            return view.nbytes
        try:
            return super().write(view)
        except OSError as error:
            if error.errno not in (errno.EPIPE, errno.ENOSPC, errno.EIO, errno.ESHUTDOWN):
                raise
            self._gone = True
            if error.errno != errno.EPIPE:
                self.lost = error.strerror or str(error)
            return view.nbytes
