"""Differences of a sweep's cases between versions of an engine, row by row."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from physics_crosscheck.harness.extras.sweep.most import LargestItems
from physics_crosscheck.harness.records.sweep import SweepRow

MOVED = 0.01
"""Minimum relative change of a global error to report."""

MAX_LISTED = 5
"""Maximum number of listed cases."""


@dataclass(frozen=True, kw_only=True)
class CasePair:
    """A case under two versions."""

    before: SweepRow
    after: SweepRow

    @property
    def verdict(self) -> bool:
        """True if the outcomes differ."""
        return self.before.outcome is not self.after.outcome

    @property
    def limit(self) -> bool:
        """True if the discrepancies differ by more than both uncertainties."""
        earlier, other = self.before, self.after
        sizes = earlier.discrepancy, other.discrepancy, earlier.uncertainty, other.uncertainty
        if any(size is None for size in sizes):
            return False
        e, f, u, v = (size or 0.0 for size in sizes)
        return abs(e - f) > u + v

    @property
    def error(self) -> float:
        """Relative change of the error at the time step; 0 without one."""
        earlier, other = self.before.global_error, self.after.global_error
        if not earlier or other is None:
            return 0.0
        return abs(other - earlier) / earlier

    @property
    def index(self) -> int:
        """Number of the case in the plan."""
        return self.after.index

    @property
    def size(self) -> float | None:
        """Rank of the difference, larger for a more important one; None without a difference."""
        if not (self.verdict or self.limit or self.error > MOVED):
            return None
        return 2 * self.verdict + self.limit + self.error / (1 + self.error)


@dataclass
class Moved:
    """Differences between two versions.

    Attributes:
        cases: number of common cases.
        verdicts, limits, errors: number of cases in which these differ.
        largest: listed cases, most important first.
    """

    cases: int = 0
    verdicts: int = 0
    limits: int = 0
    errors: int = 0
    largest: list[CasePair] = field(default_factory=list)

    @property
    def any(self) -> bool:
        """True if anything differs."""
        return bool(self.verdicts or self.limits or self.errors)


def moved(before: Iterable[SweepRow], after: Iterable[SweepRow]) -> Moved:
    """Compare the rows of two versions, by their numbers.

    Rows of one number have the same draw. The rows of the earlier version stay in memory, about 2
    kB each.
    """
    earlier_rows = {row.index: row for row in before}
    changes = Moved()
    largest = LargestItems[CasePair](lambda pair: pair.size, MAX_LISTED)
    for row in after:
        if row.index not in earlier_rows:
            continue
        pair = CasePair(before=earlier_rows.pop(row.index), after=row)
        changes.cases += 1
        changes.verdicts += pair.verdict
        changes.limits += pair.limit
        changes.errors += pair.error > MOVED
        largest.add(pair)
    changes.largest = largest.items()
    return changes
