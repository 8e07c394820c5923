"""Diagnosis of a discrepancy from motions: fit each hypothesis, and rank them.

Each hypothesis is one number: a literal of the model file, changed in the engine's model, or a
constant or missing term, changed in the equations. Each is fitted to the defects of all
scenarios together (Gauss-Newton). The ranking is by the remaining discrepancy. If no single
hypothesis explains it, pairs are fitted (`harness.diagnosis.pairs`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from physics_crosscheck.harness.diagnosis.fit import (
    Fit,
    FitProblem,
    Hypothesis,
    Resolved,
    Try,
    cosine,
    left_linear,
    refine_each,
)
from physics_crosscheck.harness.diagnosis.pairs import ALIKE, pairs
from physics_crosscheck.reference.mechanism.numeric import Array

NAMED = 3e-3
"""Largest remaining share of the discrepancy, or the uncertainty, at which a cause is named."""

RESOLVED = (1e-3, 1e-2, 1e-1)
"""Uncertainties, as shares of the largest defect, above which end states are left out of the fit.

Uncertain end states, such as those where friction changes sign, would dominate. The first share
is used at which the discrepancy exceeds the uncertainty of the kept end states: a small
discrepancy may not be visible at the most accurate ones.
"""

MAX_VISIBLE_RATIO = 0.5
"""Largest ratio of uncertainty to discrepancy at which the discrepancy is visible."""

MAX_DOUBTFUL_REMAINING = 0.1
"""Largest remaining share where the uncertainty is as large as the discrepancy.

The uncertainty is a bound. Errors of its size would be part of no cause's effect, so that each
fit would leave as much.
"""

NEGLIGIBLE = 1e-6
"""Largest remaining share, or the uncertainty, at which no second cause is sought."""

DISTINCT_RATIO = 10.0
"""Ratio of remaining shares at which causes are distinguished, whatever the uncertainty.

The uncertainty is a bound: the best fit would leave errors of that size too.
"""

MIN_EFFECT, MIN_SWITCH_EFFECT = 1e-9, 1e-3
"""Smallest effects: of a change by a number's own size; of a switch, as a share of the
discrepancy."""

REFINED = 6
"""Minimum number of single hypotheses to fit: the best ones of the linear fit.

