"""Output that an engine's libraries write past Python: often the only explanation of a load
error.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager

STDOUT, STDERR = 1, 2


@contextmanager
def capture_output(
    streams: Sequence[int] = (STDOUT,), *, again: bool = True
) -> Iterator[list[str]]:
    """Yield a list that holds the text of each stream after the block ends.

    Args:
        streams: file descriptors of the process.
        again: whether the text is printed again afterwards.
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
            for stream, saved, file in zip(streams, kept, files, strict=True):
                os.dup2(saved, stream)
                os.close(saved)
                file.seek(0)
                data = file.read()
                if again:
                    os.write(stream, data)
                texts.append(data.decode("utf-8", errors="replace"))
