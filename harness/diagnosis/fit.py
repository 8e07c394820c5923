"""Fit faults to a discrepancy: by linear least squares, then on the models themselves."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.cause import CauseId
from physics_crosscheck.reference.mechanism.numeric import Array

ITERATIONS = 8

STALLED = 1e-3
"""A fit ends with the step that takes off less than this share of what was left."""

HALVED = 0.2
"""How far a step may be from half the last one for two of them to be taken: so goes the way to a
number of which the slope vanishes where it is right."""

BEHIND = 30.0
FAR = 0.05
"""Once a cause is found, others are not pursued whose linear fit leaves more than so many times
what its own did, and more than this share: a bend alone may leave less."""


@dataclass(frozen=True, kw_only=True)
class Hypothesis:
    """One number that might be wrong.

    Attributes:
        id: which number it is.
        value: its present value: in the file for a literal, in the equations otherwise.
        size: a change that matters.
        rank: what a tie is broken by; the most specific first.
        where: lines of a literal; none otherwise.
        correction: sign by which the fitted fault enters the estimate: a literal's right value is
            value - fault, a constant's apparent value is value + fault.
        switch: whether it is true or not, a fault of 1 or none, and nothing between.
    """

    id: CauseId
    value: float
    size: float
    rank: int
    where: tuple[SourceLine, ...] = ()
    correction: float = 1.0
    switch: bool = False


class Problem(Protocol):
    """A discrepancy, and what repairing faults makes of it; faults go by index of hypothesis."""

    @property
    def hypotheses(self) -> Sequence[Hypothesis]:
        """What might be wrong."""

    def defect(self, faults: Mapping[int, float]) -> Array:
        """Engine - reference at the ends of all segments with the faults repaired, scaled, (N,)."""

    def slopes(self, faults: Mapping[int, float], of: Sequence[int] | None = None) -> Array:
        """How much of the defect a unit of each fault makes, near the given faults, (len(of), N).

        To four digits or so. `of`: which hypotheses; None: all.
        """


@dataclass(frozen=True)
class Resolved:
    """A problem at those ends alone that are known well enough to tell causes.

    Attributes:
        problem: the whole.
        kept: which ends count, (N,).
        uncertainty: of those, (n,).
        size: the norm of the discrepancy there.
    """

    problem: Problem
    kept: Array
    uncertainty: Array
    size: float

    @property
    def hypotheses(self) -> Sequence[Hypothesis]:
        """Those of the problem."""
        return self.problem.hypotheses

    @property
    def floor(self) -> float:
        """Share of the discrepancy that the uncertainty makes."""
        return float(np.linalg.norm(self.uncertainty)) / self.size

    def defect(self, faults: Mapping[int, float]) -> Array:
        """Those of the problem, at the ends that count, (n,)."""
        kept: Array = self.problem.defect(faults)[self.kept]
        return kept

    def slopes(self, faults: Mapping[int, float], of: Sequence[int] | None = None) -> Array:
        """Those of the problem, at the ends that count, (len(of), n)."""
        kept: Array = self.problem.slopes(faults, of)[:, self.kept]
        return kept

    def left(self, defect: Array) -> float:
        """The share of the discrepancy that a defect is."""
        return float(np.linalg.norm(defect)) / self.size


@dataclass(frozen=True, kw_only=True)
class Fit:
    """A hypothesis (or a pair of them) with what it leaves.

    Attributes:
        members: indices of the hypotheses.
        hypotheses: these one or two.
        faults: fitted to each.
        estimates: the value of each that explains the motion.
        standard_errors: of each estimate.
        remaining: share of the discrepancy that is left, root mean square over all segments.
        tied_with: causes that no data of these scenarios tell apart from this one.
    """

    members: tuple[int, ...]
    hypotheses: tuple[Hypothesis, ...]
    faults: tuple[float, ...]
    estimates: tuple[float, ...]
    standard_errors: tuple[float, ...]
    remaining: float
    tied_with: tuple[CauseId, ...] = ()

    @property
    def causes(self) -> tuple[CauseId, ...]:
        """Which causes they are."""
        return tuple(hypothesis.id for hypothesis in self.hypotheses)

    @property
    def repair(self) -> dict[int, float]:
        """The faults by index, as a problem takes them."""
        return dict(zip(self.members, self.faults, strict=True))


def left_linear(defect: Array, hypotheses: Sequence[Hypothesis], rows: Array) -> float:
    """Share of a defect that the best linear fit of some hypotheses leaves.

    A row of zeros takes nothing off: a number may lose its effect once it is repaired.
    """
    switches = np.array([hypothesis.switch for hypothesis in hypotheses])
    left = defect - rows[switches].sum(axis=0)
    free = rows[~switches & rows.any(axis=1)]
    if len(free):
        scale = np.linalg.norm(free, axis=1, keepdims=True)
        fit, *_ = np.linalg.lstsq((free / scale).T, left, rcond=1e-10)
        left = left - (free / scale).T @ fit
    return float(np.linalg.norm(left) / np.linalg.norm(defect))


def cosine(a: Array, b: Array) -> float:
    """Return |cosine| of the angle between two sensitivities; 0 where either is zero."""
    sizes = float(np.linalg.norm(a) * np.linalg.norm(b))
    return abs(float(a @ b)) / sizes if sizes else 0.0


def refine(
    problem: Resolved, start: Mapping[int, float], slopes: Array, iterations: int = ITERATIONS
) -> Fit:
    """Fit the faults of some hypotheses by Gauss-Newton, each step tried on the models themselves.

    Args:
        problem: with what each fault does.
        start: where to begin; switches are set, and stay.
        slopes: there, (H, n).
        iterations: at most.
    """
    members = list(start)
    hypotheses = [problem.hypotheses[i] for i in members]
    scales = np.array([hypothesis.size for hypothesis in hypotheses])
    movable = np.array([not hypothesis.switch for hypothesis in hypotheses])
    jacobian = (slopes[members] * (scales * movable)[:, None]).T
    faults = np.where(movable, list(start.values()), 1.0)
    free = [i for i, moves in zip(members, movable, strict=True) if moves]

    def residual(values: Array) -> Array:
        return problem.defect(dict(zip(members, values.tolist(), strict=True)))

    left, last = residual(faults), np.zeros(len(members))
    for _ in range(iterations):
        step, *_ = np.linalg.lstsq(jacobian, left, rcond=1e-12)
        double = np.linalg.norm(2 * step - last) < HALVED * np.linalg.norm(last)
        share, last = 2.0 if double else 1.0, step
        before = float(np.linalg.norm(left))
        tried, left = _descended(residual, faults, left, step * scales, share)
        stalled = np.linalg.norm(left) > (1 - STALLED) * before
        moved = np.max(np.abs(tried - faults) / scales)
        faults = tried
        small = np.linalg.norm(left) <= np.linalg.norm(problem.uncertainty)
        if moved < 1e-12 or stalled or small or iterations == 1 or not free:
            break
        # The slopes at the new place: the faults may be large.
        at = dict(zip(members, faults.tolist(), strict=True))
        jacobian[:, movable] = (problem.slopes(at, free) * scales[movable, None]).T
    return _fit(problem, members, faults, jacobian, left)


def _fit(
    problem: Resolved, members: Sequence[int], faults: Array, jacobian: Array, left: Array
) -> Fit:
    """What is told of faults that leave so much, (n,); slopes in units of sizes, (n, m)."""
    hypotheses = [problem.hypotheses[i] for i in members]
    scales = np.array([hypothesis.size for hypothesis in hypotheses])
    variance = float(np.sum(left**2)) / max(len(left) - len(hypotheses), 1)
    variance += float(np.mean(problem.uncertainty**2))
    covariance = np.linalg.pinv(jacobian.T @ jacobian) * variance
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0)) * scales
    return Fit(
        members=tuple(members),
        hypotheses=tuple(hypotheses),
        faults=tuple(float(fault) for fault in faults),
        estimates=tuple(
            hypothesis.value + hypothesis.correction * float(fault)
            for hypothesis, fault in zip(hypotheses, faults, strict=True)
        ),
        standard_errors=tuple(float(error) for error in errors),
        remaining=problem.left(left),
    )


def _linear(problem: Resolved, one: Try) -> Fit:
    """The linear fit around no fault, tried on no model."""
    members = list(one.start)
    hypotheses = [problem.hypotheses[i] for i in members]
    scales = np.array([hypothesis.size for hypothesis in hypotheses])
    movable = np.array([not hypothesis.switch for hypothesis in hypotheses])
    rows = one.slopes[members] * scales[:, None]
    left = problem.defect({}) - rows[~movable].sum(axis=0)
    jacobian = (rows * movable[:, None]).T
    step, *_ = np.linalg.lstsq(jacobian, left, rcond=1e-12)
    faults = np.where(movable, step * scales, 1.0)
    return _fit(problem, members, faults, jacobian, left - jacobian @ step)


def _descended(
    residual: Callable[[Array], Array], faults: Array, left: Array, step: Array, share: float
) -> tuple[Array, Array]:
    """Faults some steps further, or a part of that, where it leaves less; with what they leave."""
    for _ in range(5):
        candidate = faults + share * step
        tried = residual(candidate)
        if np.linalg.norm(tried) < np.linalg.norm(left):
            return candidate, tried
        share /= 4
    return faults, left


@dataclass(frozen=True)
class Try:
    """Where a fit may begin.

    Attributes:
        left: share of the discrepancy that its linear fit leaves.
        start: faults by index of hypothesis.
        slopes: of all hypotheses there, (H, n).
    """

    left: float
    start: Mapping[int, float]
    slopes: Array


def refine_each(problem: Resolved, tries: Sequence[Try], settled: float) -> list[Fit]:
    """Fit each, the most promising first.

    Once one has left no more than `settled`, those that fall far behind it are told, not pursued.
    """
    enough = np.inf
    found = []
    for one in sorted(tries, key=lambda one: one.left):
        if one.left > enough and not any(one.start.values()):
            found.append(_linear(problem, one))
            continue
        fit = refine(problem, one.start, one.slopes, ITERATIONS if one.left <= enough else 1)
        if fit.remaining <= settled:
            enough = min(enough, max(BEHIND * one.left, FAR))
        found.append(fit)
    return found
