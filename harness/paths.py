"""Paths of this package, in a checkout and where it is installed, and shared defaults."""

import os
from pathlib import Path

HARNESS = Path(os.path.abspath(__file__)).parent
"""Folder of this package as imported: in a checkout, a link to `harness`."""

PACKAGE = HARNESS.parent

IMPORT_ROOT = PACKAGE.parent
"""Folder of `sys.path` in which `physics_crosscheck` is."""

DEFAULT_FOLDER = Path("reports/baseline")
"""Default folder of the baseline."""

RESOLUTION = 1e-9
"""Relative discrepancy to resolve, unless another is requested."""

SOURCES = (HARNESS, PACKAGE / "reference")
"""Folders of the code that results depend on."""


def is_own(file: str) -> bool:
    """Return whether a file belongs to this package, by either of its paths in a checkout."""
    return file.startswith(_ROOTS)


_FOLDERS = {str(folder) for one in (PACKAGE, *SOURCES) for folder in (one, one.resolve())}
_ROOTS = tuple(f"{folder}{os.sep}" for folder in sorted(_FOLDERS))
