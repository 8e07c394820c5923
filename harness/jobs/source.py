"""Lines of user files that were running: from a traceback, or from the trace of a dead process."""

from __future__ import annotations

import re
import sys
import sysconfig
from collections.abc import Iterable
from pathlib import Path

from physics_crosscheck.harness.paths import is_own

_LIBRARIES = ("stdlib", "platstdlib", "purelib", "platlib")


def package_folders() -> frozenset[str]:
    """Return the folders of installed packages, including those that a `.pth` adds to an
    environment.
    """
    names = ("site-packages", "dist-packages")
    return frozenset(path for path in sys.path if Path(path).name in names)


_THEIRS = tuple({sysconfig.get_path(name) for name in _LIBRARIES} | package_folders())
_NOT_USERS = (*_THEIRS, "<")

_FRAME = re.compile(r'^  File "(.*)", line (\d+) in ', re.MULTILINE)
"""Frame in the format of faulthandler, innermost first."""


def user_line(frames: Iterable[tuple[str, int | None]]) -> str:
    """Return `file:line` of the innermost frame outside of this package and all libraries; "" if
    none.

    Args:
        frames: file and line of each frame, innermost first.
    """
    for file, line in frames:
        if not (is_own(file) or file.startswith(_NOT_USERS)):
            return f"{file}:{line}"
    return ""


def line_of_death(trace: Path) -> str:
    """Return the same for the trace that faulthandler wrote before a process ended."""
    try:
        text = trace.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
    return user_line((file, int(line)) for file, line in _FRAME.findall(text))
