"""Installed packages: versions, cached while the Python path is unchanged, modules, and the output
that their libraries write past Python, often the only explanation of a load error.
"""

import importlib
import importlib.metadata
import importlib.util
import os
import sys
import tempfile
import warnings
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import lru_cache
from typing import Any

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


Path = tuple[tuple[str, int], ...]


def python_path() -> Path:
    """Return the folders of the Python path with their modification times."""
    entries = []
    for folder in sys.path:
        try:
            entries.append((folder, os.stat(folder or os.curdir).st_mtime_ns))
        except OSError:
            entries.append((folder, 0))
    return tuple(entries)


def version_of(package: str, distribution: str) -> str | None:
    """Return the version of a distribution, or None if its package can't be imported.

    "unknown" for a package without that distribution, as some of ROS.
    """
    return _cached_version(package, distribution, python_path())


@lru_cache(maxsize=64)
def _cached_version(package: str, distribution: str, _: Path) -> str | None:
    if importlib.util.find_spec(package) is None:
        return None
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return "unknown"


def import_quietly(name: str) -> Any:
    """Import a module whose import warns: SWIG modules end the process if warnings are errors."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return importlib.import_module(name)
