"""Worker processes that do not import the program that started them."""

from __future__ import annotations

import contextlib
import sys
import types
from collections.abc import Iterator


@contextlib.contextmanager
def without_main() -> Iterator[None]:
    """Hide `__main__` from processes that start meanwhile.

    multiprocessing would import it in each process. That wastes time for pytest, runs a script
    again that has no `if __name__ == "__main__"` guard, and fails for a script from stdin.
    """
    main = sys.modules["__main__"]
    sys.modules["__main__"] = types.ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main
