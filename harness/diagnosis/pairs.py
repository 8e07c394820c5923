"""Fits of two faults at once, and alternatives to either of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.diagnosis.fit import (
    Fit,
    Hypothesis,
    Resolved,
    Try,
    cosine,
    left_linear,
    refine_each,
)
from physics_crosscheck.harness.records.cause import CauseId
from physics_crosscheck.reference.mechanism.numeric import Array

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
