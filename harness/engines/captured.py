"""What an engine's libraries print past Python: they say why they can't load a file there alone."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager

STDOUT, STDERR = 1, 2


@contextmanager
def captured(streams: Sequence[int] = (STDOUT,), *, again: bool = True) -> Iterator[list[str]]:
    """A list that holds, once it is over, what was printed: the text of each stream.

    Args:
        streams: of the process.
        again: whether it is printed afterwards, for those who read it there.
    """
    texts: list[str] = []
    sys.stdout.flush()
    sys.stderr.flush()
    with ExitStack() as stack:
        kept = [os.dup(stream) for stream in streams]
        files = [stack.enter_context(tempfile.TemporaryFile()) for _ in streams]
        for stream, file in zip(streams, files, strict=True):
            os.dup2(file.fileno(), stream)
        try:
            yield texts
        finally:
            for stream, own, file in zip(streams, kept, files, strict=True):
                os.dup2(own, stream)
                os.close(own)
                file.seek(0)
                data = file.read()
                if again:
                    os.write(stream, data)
                texts.append(data.decode("utf-8", errors="replace"))
