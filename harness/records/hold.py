"""A file that one program at a time holds."""

from __future__ import annotations

try:
    import fcntl
except ImportError:  # not there on Windows
    _LOCKS = False
else:
    _LOCKS = True


def hold(file: int, *, wait: bool = False) -> bool:
    """Hold an open file until it is closed; whether no other program does.

    Where the system or the file's file system has no locks, programs are not told of each other.

    Args:
        wait: until the other program has closed it.
    """
    if _LOCKS:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            return False
        except OSError:
            return True  # a file system without locks
    return True
