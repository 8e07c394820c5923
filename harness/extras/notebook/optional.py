"""Packages that are used where they are installed, and imported when they are asked for."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Mapping, Sequence
from typing import Any

from physics_crosscheck.reference.mechanism.numeric import Array

INSTALL = "pip install 'physics-crosscheck[notebook]'"

FRAMES = ("pandas", "polars")
"""Libraries of tables, the preferred one first."""


class MissingPackageError(ImportError):
    """A package that is not installed; the message says what installs it."""


def frame(columns: Mapping[str, Sequence[object] | Array], library: str = "") -> Any:
    """A table of columns that are equally long.

    Args:
        columns: by their headings.
        library: "pandas" or "polars"; empty: the first of these that is installed.

    Raises:
        MissingPackageError: where it is not installed.
        ValueError: for another library.
    """
    if library not in ("", *FRAMES):
        raise ValueError(f"no tables are made with {library!r}; {' and '.join(FRAMES)} are known")
    for name in [library] if library else FRAMES:
        if importlib.util.find_spec(name) is not None:
            return importlib.import_module(name).DataFrame(dict(columns))
    if library:
        raise MissingPackageError(f"{library} is not installed: pip install {library}")
    raise MissingPackageError(
        f"to_frame() needs {' or '.join(FRAMES)}, and neither is installed: {INSTALL}"
    )


def new_axes(rows: int, height: float) -> Any:
    """A figure of panels above one another that share their abscissa, as an array of axes.

    Args:
        rows: how many.
        height: of each, inches.

    Raises:
        MissingPackageError: where matplotlib is not installed.
    """
    if importlib.util.find_spec("matplotlib") is None:
        raise MissingPackageError(f"plot() needs matplotlib, which is not installed: {INSTALL}")
    pyplot = importlib.import_module("matplotlib.pyplot")
    size = (7.5, height * rows + 0.6)
    _, axes = pyplot.subplots(
        rows, 1, sharex=True, squeeze=False, layout="constrained", figsize=size
    )
    return axes[:, 0]
