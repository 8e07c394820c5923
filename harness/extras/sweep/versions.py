"""What a version of an engine makes another of a sweep's cases, row by row."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from physics_crosscheck.harness.extras.sweep.most import Most
from physics_crosscheck.harness.records.sweep import SweepRow

MOVED = 0.01
"""A global error that has changed by more than this share of itself is another."""

TOLD = 5
"""Cases that are told one by one."""


@dataclass(frozen=True, kw_only=True)
class Pair:
    """A case under two versions."""

    before: SweepRow
    after: SweepRow

    @property
    def verdict(self) -> bool:
        """Whether the outcome is another."""
        return self.before.outcome is not self.after.outcome

    @property
    def limit(self) -> bool:
        """Whether the discrepancies differ by more than both uncertainties."""
        one, other = self.before, self.after
        sizes = one.discrepancy, other.discrepancy, one.uncertainty, other.uncertainty
        if any(size is None for size in sizes):
            return False
        e, f, u, v = (size or 0.0 for size in sizes)
        return abs(e - f) > u + v

    @property
    def error(self) -> float:
        """By what share of itself the error at the shipped step has changed; 0 without one."""
        one, other = self.before.global_error, self.after.global_error
        if not one or other is None:
            return 0.0
        return abs(other - one) / one

    @property
    def index(self) -> int:
        """The case's number in the plan."""
        return self.after.index

    @property
    def size(self) -> float | None:
        """The larger, the more it is to be looked at; None where nothing is another."""
        if not (self.verdict or self.limit or self.error > MOVED):
            return None
        return 2 * self.verdict + self.limit + self.error / (1 + self.error)


@dataclass
class Moved:
    """What is another between two versions.

    Attributes:
        cases: that both have.
        verdicts, limits, errors: cases of which these are others.
        largest: those that are told, the most telling first.
    """

    cases: int = 0
    verdicts: int = 0
    limits: int = 0
    errors: int = 0
    largest: list[Pair] = field(default_factory=list)

    @property
    def any(self) -> bool:
        """Whether anything is another."""
        return bool(self.verdicts or self.limits or self.errors)


def moved(before: Iterable[SweepRow], after: Iterable[SweepRow]) -> Moved:
    """Hold the rows of two versions against each other, by their numbers.

    A number's row is the same draw under both. Those of the version before are kept as they are
    read: some 2 kB each.
    """
    known = {row.index: row for row in before}
    found = Moved()
    told = Most[Pair](lambda pair: pair.size, TOLD)
    for row in after:
        if row.index not in known:
            continue
        pair = Pair(before=known.pop(row.index), after=row)
        found.cases += 1
        found.verdicts += pair.verdict
        found.limits += pair.limit
        found.errors += pair.error > MOVED
        told.add(pair)
    found.largest = told.items()
    return found
