"""Outcome of a case."""

import math
from enum import StrEnum
from typing import Any

FLOOR = 0.01
"""Smallest scale of a component in a scenario.

It is a share of the component's movement in the system's other scenarios.
"""

COARSEST = 1e-2
"""Coarsest resolution of a verdict, requested or by the digits of an engine's numbers."""

ROUNDED = 3.5
"""Smallest uncertainty of an extrapolated limit, as a multiple of its rounding.

It is the rounding plus 2.5 times the change of the estimates (`harness.numerics.ladder.limits`), if
rounding alone changes them.
"""


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
        """Short description of the outcome."""
        return _MEANINGS[self]

    @property
    def is_run(self) -> bool:
        """True if the engine ran the case to its end."""
        return self not in (Outcome.ABSENT, Outcome.REFUSED, Outcome.FAILED)

    @property
    def severity(self) -> int:
        """Rank among the outcomes; 0 is best."""
        return list(Outcome).index(self)


def differs(discrepancy: Any, uncertainty: Any, resolution: float) -> Any:
    """Return whether E > U and E + U is above the resolution; also for arrays.

    Args:
        discrepancy, uncertainty: E and U, relative.
        resolution: the requested resolution, or the one that the engine's precision allows.
    """
    return (discrepancy > uncertainty) & (discrepancy + uncertainty > resolution)


def contradiction(
    outcome: Outcome, discrepancy: float | None, uncertainty: float | None, resolution: float
) -> str:
    """Return how an outcome contradicts its own E and U; empty if it does not.

    A case can be UNRESOLVED because of its full runs, as long as its segments do not differ.
    """
    if outcome in (Outcome.ABSENT, Outcome.FAILED):
        return ""
    e = math.nan if discrepancy is None else discrepancy
    u = math.inf if uncertainty is None else uncertainty
    apart = bool(differs(e, u, resolution))
    agrees = e >= 0 and 0 <= u <= resolution and not apart
    if {Outcome.AGREES: agrees, Outcome.DIFFERS: apart}.get(outcome, not apart):
        return ""
    return f"{outcome} contradicts E = {e:.1e} and U = {u:.1e} at the resolution {resolution:.1e}"


_MEANINGS = {
    Outcome.AGREES: "no difference above the uncertainty or the resolution",
    Outcome.ABSENT: "no engine is installed for it, or nothing moves, so nothing was tested",
    Outcome.REFUSED: "the engine does not load this file, so nothing was tested in it",
    Outcome.UNRESOLVED: "the uncertainty is too large to decide",
    Outcome.DIFFERS: "a difference above the uncertainty and the resolution",
    Outcome.FAILED: "the case did not run to its end",
}
