"""Diagnosis of a discrepancy from motions: fit each hypothesis, and rank them.

Each hypothesis is one number: a literal of the model file, changed in the engine's model, or a
constant or missing term, changed in the equations. Each is fitted to the defects of all
scenarios together (Gauss-Newton). The ranking is by the remaining discrepancy. If no single
hypothesis explains it, pairs are fitted.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.records.cause import CauseId
from physics_crosscheck.harness.records.finding import CLOSE
from physics_crosscheck.reference.mechanism.numeric import Array
from .fit import Fit, FitProblem, Hypothesis, Resolved, Try, cosine, left_linear, refine_each

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

    @property
    def is_single(self) -> bool:
        """True if one cause alone explains the discrepancy."""
        return self.explained and len(self.fits[0].members) == 1


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
    accepted, negligible = largest_remaining(floor), max(NEGLIGIBLE, 3 * floor)
    certain = 2 * floor < 1
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
    # Slopes of motions with events may mislead, or vanish; the bound value is tried all the same.
    stated = [i for i, h in enumerate(hypotheses) if h.start and h.expected is not None]
    chosen = tuple(dict.fromkeys((*order[:refined], *alike, *switches, *stated)))
    tries = [Try(remaining.get(i, 1.0), {i: hypotheses[i].start}, slopes) for i in chosen]
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


def largest_remaining(floor: float) -> float:
    """Return the largest share that an explanation leaves, for an uncertainty as a share."""
    return min(max(NAMED, 2 * floor), CLOSE)


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
    size = np.linalg.norm(defect[kept])
    return float(np.linalg.norm(uncertainty[kept]) / size) if size else np.inf


def _alike(problem: Resolved, slopes: Array, i: int, j: int) -> bool:
    switches = problem.hypotheses[i].switch or problem.hypotheses[j].switch
    return not switches and cosine(slopes[i], slopes[j]) > 1 - ALIKE


def _ranked(problem: Resolved, fits: list[Fit], slopes: Array, negligible: float) -> list[Fit]:
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


ALIKE = 1e-6
"""Limit of 1 - |cosine| below which these scenarios cannot distinguish two sensitivities."""

PARALLEL = 1e-4
"""Limit of 1 - |cosine| above which two sensitivities are fitted as a pair."""

PAIRS_FITTED = 4
"""Number of pairs to fit at zero faults, and as many around the best single fault."""

MAX_BASE_REMAINING = 0.5
"""Remaining share above which fits are not used as a base for other fits.

