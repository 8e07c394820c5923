"""What became of a case."""

from __future__ import annotations

from enum import StrEnum

FLOOR = 0.01
"""A component that hardly moves in one scenario is measured against this share of how far it moves
in the system's others."""


class Outcome(StrEnum):
    """What became of a case; worst last when sorted by `severity`."""

    AGREES = "AGREES"
    ABSENT = "ABSENT"
    UNRESOLVED = "UNRESOLVED"
    DIFFERS = "DIFFERS"
    FAILED = "FAILED"

    @property
    def severity(self) -> int:
        """Rank among the outcomes, 0 is best."""
        return list(Outcome).index(self)
