"""Worker processes that don't import the program that started them."""

from __future__ import annotations

import contextlib
import sys
import types
from collections.abc import Iterator


@contextlib.contextmanager
def without_main() -> Iterator[None]:
    """Processes started meanwhile are not told of `__main__`.

    multiprocessing would import it in each: pytest for nothing, a script without a guard for `if
    __name__ == "__main__"` to run itself again, and one from stdin not at all.
    """
    main = sys.modules["__main__"]
    sys.modules["__main__"] = types.ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main
