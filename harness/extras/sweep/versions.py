"""Differences of a sweep's cases between versions of an engine, row by row."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

from physics_crosscheck.harness.baseline.diff import diff_cases
from physics_crosscheck.harness.extras.sweep.most import LargestItems
from physics_crosscheck.harness.records.diff import Changed, Diff
from physics_crosscheck.harness.records.sweep import SweepRow

MAX_LISTED = 5
"""Maximum number of listed cases."""


@dataclass(frozen=True, kw_only=True)
class CasePair:
    """A case under two versions, and its difference."""

    before: SweepRow
    after: SweepRow
    diff: Diff

    @property
    def index(self) -> int:
        """Number of the case in the plan."""
        return self.after.index

    @property
    def size(self) -> float | None:
        """Rank of the difference, larger for a more important one; None without a difference."""
        changed = self.diff.changed
        if not changed:
            return None
        then, now = self.diff.global_errors
        error = abs(now - then) / then if then and now is not None else 0.0
        return 2 * ("verdict" in changed) + ("discrepancy" in changed) + error / (1 + error)


@dataclass
class Moved:
    """Differences between two versions.

    Attributes:
        cases: number of common cases.
        changed: number of cases by what changed.
        largest: listed cases, most important first.
    """

    cases: int = 0
    changed: Counter[Changed] = field(default_factory=Counter)
    largest: list[CasePair] = field(default_factory=list)


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
        earlier = earlier_rows.pop(row.index)
        diff = diff_cases(row.id, earlier.numbers, row.numbers)
        changes.cases += 1
        changes.changed.update(diff.changed)
        largest.add(CasePair(before=earlier, after=row, diff=diff))
    changes.largest = largest.items()
    return changes
