"""Why a task has no value."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.case import CaseKind
from physics_crosscheck.harness.results.visible import visible

LONGEST = 600
"""Characters of a reason: whoever raised it may have said a megabyte, which nobody reads."""

_END = 150
"""Of them at its end, where the remedy stands."""


@dataclass(frozen=True)
class Failure:
    """Why a task has no value: one sentence, and what was printed meanwhile.

    Attributes:
        reason: in one line, of a length that a person reads; what can't be shown is escaped.
        usage: whether what was asked makes no sense, rather than something having gone wrong.
        locations: where that is in the user's files, as far as it is known.
        kind: of the failure, as a case reports it; empty where no rule names it.
    """

    reason: str
    stdout: str
    usage: bool = False
    locations: tuple[SourceLine, ...] = ()
    kind: CaseKind = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "reason", _sentence(self.reason))

    def about(self, file: Path) -> str:
        """The reason, with the file that it is about where it does not name it itself."""
        return self.reason if file.name in self.reason else f"{visible(str(file))}: {self.reason}"


def failure_of(error: BaseException, reason: str = "") -> Failure:
    """Return the failure of an error, with the lines that the error knows.

    Args:
        error: of ours, or any other.
        reason: in words; those of the error where none are given.
    """
    files = [error, *getattr(error, "obstacles", ())]
    found = [(getattr(one, "file", None), getattr(one, "line", None)) for one in files]
    locations = tuple(SourceLine(file=str(file), line=line or None) for file, line in found if file)
    kind: CaseKind = getattr(error, "kind", "")  # an engine outside this package may have its own
    kind = kind if kind in get_args(CaseKind) else ""
    return Failure(reason or str(error), "", locations=locations, kind=kind)


def _sentence(text: str) -> str:
    """A text as a reason is told."""
    if len(text) > LONGEST:
        text = f"{text[: LONGEST - _END - 5]} ... {text[-_END:]}"
    lines = (line.strip() for line in text.replace("\t", " ").splitlines())
    return visible(" ".join(filter(None, lines)))
