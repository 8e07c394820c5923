"""What became of a case."""

from __future__ import annotations

from enum import StrEnum

FLOOR = 0.01
"""A component that hardly moves in one scenario is measured against this share of how far it moves
in the system's others."""


class Outcome(StrEnum):
    """Result of a case; worst last when sorted by `severity`."""

    AGREES = "AGREES"
    ABSENT = "ABSENT"
    REFUSED = "REFUSED"
    UNRESOLVED = "UNRESOLVED"
    DIFFERS = "DIFFERS"
    FAILED = "FAILED"

    @property
    def meaning(self) -> str:
        """What it says of a case, in a few words."""
        return _MEANINGS[self]

    @property
    def is_run(self) -> bool:
        """Whether the engine ran the case to its end."""
        return self not in (Outcome.ABSENT, Outcome.REFUSED, Outcome.FAILED)

    @property
    def severity(self) -> int:
        """Rank among the outcomes, 0 is best."""
        return list(Outcome).index(self)


_MEANINGS = {
    Outcome.AGREES: "no difference beyond the uncertainty, or none above the resolution asked",
    Outcome.ABSENT: "the engine is not installed; nothing was tested",
    Outcome.REFUSED: "the engine does not load this file; nothing was tested in it",
    Outcome.UNRESOLVED: "no difference that could be told from the uncertainty, which is too large",
    Outcome.DIFFERS: "a difference beyond uncertainty and resolution: the model is another one",
    Outcome.FAILED: "it could not be run to its end",
}
