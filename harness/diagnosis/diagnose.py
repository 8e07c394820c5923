"""Name the cause of a discrepancy: from motions alone, by moving what might be wrong.

Every hypothesis is one number: a literal of the model file, moved in the engine's own model; or a
constant, or a term that the equations lack, moved in the equations. Each is fitted to the defects
of all scenarios together (Gauss-Newton), and the answer ranks them by what they leave. Where no
single one leaves little enough, pairs are (`harness.diagnosis.pairs`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from physics_crosscheck.harness.diagnosis.fit import (
    Fit,
    Hypothesis,
    Problem,
    Resolved,
    Try,
    cosine,
    left_linear,
    refine_each,
)
from physics_crosscheck.harness.diagnosis.pairs import ALIKE, pairs
from physics_crosscheck.reference.mechanism.numeric import Array

NAMED = 3e-3
"""A cause is named when it leaves at most this share of the discrepancy, or the uncertainty."""

RESOLVED = (1e-3, 1e-2, 1e-1)
"""Ends that are known no better than this share of the largest defect are left out of the fit,
such as where friction turns: they would drown the others. The first share is taken with which the
discrepancy stands out at what is left: where all of it is small, it may be seen at no end that is
known so well."""

STANDS_OUT = 0.5
"""Share of the discrepancy that the uncertainty is at most where it does."""

DOUBTFUL = 0.1
"""What a cause may leave where the uncertainty is as large as the discrepancy. It is a bound: were
the errors as large, every fit would leave as much, since they lie in no cause's direction."""

SETTLED = 1e-6
"""A cause that leaves at most this share, or the uncertainty, is all there is; what leaves more may
hide a second one."""

APART = 10.0
"""What leaves so many times more than the best is another cause, though the uncertainty, a bound,
be larger: errors of that size the best would have left too."""

UNSEEN, FELT = 1e-9, 1e-3
"""No motion depends on a number whose change by its own size does no more than this; on a switch
that does no more than this share of the discrepancy."""

REFINED = 6
"""Single hypotheses that are fitted: the best by the linear fit, and those that look like them.
More may be asked for, where fits are cheap."""


@dataclass(frozen=True)
class Ranking:
    """The ranked answer.

    Attributes:
        fits: best first; the tied ones follow each other.
        explained: whether the first leaves no more than `NAMED`, or than the uncertainty.
        floor: share of the discrepancy that the uncertainty makes.
        undone: what the engine does on its own, undone where the fits were made.
    """

    fits: tuple[Fit, ...]
    explained: bool
    floor: float
    undone: tuple[str, ...] = ()


def diagnose(problem: Problem, uncertainty: Array, refined: int = REFINED) -> Ranking:
    """Rank hypotheses, and pairs of them, by what they leave of a discrepancy.

    Args:
        problem: the discrepancy, with what each fault does.
        uncertainty: of the defect at each end, (N,).
        refined: how many single hypotheses are fitted at least.
    """
    whole = _resolved(problem, uncertainty)
    defect, slopes = whole.defect({}), whole.slopes({})
    hypotheses, floor = whole.hypotheses, whole.floor
    accepted, settled = max(NAMED, 2 * floor), max(SETTLED, 3 * floor)
    certain = accepted < 1
    accepted = accepted if certain else DOUBTFUL
    lengths = np.linalg.norm(slopes, axis=1)
    # A switch makes all of its change, however small: what an engine rounds may be all there is.
    small = min(UNSEEN, FELT * float(np.linalg.norm(defect)))
    least = [small if hypothesis.switch else UNSEEN for hypothesis in hypotheses]
    seen = [i for i, h in enumerate(hypotheses) if lengths[i] * h.size > least[i]]
    left = {i: left_linear(defect, [hypotheses[i]], slopes[[i]]) for i in seen}
    order = sorted(seen, key=lambda i: left[i])
    # Whatever looks like the best is told with it, though it ranked below by the linear fit.
    alike = [
        i for i in order[refined:] if any(_alike(whole, slopes, i, j) for j in order[:refined])
    ]
    # So is what holds or doesn't, and leaves as little: that is no coincidence.
    told = [i for i in order[refined:] if hypotheses[i].switch and left[i] <= accepted]
    chosen = (*order[:refined], *alike, *told)
    tries = [Try(left[i], {i: _start(hypotheses[i])}, slopes) for i in chosen]
    found = refine_each(whole, tries, settled)
    if not found:
        return Ranking((), False, floor)
    single = _ranked(whole, found, slopes, settled)
    best = min(fit.remaining for fit in single)
    alone = best <= accepted
    if alone and best <= settled:
        return Ranking(tuple(single), True, floor)
    first = min(single, key=lambda fit: fit.remaining)
    double = pairs(whole, slopes, seen, first, settled)
    if alone:
        # A second, smaller fault may hide in what the first leaves.
        better = bool(double) and double[0].remaining < best / 100
        return Ranking((*double, *single) if better else tuple(single), True, floor)
    if certain and double and double[0].remaining <= accepted:
        return Ranking((*double, *single), True, floor)
    return Ranking((*single, *double[:1]), False, floor)


def _start(hypothesis: Hypothesis) -> float:
    """What was left in a file is most often not meant at all; any other fault is small at first."""
    return hypothesis.value if hypothesis.id.kind == "unbound literal" else 0.0


def _resolved(problem: Problem, uncertainty: Array) -> Resolved:
    """Which ends are known well enough to tell causes: all, or those of smooth segments alone."""
    defect = problem.defect({})
    whole = np.ones(len(defect), dtype=bool)
    chosen = whole
    if _floor(defect, uncertainty, whole) > RESOLVED[0]:
        kept = (uncertainty <= share * np.abs(defect).max() for share in RESOLVED)
        stands_out = (one for one in kept if _floor(defect, uncertainty, one) <= STANDS_OUT)
        chosen = next(stands_out, whole)
    size = float(np.linalg.norm(defect[chosen]))
    return Resolved(problem, chosen, uncertainty[chosen], size)


def _floor(defect: Array, uncertainty: Array, kept: Array) -> float:
    """Share of the discrepancy at some ends that the uncertainty makes there."""
    size = np.linalg.norm(defect[kept])
    return float(np.linalg.norm(uncertainty[kept]) / size) if size else np.inf


def _alike(problem: Resolved, slopes: Array, i: int, j: int) -> bool:
    switches = problem.hypotheses[i].switch or problem.hypotheses[j].switch
    return not switches and cosine(slopes[i], slopes[j]) > 1 - ALIKE


def _ranked(problem: Resolved, found: list[Fit], slopes: Array, settled: float) -> list[Fit]:
    """Best first; causes that can't be told apart side by side, the most specific before."""
    best = min(fit.remaining for fit in found)
    enough = max(SETTLED, 3 * best, min(settled, APART * best))

    def reading(fit: Fit) -> tuple[float, int, float]:
        level = enough if fit.remaining <= enough else fit.remaining
        return level, fit.hypotheses[0].rank, fit.remaining

    def tied(fit: Fit, other: Fit) -> bool:
        if fit.remaining <= enough and other.remaining <= enough:
            return True
        return _alike(problem, slopes, fit.members[0], other.members[0])

    rows = sorted(found, key=reading)
    return [
        replace(fit, tied_with=tuple(o.causes[0] for o in rows if o is not fit and tied(fit, o)))
        for fit in rows
    ]
