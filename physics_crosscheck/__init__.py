"""The way in, by a name of its own: `harness` and `reference` are names that others use too.

Importing this module binds both names, in this process, to the packages that lie beside it,
whatever the working folder, PYTHONPATH or pytest put before them. They are imported when needed.
"""

from __future__ import annotations

import importlib.machinery
import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from pathlib import Path
from types import ModuleType

OWN = ("harness", "reference")
BESIDE = Path(__file__).resolve().parents[1]


class _Own(MetaPathFinder):
    """Finds this distribution's packages where they are."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if name not in OWN:
            return None
        return importlib.machinery.PathFinder.find_spec(name, [str(BESIDE)])


def claim() -> None:
    """Bind the names; what a worker process does first.

    Raises:
        ImportError: where a package of one of these names, not ours, is imported already.
    """
    for name in OWN:
        loaded = sys.modules.get(name)
        if loaded is not None and not _ours(getattr(loaded, "__file__", None), name):
            raise ImportError(
                f"a package {name!r} that is not physics-crosscheck's is imported already, from"
                f" {getattr(loaded, '__file__', None) or 'somewhere'}; a process can have one of"
                " that name: run `crosscheck` in one of its own"
            )
    if not any(isinstance(finder, _Own) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Own())


def _ours(file: str | None, name: str) -> bool:
    return file is not None and Path(file).resolve().parent == BESIDE / name


claim()
