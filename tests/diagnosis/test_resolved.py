"""Which ends a diagnosis stands on, where they are known to different digits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from physics_crosscheck.harness.diagnosis.diagnose import diagnose
from physics_crosscheck.harness.diagnosis.fit import Hypothesis
from physics_crosscheck.harness.records.cause import CauseId
from physics_crosscheck.reference.mechanism.numeric import Array


@dataclass(frozen=True)
class Linear:
    """A discrepancy, and what units of some faults do to it, (H, N)."""

    found: Array
    rows: Array

    @property
    def hypotheses(self) -> Sequence[Hypothesis]:
        return [
            Hypothesis(id=CauseId(kind="literal", subject=(f"{i}",)), value=1.0, size=1.0, rank=0)
            for i in range(len(self.rows))
        ]

    def defect(self, faults: Mapping[int, float]) -> Array:
        left: Array = self.found - sum(by * self.rows[i] for i, by in faults.items())
        return left

    def slopes(self, faults: Mapping[int, float], of: Sequence[int] | None = None) -> Array:
        return self.rows if of is None else self.rows[list(of)]


def test_ends_that_are_known_best_do_not_count_alone_where_nothing_shows_at_them() -> None:
    """A slow component is known to 1e-13 and moved by no fault; a soft one drowns the others."""
    random = np.random.default_rng(2)
    best, bad = slice(0, 30), slice(90, 120)
    rows = random.normal(size=(6, 120))
    rows[:, best] = 1e-9 * random.normal(size=(6, 30))
    uncertainty = np.full(120, 2e-9)
    uncertainty[best], uncertainty[bad] = 1e-12, 3e-6
    found = 1e-7 * rows[4] + 0.1 * uncertainty * random.normal(size=120)
    ranking = diagnose(Linear(found, rows), uncertainty)
    assert ranking.explained
    assert ranking.fits[0].members == (4,)
    assert abs(ranking.fits[0].faults[0] / 1e-7 - 1) < 1e-2
