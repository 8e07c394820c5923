"""Summarize rows in one pass and constant memory."""

from __future__ import annotations

import heapq
import math
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np

from physics_crosscheck.harness.records.base import number
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.harness.records.sweep import SweepGroup, SweepPlan, SweepRow, SweepSummary


class LargestRows:
    """The largest rows up to a maximum number; of equal ones, those with the lowest numbers."""

    def __init__(self, size: Callable[[SweepRow], float | None], count: int) -> None:
        self._size, self._count = size, count
        self._heap: list[tuple[float, int, SweepRow]] = []

    def add(self, entry: SweepRow) -> None:
        """Add an item, unless it has no size."""
        value = self._size(entry)
        if value is None or math.isnan(value):
            return
        item = value, -entry.index, entry
        if len(self._heap) < self._count:
            heapq.heappush(self._heap, item)
        elif item > self._heap[0]:
            heapq.heapreplace(self._heap, item)

    def items(self) -> list[SweepRow]:
        """Return the items, largest first."""
        return [one for *_, one in sorted(self._heap, reverse=True)]


TROUBLES, EXTREMES = 10, 3
"""Listed cases: the worst without agreement; those with the fewest digits or largest errors."""

POINTS = 2000
"""Maximum number of points in a plot; more would overlap."""


def _badness(row: SweepRow) -> float | None:
    """Rank a case that does not agree: worse outcomes and larger discrepancies are larger."""
    if row.outcome is Outcome.AGREES:
        return None
    size = row.discrepancy or 0.0
    return row.outcome.severity + size / (1 + size)


def _few_digits(row: SweepRow) -> float | None:
    return -row.digits if row.outcome is Outcome.AGREES and row.digits is not None else None


def _error(row: SweepRow) -> float | None:
    return None if row.outcome is Outcome.FAILED else row.global_error


@dataclass
class _Group:
    outcomes: Counter[str] = field(default_factory=Counter)
    digits: float = math.inf
    error: float = -math.inf

    def add(self, row: SweepRow) -> None:
        self.outcomes[row.outcome.value] += 1
        if row.outcome is Outcome.AGREES and row.digits is not None:
            self.digits = min(self.digits, row.digits)
        if row.outcome is not Outcome.FAILED and row.global_error is not None:
            self.error = max(self.error, row.global_error)


def summary(plan: SweepPlan, rows: Iterable[SweepRow]) -> SweepSummary:
    """Summarize all rows in one pass."""
    done = steps = 0
    outcomes, digits = Counter[str](), Counter[str]()
    groups: dict[tuple[str, str, str], _Group] = {}
    extremes = (
        LargestRows(_badness, TROUBLES),
        LargestRows(_few_digits, EXTREMES),
        LargestRows(_error, EXTREMES),
    )
    rng = np.random.default_rng(0)
    sampled: list[SweepRow] = []
    seconds = np.zeros(4)
    for row in rows:
        done += 1
        steps += row.steps
        seconds += (row.engine_seconds, row.reference_seconds, row.loading_seconds, row.seconds)
        outcomes[row.outcome.value] += 1
        if row.outcome is Outcome.AGREES and row.digits is not None:
            digits[str(math.floor(row.digits))] += 1
        groups.setdefault((row.system, row.engine, row.integrator), _Group()).add(row)
        for ranking in extremes:
            ranking.add(row)
        if len(sampled) < POINTS:
            sampled.append(row)
        elif (place := int(rng.integers(done))) < POINTS:  # reservoir sampling (Vitter 1985)
            sampled[place] = row
    worst = {row.index: row for ranking in extremes for row in ranking.items()}
    engine, reference, loading, every = seconds.tolist()
    return SweepSummary(
        plan=plan,
        done=done,
        outcomes={o.value: outcomes[o.value] for o in reversed(Outcome) if outcomes[o.value]},
        digits={name: digits[name] for name in sorted(digits, key=int)},
        groups=tuple(
            SweepGroup(
                system=system,
                engine=engine_name,
                integrator=integrator,
                outcomes=dict(group.outcomes),
                least_digits=number(group.digits),
                worst_error=number(group.error),
            )
            for (system, engine_name, integrator), group in sorted(groups.items())
        ),
        worst=tuple(worst.values()),
        sampled=tuple(sorted(sampled, key=lambda row: row.index)),
        steps=steps,
        engine_seconds=engine,
        reference_seconds=reference,
        loading_seconds=loading,
        seconds=every,
    )
