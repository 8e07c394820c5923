"""What is installed: versions, looked up once for a path that has not changed, and modules."""

from __future__ import annotations

import importlib
import importlib.metadata
import importlib.util
import os
import sys
import warnings
from functools import lru_cache
from typing import Any

Path = tuple[tuple[str, int], ...]


def python_path() -> Path:
    """Where Python looks for what is installed, and when something was put there."""
    found = []
    for folder in sys.path:
        try:
            found.append((folder, os.stat(folder or os.curdir).st_mtime_ns))
        except OSError:
            found.append((folder, 0))
    return tuple(found)


def version_of(package: str, distribution: str) -> str | None:
    """Version of a distribution whose package can be imported; None where it can't.

    "unknown" where the package comes from elsewhere, as ROS has some.
    """
    return _looked_up(package, distribution, python_path())


@lru_cache(maxsize=64)
def _looked_up(package: str, distribution: str, _: Path) -> str | None:
    if importlib.util.find_spec(package) is None:
        return None
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return "unknown"


def quietly(name: str) -> Any:
    """A module whose import warns: SWIG's ends the process where warnings are errors."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return importlib.import_module(name)