Neither pairs around such a single fault nor alternatives to members of such a pair are sought.
"""

PAIRS_SHORTLISTED = 40
"""Number of pairs whose linear fit is evaluated to full accuracy."""


def pairs(
    problem: Resolved, slopes: Array, seen: Sequence[int], first: Fit, negligible: float
) -> list[Fit]:
    """Return the pairs that leave least, best first, and the best with its ties.

    A large fault changes the effect of a small one. Therefore pairs are also sought around the best
    single fault, with all slopes evaluated after its repair.

    Args:
        problem: with the effect of each fault.
        slopes: at zero faults, (H, n).
        seen: hypotheses that have an effect.
        first: the best single fit.
        negligible: negligible share of the discrepancy.
    """
    chosen, after, near = _around_nothing(problem, slopes, seen), slopes, list(seen)
    if first.remaining <= MAX_BASE_REMAINING:
        after = _slopes_at(problem, first, seen)
        near = [i for i in seen if np.any(after[i])]
        chosen += _around(problem, first, after, near)
    tries = {frozenset(one.start): one for one in chosen}
    fits = refine_each(problem, list(tries.values()), negligible)
    if not fits:
        return []
    best = min(fits, key=lambda f: f.remaining)
    if best.remaining <= MAX_BASE_REMAINING and not set(first.members) <= set(best.members):
        after = _slopes_at(problem, best, seen)
        near = [i for i in seen if np.any(after[i])]
    tie_limit = max(negligible, 3 * best.remaining)

    def reading(fit: Fit) -> tuple[float, tuple[int, int, tuple[int, ...]]]:
        return max(fit.remaining, tie_limit), fit.order

    ranked = sorted(fits, key=reading)
    is_good = best.remaining <= MAX_BASE_REMAINING
    alike = _stand_ins(problem.hypotheses, ranked[0], after, near) if is_good else ()
    tied = dict.fromkeys(alike)
    for other in ranked[1:]:
        if other.remaining <= tie_limit:
            tied |= dict.fromkeys(other.causes)
    best_causes = set(ranked[0].causes)
    return [
        replace(ranked[0], tied_with=tuple(t for t in tied if t not in best_causes)),
        *ranked[1:],
    ]


def _slopes_at(problem: Resolved, fit: Fit, seen: Sequence[int]) -> Array:
    """Return slopes after repair of a fit, (H, n), zero for hypotheses without effect."""
    rows = problem.slopes(fit.repair, seen)
    slopes = np.zeros((len(problem.hypotheses), rows.shape[1]))
    slopes[list(seen)] = rows
    return slopes


def classes(
    hypotheses: Sequence[Hypothesis], slopes: Array, seen: Sequence[int]
) -> dict[int, list[int]]:
    """Return classes of causes with the same effect: the most specific -> the others."""
    order = sorted(seen, key=lambda k: hypotheses[k].rank)
    if not order:
        return {}
    rows = slopes[order]
    rows = rows / np.linalg.norm(rows, axis=1, keepdims=True)
    switch = np.array([hypotheses[i].switch for i in order])
    alike = (np.abs(rows @ rows.T) > 1 - ALIKE) & (switch[:, None] == switch)
    members: dict[int, list[int]] = {}
    first: list[int] = []
    for place, i in enumerate(order):
        same = [k for k in first if alike[place, k]]
        if same:
            members[order[same[0]]].append(i)
        else:
            members[i] = []
            first.append(place)
    return members


def _around_nothing(problem: Resolved, slopes: Array, seen: Sequence[int]) -> list[Try]:
    """Return starts with the pairs whose linear fit leaves least of the discrepancy."""
    defect, chosen = problem.defect({}), list(classes(problem.hypotheses, slopes, seen))
    switches = np.array([problem.hypotheses[i].switch for i in chosen], dtype=bool)
    remaining = _left_by_pairs(defect, slopes[chosen], switches)
    tries = []
    for place in np.argsort(remaining, axis=None)[:PAIRS_SHORTLISTED].tolist():
        row, column = divmod(place, len(chosen))
        if np.isfinite(remaining[row, column]):
            i, j = chosen[row], chosen[column]
            both = [problem.hypotheses[i], problem.hypotheses[j]]
            exact = left_linear(defect, both, slopes[[i, j]])
            tries.append(Try(exact, {i: 0.0, j: 0.0}, slopes))
    return sorted(tries, key=lambda one: one.remaining)[:PAIRS_FITTED]


def _left_by_pairs(defect: Array, rows: Array, switches: NDArray[np.bool_]) -> Array:
    """Return the squared remainder of each pair's linear fit, (C, C); infinite for invalid pairs.

    It is computed from products of the rows, to half the digits, which suffices for a shortlist.
    """
    sizes = np.linalg.norm(rows, axis=1, keepdims=True)
    units = rows / sizes
    along, cosines = units @ defect, units @ units.T
    whole, size, flat = float(defect @ defect), sizes[:, 0], 1 - cosines**2
    with np.errstate(all="ignore"):
        removed = along[:, None] ** 2 + along**2 - 2 * cosines * along[:, None] * along
        remaining = whole - removed / flat
        # A switch removes its whole row; a free hypothesis with it, what it can of the rest.
        off = whole - 2 * size * along + size**2
        rest = along - size[:, None] * cosines
        free_remainder = off[:, None] - rest**2
        both = off[:, None] + off - whole + 2 * size[:, None] * size * cosines
    remaining = np.where(switches[:, None] & ~switches, free_remainder, remaining)
    remaining = np.where(~switches[:, None] & switches, free_remainder.T, remaining)
    remaining = np.where(switches[:, None] & switches, both, remaining)
    is_pair = np.triu(np.abs(cosines) <= 1 - PARALLEL, 1)
    valid: Array = np.where(is_pair & np.isfinite(remaining), remaining, np.inf)
    return valid


def _around(problem: Resolved, first: Fit, after: Array, seen: Sequence[int]) -> list[Try]:
    """Return starts with the best second faults, after repair of the first, which stays free."""
    (i,) = first.members
    defect = problem.defect(first.repair)
    tries = []
    for j in classes(problem.hypotheses, after, seen):
        if j == i or cosine(after[i], after[j]) > 1 - PARALLEL:
            continue
        free = [k for k in (i, j) if k == j or not problem.hypotheses[k].switch]
        fitted = [problem.hypotheses[k] for k in free]
        remaining = left_linear(defect, fitted, after[free]) * first.remaining
        tries.append(Try(remaining, {**first.repair, j: 0.0}, after))
    return sorted(tries, key=lambda one: one.remaining)[:PAIRS_FITTED]


def _stand_ins(
    hypotheses: Sequence[Hypothesis], best: Fit, after: Array, seen: Sequence[int]
) -> Iterator[CauseId]:
    """Yield causes that could replace either member of a pair: their effect lies in its span."""
    free = [i for i in best.members if not hypotheses[i].switch and after[i].any()]
    if not free:
        return
    rows = after[free] / np.linalg.norm(after[free], axis=1, keepdims=True)
    basis = np.linalg.qr(rows.T)[0]
    for i in seen:
        if i in best.members or hypotheses[i].switch:
            continue
        row = after[i] / np.linalg.norm(after[i])
        rejection = row - basis @ (basis.T @ row)
        # 1 - cosine of the angle to the plane is half the square of its sine.
        if float(rejection @ rejection) / 2 < ALIKE:
            yield hypotheses[i].id
