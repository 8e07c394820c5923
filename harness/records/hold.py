"""Lock a file against other programs."""

from __future__ import annotations

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
