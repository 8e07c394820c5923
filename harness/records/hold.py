"""Lock a file or a folder against other programs."""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from .read import ResultsError

try:
    import fcntl
except ImportError:  # missing on Windows
    _LOCKS = False
else:
    _LOCKS = True


def hold(file: int, *, wait: bool = False) -> bool:
    """Lock an open file until it is closed; return whether no other program holds the lock.

    On systems or file systems without locks, this always succeeds.

    Args:
        wait: whether to wait until the other program has closed the file.
    """
    if _LOCKS:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            return False
        except OSError:
            return True  # a file system without locks
    return True


@contextlib.contextmanager
def locked(folder: Path, program: str) -> Iterator[None]:
    """Lock a folder of results, created if missing, within this context.

    Raises:
        ResultsError: if another program, such as a run, has locked it.
        OSError: if it can't be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / ".lock"
    with path.open("w") as file:
        is_ours = hold(file.fileno())
        with contextlib.suppress(OSError):  # another program may have removed it meanwhile
            is_ours = is_ours and os.path.samestat(os.fstat(file.fileno()), path.stat())
        if not is_ours:
            raise ResultsError(
                f"another {program} is writing to {folder}; choose another folder: --out"
            )
        try:
            yield
        finally:
            with contextlib.suppress(OSError):
                path.unlink()
