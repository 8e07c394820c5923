"""Installed packages: versions, cached while the Python path is unchanged, and modules."""

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
