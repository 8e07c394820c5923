"""Name the cause of a discrepancy: from motions alone, by moving what might be wrong.

Every hypothesis is one number: a literal of the model file, moved in the engine's own model; or a
constant, or a term that the equations lack, moved in the equations. Each is fitted to the defects
of all scenarios together (Gauss-Newton), and the answer ranks them by what they leave.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from reference.numeric import Array

NAMED = 3e-3
"""A cause is named when it leaves at most this share of the discrepancy, or the uncertainty."""

RESOLVED = 1e-3
"""Ends that are known no better than this share of the largest defect are left out of the fit,
such as where friction turns: they would drown the others."""

SETTLED = 1e-6
"""A cause that leaves at most this share, or the uncertainty, is all there is; what leaves more may
hide a second one."""

REFINED = 6
PAIRS_REFINED = 6
ITERATIONS = 8
ALIKE = 1e-6
"""1 - |cosine| of two sensitivities below which no data of these scenarios tell them apart."""


@dataclass(frozen=True)
class Hypothesis:
    """One number that might be wrong.

    Attributes:
        cause: one phrase, such as `joint[x]@stiffness` or `friction on theta`.
        kind: literal, setting, constant, inertia, damping, friction, spring, offset force, ...
        value: its present value: in the file for a literal, in the equations otherwise.
        size: a change that matters.
        rank: what a tie is broken by; the most specific first.
        where: `file:line` of a literal, "" otherwise.
        shift: scaled change of (engine - reference) when the number is moved by `delta`: what
            must be *added* to the defect.
        switch: whether it is true or not, a fault of 1 or none, and nothing between.
        correction: sign by which the fitted fault enters the estimate: a literal's right value is
            value - fault, a constant's apparent value is value + fault.
    """

    cause: str
    kind: str
    value: float
    size: float
    rank: int
    where: str
    shift: Callable[[float], Array] = field(repr=False)
    correction: float = 1.0
    switch: bool = False


@dataclass(frozen=True)
class Finding:
    """A cause (or a pair of causes) with what it leaves.

    Attributes:
        causes: one or two hypotheses.
        estimates: the value of each that explains the motion.
        standard_errors: of each estimate.
        remaining: share of the discrepancy that is left, root mean square over all segments.
        tied_with: causes that no data of these scenarios tell apart from this one.
    """

    causes: tuple[Hypothesis, ...]
    estimates: tuple[float, ...]
    standard_errors: tuple[float, ...]
    remaining: float
    tied_with: tuple[str, ...]


@dataclass(frozen=True)
class Diagnosis:
    """The ranked answer.

    Attributes:
        findings: best first; the tied ones follow each other.
        explained: whether the first leaves no more than `NAMED`, or than the uncertainty.
        floor: share of the discrepancy that the uncertainty makes.
    """

    findings: tuple[Finding, ...]
    explained: bool
    floor: float


def diagnose(
    defect: Array, uncertainty: Array, hypotheses: Sequence[Hypothesis], slopes: Array
) -> Diagnosis:
    """Rank hypotheses by what they leave of a discrepancy.

    Args:
        defect: engine - reference at the ends of all segments, scaled, (N,).
        uncertainty: of each, (N,).
        hypotheses: H of them.
        slopes: change of the defect per unit of fault, (H, N): a fault b of hypothesis h makes the
            defect b slopes[h] to first order.
    """
    kept = _resolved(defect, uncertainty)
    hypotheses = [replace(h, shift=_of(h.shift, kept)) for h in hypotheses]
    defect, uncertainty, slopes = defect[kept], uncertainty[kept], slopes[:, kept]
    size = float(np.linalg.norm(defect))
    floor = float(np.linalg.norm(uncertainty)) / size
    accepted = max(NAMED, 2 * floor)
    lengths = np.linalg.norm(slopes, axis=1)
    seen = [i for i in range(len(hypotheses)) if lengths[i] * hypotheses[i].size > 1e-9]
    left = {i: _left_linear(defect, [hypotheses[i]], slopes[[i]]) for i in seen}
    order = sorted(seen, key=lambda i: left[i])
    refined = [_refine(defect, uncertainty, [hypotheses[i]], slopes[[i]]) for i in order[:REFINED]]
    findings = list(zip(order[:REFINED], refined, strict=True))
    # Whatever looks like the best is told with it, though it ranked below by the linear fit.
    best = min((f.remaining for _, f in findings), default=np.inf)
    alike = [
        i
        for i in order[REFINED:]
        if not hypotheses[i].switch
        and any(_cosine(slopes[i], slopes[j]) > 1 - ALIKE for j, _ in findings)
    ]
    findings += [(i, _refine(defect, uncertainty, [hypotheses[i]], slopes[[i]])) for i in alike]
    best = min((f.remaining for _, f in findings), default=np.inf)
    single = _ranked(findings, hypotheses, slopes, accepted)
    alone = accepted < 1 and best <= accepted
    if alone and best <= max(SETTLED, 3 * floor):
        return Diagnosis(tuple(single), True, floor)
    pairs = _pairs(defect, uncertainty, hypotheses, slopes, order)
    if alone:
        # A second, smaller fault may hide in what the first leaves.
        better = bool(pairs) and pairs[0].remaining < best / 100
        return Diagnosis((*pairs, *single) if better else tuple(single), True, floor)
    if accepted < 1 and pairs and pairs[0].remaining <= accepted:
        return Diagnosis((*pairs, *single), True, floor)
    return Diagnosis((*single, *pairs[:1]), False, floor)


def _resolved(defect: Array, uncertainty: Array) -> Array:
    """Which ends are known well enough to tell causes: all, or those of smooth segments alone."""
    known = uncertainty <= RESOLVED * np.abs(defect).max()
    enough = np.linalg.norm(uncertainty) <= RESOLVED * np.linalg.norm(defect)
    if enough or not defect[known].any():
        return np.ones(len(defect), dtype=bool)
    return np.asarray(known)


def _of(shift: Callable[[float], Array], kept: Array) -> Callable[[float], Array]:
    return lambda fault: shift(fault)[kept]


def _left_linear(defect: Array, causes: Sequence[Hypothesis], rows: Array) -> float:
    switches = np.array([cause.switch for cause in causes])
    left = defect - rows[switches].sum(axis=0)
    free = rows[~switches]
    if len(free):
        scale = np.linalg.norm(free, axis=1, keepdims=True)
        fit, *_ = np.linalg.lstsq((free / scale).T, left, rcond=1e-10)
        left = left - (free / scale).T @ fit
    return float(np.linalg.norm(left) / np.linalg.norm(defect))


def _refine(
    defect: Array, uncertainty: Array, causes: Sequence[Hypothesis], rows: Array
) -> Finding:
    """Fit one or two faults by Gauss-Newton, each step tried on the models themselves."""
    scales = np.array([cause.size for cause in causes])
    # Switches are set, and stay.
    movable = np.array([not cause.switch for cause in causes])
    jacobian = (rows * (scales * movable)[:, None]).T
    faults = np.where(movable, 0.0, 1.0)

    def residual(values: Array) -> Array:
        total = defect.copy()
        for cause, value in zip(causes, values, strict=True):
            total = total - cause.shift(float(value))
        return total

    left = residual(faults)
    for _ in range(ITERATIONS):
        step, *_ = np.linalg.lstsq(jacobian, left, rcond=1e-12)
        trial, share = faults, 1.0
        for _ in range(5):
            candidate = faults + share * step * scales
            tried = residual(candidate)
            if np.linalg.norm(tried) < np.linalg.norm(left):
                trial, left = candidate, tried
                break
            share /= 4
        moved = np.max(np.abs(trial - faults) / scales)
        faults = trial
        small = np.linalg.norm(left) <= np.linalg.norm(uncertainty)
        if moved < 1e-12 or small:
            break
        # The slope at the new place, by a small difference: the faults may be large.
        for j, cause in enumerate(causes):
            if cause.switch:
                continue
            delta = 1e-4 * cause.size
            ahead = cause.shift(float(faults[j] + delta)) - cause.shift(float(faults[j]))
            jacobian[:, j] = ahead / delta * cause.size
    variance = float(np.sum(left**2)) / max(len(left) - len(causes), 1)
    variance += float(np.mean(uncertainty**2))
    covariance = np.linalg.pinv(jacobian.T @ jacobian) * variance
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0)) * scales
    estimates = tuple(
        cause.value + cause.correction * float(fault)
        for cause, fault in zip(causes, faults, strict=True)
    )
    remaining = float(np.linalg.norm(left) / np.linalg.norm(defect))
    return Finding(tuple(causes), estimates, tuple(float(e) for e in errors), remaining, ())


def _cosine(a: Array, b: Array) -> float:
    return abs(float(a @ b)) / float(np.linalg.norm(a) * np.linalg.norm(b))


def _ranked(
    findings: list[tuple[int, Finding]], hypotheses: Sequence[Hypothesis], slopes: Array,
    accepted: float,
) -> list[Finding]:  # fmt: skip
    """Best first; causes that can't be told apart side by side, the most specific before."""

    def level(item: tuple[int, Finding]) -> float:
        return max(item[1].remaining, accepted)

    rows = sorted(
        findings, key=lambda item: (level(item), hypotheses[item[0]].rank, item[1].remaining)
    )
    named = []
    for i, finding in rows:
        tied = tuple(
            hypotheses[j].cause
            for j, other in rows
            if j != i
            and (
                (
                    _cosine(slopes[i], slopes[j]) > 1 - ALIKE
                    and not (hypotheses[i].switch or hypotheses[j].switch)
                )
                or (finding.remaining <= accepted and other.remaining <= accepted)
            )
        )
        named.append(
            Finding(
                finding.causes, finding.estimates, finding.standard_errors, finding.remaining, tied
            )
        )
    return named