Hypotheses with the same effect are added. Callers with cheap fits request more.
"""


@dataclass(frozen=True)
class Ranking:
    """Ranked fits.

    Attributes:
        fits: best first; tied fits are adjacent.
        explained: whether the first leaves at most `NAMED`, or the uncertainty.
        floor: the uncertainty as a share of the discrepancy.
        switched_off: behaviours of the engine that were switched off for the fits.
    """

    fits: tuple[Fit, ...]
    explained: bool
    floor: float
    switched_off: tuple[str, ...] = ()


def diagnose(problem: FitProblem, uncertainty: Array, refined: int = REFINED) -> Ranking:
    """Rank hypotheses, and pairs of them, by the discrepancy that they leave.

    Args:
        problem: the discrepancy, with the effect of each fault.
        uncertainty: of the defect at each end, (N,).
        refined: minimum number of single hypotheses to fit.
    """
    whole = _resolved(problem, uncertainty)
    defect, slopes = whole.defect({}), whole.slopes({})
    hypotheses, floor = whole.hypotheses, whole.floor
    accepted, negligible = max(NAMED, 2 * floor), max(NEGLIGIBLE, 3 * floor)
    certain = accepted < 1
    accepted = accepted if certain else MAX_DOUBTFUL_REMAINING
    lengths = np.linalg.norm(slopes, axis=1)
    # A switch applies its whole change, however small: an engine's rounding may be the only cause.
    small = min(MIN_EFFECT, MIN_SWITCH_EFFECT * float(np.linalg.norm(defect)))
    least = [small if hypothesis.switch else MIN_EFFECT for hypothesis in hypotheses]
    seen = [i for i, h in enumerate(hypotheses) if lengths[i] * h.size > least[i]]
    remaining = {i: left_linear(defect, [hypotheses[i]], slopes[[i]]) for i in seen}
    order = sorted(seen, key=lambda i: remaining[i])
    # Report hypotheses with the same effect as a good one, even if their linear fit is worse.
    alike = [
        i for i in order[refined:] if any(_alike(whole, slopes, i, j) for j in order[:refined])
    ]
    # Also report switches that leave as little, which is no coincidence.
    switches = [i for i in order[refined:] if hypotheses[i].switch and remaining[i] <= accepted]
    chosen = (*order[:refined], *alike, *switches)
    tries = [Try(remaining[i], {i: _start(hypotheses[i])}, slopes) for i in chosen]
    fits = refine_each(whole, tries, negligible)
    if not fits:
        return Ranking((), False, floor)
    single = _ranked(whole, fits, slopes, negligible)
    best = min(fit.remaining for fit in single)
    is_single = best <= accepted
    if is_single and best <= negligible:
        return Ranking(tuple(single), True, floor)
    first = min(single, key=lambda fit: fit.remaining)
    double = pairs(whole, slopes, seen, first, negligible)
    if is_single:
        # A second, smaller fault may explain the discrepancy that the first one leaves.
        better = bool(double) and double[0].remaining < best / 100
        return Ranking((*double, *single) if better else tuple(single), True, floor)
    if certain and double and double[0].remaining <= accepted:
        return Ranking((*double, *single), True, floor)
    return Ranking((*single, *double[:1]), False, floor)


def _start(hypothesis: Hypothesis) -> float:
    """Return the initial fault: all of an unbound literal's value; others are probably small."""
    return hypothesis.value if hypothesis.id.kind == "unbound literal" else 0.0


def _resolved(problem: FitProblem, uncertainty: Array) -> Resolved:
    """Restrict a problem to accurate end states: all, or only those of smooth segments."""
    defect = problem.defect({})
    whole = np.ones(len(defect), dtype=bool)
    chosen = whole
    if _floor(defect, uncertainty, whole) > RESOLVED[0]:
        kept = (uncertainty <= share * np.abs(defect).max() for share in RESOLVED)
        stands_out = (one for one in kept if _floor(defect, uncertainty, one) <= MAX_VISIBLE_RATIO)
        chosen = next(stands_out, whole)
    size = float(np.linalg.norm(defect[chosen]))
    return Resolved(problem, chosen, uncertainty[chosen], size)


def _floor(defect: Array, uncertainty: Array, kept: Array) -> float:
    """Return the uncertainty at some end states as a share of the discrepancy."""
    size = np.linalg.norm(defect[kept])
    return float(np.linalg.norm(uncertainty[kept]) / size) if size else np.inf


def _alike(problem: Resolved, slopes: Array, i: int, j: int) -> bool:
    switches = problem.hypotheses[i].switch or problem.hypotheses[j].switch
    return not switches and cosine(slopes[i], slopes[j]) > 1 - ALIKE


def _ranked(problem: Resolved, fits: list[Fit], slopes: Array, negligible: float) -> list[Fit]:
    """Sort fits, best first; among indistinguishable causes by `Fit.order`."""
    best = min(fit.remaining for fit in fits)
    tie_limit = max(NEGLIGIBLE, 3 * best, min(negligible, DISTINCT_RATIO * best))

    def reading(fit: Fit) -> tuple[float, tuple[int, int, tuple[int, ...]]]:
        return max(fit.remaining, tie_limit), fit.order

    def tied(fit: Fit, other: Fit) -> bool:
        if fit.remaining <= tie_limit and other.remaining <= tie_limit:
            return True
        return _alike(problem, slopes, fit.members[0], other.members[0])

    rows = sorted(fits, key=reading)
    return [
        replace(fit, tied_with=tuple(o.causes[0] for o in rows if o is not fit and tied(fit, o)))
        for fit in rows
    ]
