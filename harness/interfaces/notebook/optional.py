"""Optional packages, imported on first use."""

import importlib
import importlib.util
from collections.abc import Mapping, Sequence
from typing import Any

from physics_crosscheck.reference.mechanism.numeric import Array

INSTALL = "pip install 'physics-crosscheck[notebook]'"

FRAMES = ("pandas", "polars")
"""Table libraries, in order of preference."""


class MissingPackageError(ImportError):
    """An error about a package that is not installed; the message gives the install command."""


def frame(columns: Mapping[str, Sequence[object] | Array], library: str = "") -> Any:
    """Build a table of columns of equal length.

    Args:
        columns: columns by their headings.
        library: "pandas" or "polars"; empty: the first that is installed.

    Raises:
        MissingPackageError: if it is not installed.
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
    """Create a figure of stacked panels with a common x axis; return an array of axes.

    Args:
        rows: number of panels.
        height: height of each panel, inches.

    Raises:
        MissingPackageError: without matplotlib.
    """
    if importlib.util.find_spec("matplotlib") is None:
        raise MissingPackageError(f"plot() needs matplotlib, which is not installed: {INSTALL}")
    pyplot = importlib.import_module("matplotlib.pyplot")
    size = (7.5, height * rows + 0.6)
    _, axes = pyplot.subplots(
        rows, 1, sharex=True, squeeze=False, layout="constrained", figsize=size
    )
    return axes[:, 0]