def _pairs(
    defect: Array, uncertainty: Array, hypotheses: Sequence[Hypothesis], slopes: Array,
    seen: Sequence[int],
) -> list[Finding]:  # fmt: skip
    """The pairs that leave least, refined; pairs of causes that look alike say nothing new."""
    classes = _classes(hypotheses, slopes, seen)
    scored = []
    for i, j in combinations(classes, 2):
        if _cosine(slopes[i], slopes[j]) > 1 - 1e-4:
            continue
        causes = [hypotheses[i], hypotheses[j]]
        scored.append((_left_linear(defect, causes, slopes[[i, j]]), i, j))
    scored.sort()
    found = [
        replace(
            _refine(defect, uncertainty, [hypotheses[i], hypotheses[j]], slopes[[i, j]]),
            tied_with=tuple(hypotheses[k].cause for k in (*classes[i], *classes[j])),
        )
        for _, i, j in scored[:PAIRS_REFINED]
    ]
    # Among pairs that explain it all, the most specific.
    return sorted(
        found, key=lambda f: (max(f.remaining, SETTLED), sum(c.rank for c in f.causes), f.remaining)
    )


def _classes(
    hypotheses: Sequence[Hypothesis], slopes: Array, seen: Sequence[int]
) -> dict[int, list[int]]:
    """The most specific of each class of causes that look alike, with the others of its class."""
    classes: dict[int, list[int]] = {}
    for i in sorted(seen, key=lambda k: hypotheses[k].rank):
        for j, others in classes.items():
            same = hypotheses[i].switch == hypotheses[j].switch
            if same and _cosine(slopes[i], slopes[j]) > 1 - ALIKE:
                others.append(i)
                break
        else:
            classes[i] = []
    return classes
