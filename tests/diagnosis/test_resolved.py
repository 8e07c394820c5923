"""Diagnoses from ends with different uncertainties."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from physics_crosscheck.harness.diagnosis.diagnose import diagnose
from physics_crosscheck.harness.diagnosis.fit import Hypothesis
from physics_crosscheck.records import CauseId
from physics_crosscheck.reference.mechanism.numeric import Array


@dataclass(frozen=True)
class Linear:
    """A discrepancy, (N,), and the effects of unit faults, (H, N)."""

    discrepancy: Array
    rows: Array

    @property
    def hypotheses(self) -> Sequence[Hypothesis]:
        return [
            Hypothesis(id=CauseId(kind="literal", subject=(f"{i}",)), value=1.0, size=1.0, rank=0)
            for i in range(len(self.rows))
        ]

    def defect(self, faults: Mapping[int, float]) -> Array:
        residual: Array = self.discrepancy - sum(by * self.rows[i] for i, by in faults.items())
        return residual

    def slopes(self, faults: Mapping[int, float], indices: Sequence[int] | None = None) -> Array:
        return self.rows if indices is None else self.rows[list(indices)]


def test_precise_ends_without_effect_do_not_decide_the_diagnosis() -> None:
    """Combine a precise component without effect with one of large uncertainty."""
    random = np.random.default_rng(2)
    precise, imprecise = slice(0, 30), slice(90, 120)
    rows = random.normal(size=(6, 120))
    rows[:, precise] = 1e-9 * random.normal(size=(6, 30))
    uncertainty = np.full(120, 2e-9)
    uncertainty[precise], uncertainty[imprecise] = 1e-12, 3e-6
    discrepancy = 1e-7 * rows[4] + 0.1 * uncertainty * random.normal(size=120)
    ranking = diagnose(Linear(discrepancy, rows), uncertainty)
    assert ranking.explained
    assert ranking.fits[0].members == (4,)
    assert abs(ranking.fits[0].faults[0] / 1e-7 - 1) < 1e-2
