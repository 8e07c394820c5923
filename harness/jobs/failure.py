"""Failures of tasks, and the lines of user files that were running."""

import re
import sys
import sysconfig
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from physics_crosscheck.harness.paths import is_own
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.case import CaseKind
from physics_crosscheck.harness.results.visible import visible

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


LONGEST = 600
"""Maximum number of characters in a reason; an error message may be a megabyte long."""

_END = 150
"""Number of these characters from the end, which contains the remedy."""


@dataclass(frozen=True)
class Failure:
    """The reason for a task's missing value: one sentence, and its printed output.

    Attributes:
        reason: one line of limited length; unprintable characters are escaped.
        usage: whether the request itself is invalid, as opposed to an error during the task.
        locations: places in the user's files, if known.
        kind: kind of the failure for the case's record; empty if no rule names it.
    """

    reason: str
    stdout: str
    usage: bool = False
    locations: tuple[SourceLine, ...] = ()
    kind: CaseKind = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "reason", _sentence(self.reason))

    def about(self, file: Path) -> str:
        """Return the reason, with the name of the file unless it contains it."""
        return self.reason if file.name in self.reason else f"{visible(str(file))}: {self.reason}"


def failure_of(error: BaseException, reason: str = "") -> Failure:
    """Return the failure of an error, with the source lines that the error provides.

    Args:
        error: any error.
        reason: text of the reason; empty: the text of the error.
    """
    files = [error, *getattr(error, "obstacles", ())]
    places = [(getattr(one, "file", None), getattr(one, "line", None)) for one in files]
    locations = tuple(
        SourceLine(file=str(file), line=line or None) for file, line in places if file
    )
    kind: CaseKind = getattr(error, "kind", "")  # other engines may define kinds
    kind = kind if kind in get_args(CaseKind) else ""
    usage = bool(getattr(error, "usage", False))
    return Failure(reason or str(error), "", usage, locations, kind)


def _sentence(text: str) -> str:
    """Format a text as a reason."""
    if len(text) > LONGEST:
        text = f"{text[: LONGEST - _END - 5]} ... {text[-_END:]}"
    lines = (line.strip() for line in text.replace("\t", " ").splitlines())
    return visible(" ".join(filter(None, lines)))
