"""Fits of faults to a discrepancy: by linear least squares, then on the models themselves."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

import numpy as np

from physics_crosscheck.harness.documents.elements import Number
from physics_crosscheck.harness.records.base import SourceLine
from physics_crosscheck.harness.records.cause import CauseId
from physics_crosscheck.reference.mechanism.numeric import Array

ITERATIONS = 8

MIN_PROGRESS = 1e-3
"""Minimum share of the remaining discrepancy that a step must remove to continue."""

HALVING_TOLERANCE = 0.2
"""Relative distance of a step from half the previous one at which the step is doubled.

Steps halve in this way near a number with zero slope at its right value.
"""

CONFIRMED = 0.1
"""Largest distance of an estimate from the bound value, as a share of the number's error."""

MAX_FIT_RATIO = 30.0
MAX_FIT_SHARE = 0.05
"""Limits for pursuing other fits once a cause is found: ratio of linear fits, and share left.

Fits beyond both are not pursued. A linear fit may leave less than that share by
nonlinearity alone.
"""


NEAR_ZERO_FAULT = 1e-4
"""Relative faults below which slopes are those of no fault, to four digits."""

Faults = Mapping[int, float]
"""Faults by index of the hypothesis; missing ones are zero."""


@dataclass(frozen=True)
class Perturbation:
    """Repair of one unit of fault, in the model or in the equations.

    Attributes:
        numbers: change of each number of a file, by its index.
        literals: change of each literal, by address.
        gravity: change of the engine's gravity, three components.
        settings: new settings of the sidecar, for a switch.
        reversed: index of the engine coordinate with reversed axis; -1: none.
        zero: index of the engine coordinate with moved zero; -1: none.
        parameters: change of parameters of the equations, by index.
    """

    numbers: Mapping[int, float] = field(default_factory=dict)
    literals: Mapping[str, float] = field(default_factory=dict)
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    settings: Mapping[str, object] = field(default_factory=dict)
    reversed: int = -1
    zero: int = -1
    parameters: Mapping[int, float] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Hypothesis:
    """One number that might be wrong.

    Attributes:
        id: which number it is.
        value: its present value: in the file for a literal, in the equations otherwise.
        size: a relevant change.
        rank: order among ties; the most specific first.
        where: lines of a literal; () otherwise.
        correction: sign of the fitted fault in the estimate: a literal's right value is
            value - fault, a constant's apparent value is value + fault.
        switch: whether its fault is either 0 or 1.
        expected: the right value by the user's bindings; None for an unbound number.
        start: initial fault of a fit.
        repair: of one unit of its fault; empty for a mistake in laws.
    """

    id: CauseId
    value: float
    size: float
    rank: int
    where: tuple[SourceLine, ...] = ()
    correction: float = 1.0
    switch: bool = False
    expected: float | None = None
    start: float = 0.0
    repair: Perturbation = field(default=Perturbation(), compare=False, repr=False)

    def is_confirmed(self, estimate: float) -> bool:
        """Return whether the number is wrong by its binding, and an estimate is the bound value."""
        if self.expected is None or self.expected == self.value:
            return False
        return abs(self.expected - estimate) <= CONFIRMED * abs(self.expected - self.value)


class FitProblem(Protocol):
    """A discrepancy, and its change by repaired faults, given by index of hypothesis."""

    @property
    def hypotheses(self) -> Sequence[Hypothesis]:
        """Hypotheses that might explain the discrepancy."""

    def defect(self, faults: Faults) -> Array:
        """Return engine - reference at all ends with repaired faults, scaled, (N,)."""

    def slopes(self, faults: Faults, indices: Sequence[int] | None = None) -> Array:
        """Return the defect per unit of each fault, near the given faults, (len(indices), N).

        It is accurate to about four digits. `indices`: of hypotheses; None: all.
        """


@dataclass(frozen=True, kw_only=True, eq=False)
class NumberProblem(ABC):
    """A `FitProblem` that numbers of a file explain, whose effects follow from equations."""

    _rows: dict[int, Array | None] = field(default_factory=dict, repr=False)

    if TYPE_CHECKING:  # a field or a property

        @property
        def hypotheses(self) -> Sequence[Hypothesis]: ...  # noqa: D102

    @property
    @abstractmethod
    def numerals(self) -> Sequence[Number]:
        """Numbers of the file."""

    @abstractmethod
    def defect(self, faults: Faults) -> Array:
        """Return what `FitProblem.defect` does."""

    @abstractmethod
    def _effect(self, index: int) -> Array | None:
        """Compute what `effect` returns."""

    @abstractmethod
    def _slopes_at(self, faults: Faults, indices: Sequence[int]) -> Sequence[Array | None]:
        """Return the slopes far from zero faults."""

    def effect(self, index: int) -> Array | None:
        """Return the slope at zero faults, (N,), or the whole effect of a switch; None if unknown.

        It is unknown if no such file exists with another value on either side, or its equations
        cannot be solved.
        """
        if index not in self._rows:
            self._rows[index] = self._effect(index)
        return self._rows[index]

    def slopes(self, faults: Faults, indices: Sequence[int] | None = None) -> Array:
        """Return the defect per unit of each fault; near zero faults, those at zero."""
        indices = range(len(self.hypotheses)) if indices is None else indices
        near = all(abs(by) <= NEAR_ZERO_FAULT * self.hypotheses[i].size for i, by in faults.items())
        rows = [self.effect(i) for i in indices] if near else self._slopes_at(faults, indices)
        nothing = np.zeros(self.defect({}).size)
        return np.array([nothing if row is None else row for row in rows]).reshape(-1, len(nothing))

    def values(self, faults: Faults) -> dict[int, float]:
        """Return the values of the file's numbers with repaired faults, by index."""
        values: dict[int, float] = {}
        for index, fault in faults.items():
            hypothesis = self.hypotheses[index]
            for i, unit in hypothesis.repair.numbers.items():
                if fault and unit:
                    value = values.get(i, self.numerals[i].value) + fault * unit
                    is_choice = hypothesis.switch and hypothesis.id.kind == "taken"
                    values[i] = round(value) if is_choice else value
        return values


@dataclass(frozen=True)
class Resolved:
    """A problem, restricted to end states accurate enough to distinguish causes.

    Attributes:
        problem: the unrestricted one.
        kept: mask of end states, (N,).
        uncertainty: of those kept, (n,).
        size: norm of the discrepancy there.
    """

    problem: FitProblem
    kept: Array
    uncertainty: Array
    size: float

    @property
    def hypotheses(self) -> Sequence[Hypothesis]:
        """Hypotheses of the problem."""
        return self.problem.hypotheses

    @property
    def floor(self) -> float:
        """The uncertainty as a share of the discrepancy."""
        return float(np.linalg.norm(self.uncertainty)) / self.size

    def defect(self, faults: Faults) -> Array:
        """Return the problem's defect at the kept end states, (n,)."""
        kept: Array = self.problem.defect(faults)[self.kept]
        return kept

    def slopes(self, faults: Faults, indices: Sequence[int] | None = None) -> Array:
        """Return the problem's slopes at the kept end states, (len(indices), n)."""
        kept: Array = self.problem.slopes(faults, indices)[:, self.kept]
        return kept

    def relative_size(self, defect: Array) -> float:
        """Return a defect as a share of the discrepancy."""
        return float(np.linalg.norm(defect)) / self.size


@dataclass(frozen=True, kw_only=True)
class Fit:
    """A hypothesis or a pair of them, fitted.

    Attributes:
        members: indices of the hypotheses.
        hypotheses: one or two.
        faults: the fitted fault of each.
        estimates: the value of each that explains the motion.
        standard_errors: of each estimate.
        remaining: remaining share of the discrepancy, root mean square over all segments.
        tied_with: causes that these scenarios cannot distinguish from this one.
        is_read: whether the bodies that the engine compiled have the estimates.
    """

    members: tuple[int, ...]
    hypotheses: tuple[Hypothesis, ...]
    faults: tuple[float, ...]
    estimates: tuple[float, ...]
    standard_errors: tuple[float, ...]
    remaining: float
    tied_with: tuple[CauseId, ...] = ()
    is_read: bool = False

    @property
    def causes(self) -> tuple[CauseId, ...]:
        """Identifiers of the causes."""
        return tuple(hypothesis.id for hypothesis in self.hypotheses)

    @property
    def order(self) -> tuple[int, int, tuple[int, ...]]:
        """Order among fits that leave as little; it is the same in every engine.

        A wrong number whose estimate equals its bound value comes first: two independent sources
        agree. Then the most specific fit, then the first in the file.
        """
        pairs = zip(self.hypotheses, self.estimates, strict=True)
        confirmed = sum(hypothesis.is_confirmed(estimate) for hypothesis, estimate in pairs)
        return -confirmed, sum(hypothesis.rank for hypothesis in self.hypotheses), self.members

    @property
    def repair(self) -> dict[int, float]:
        """Faults by index, as for `FitProblem`."""
        return dict(zip(self.members, self.faults, strict=True))


def left_linear(defect: Array, hypotheses: Sequence[Hypothesis], rows: Array) -> float:
    """Return the share of a defect that the best linear fit of some hypotheses leaves.

    Rows of zeros are left out: a number may have no effect once it is repaired.
    """
    switches = np.array([hypothesis.switch for hypothesis in hypotheses])
    remainder = defect - rows[switches].sum(axis=0)
    free = rows[~switches & rows.any(axis=1)]
    if len(free):
        scale = np.linalg.norm(free, axis=1, keepdims=True)
        fit, *_ = np.linalg.lstsq((free / scale).T, remainder, rcond=1e-10)
        remainder = remainder - (free / scale).T @ fit
    return float(np.linalg.norm(remainder) / np.linalg.norm(defect))


def cosine(a: Array, b: Array) -> float:
    """Return |cosine| of the angle between two sensitivities; 0 if either is zero."""
    sizes = float(np.linalg.norm(a) * np.linalg.norm(b))
    return abs(float(a @ b)) / sizes if sizes else 0.0


def refine(problem: Resolved, start: Faults, slopes: Array, iterations: int = ITERATIONS) -> Fit:
    """Fit the faults of some hypotheses by Gauss-Newton, checking each step on the models.

    Args:
        problem: with the effect of each fault.
        start: initial faults; switches are set to 1.
        slopes: at these, (H, n).
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

    defect, last = residual(faults), np.zeros(len(members))
    for _ in range(iterations):
        step, *_ = np.linalg.lstsq(jacobian, defect, rcond=1e-12)
        double = np.linalg.norm(2 * step - last) < HALVING_TOLERANCE * np.linalg.norm(last)
        share, last = 2.0 if double else 1.0, step
        before = float(np.linalg.norm(defect))
        tried, defect = _descended(residual, faults, defect, step * scales, share)
        stalled = np.linalg.norm(defect) > (1 - MIN_PROGRESS) * before
        moved = np.max(np.abs(tried - faults) / scales)
        faults = tried
        small = np.linalg.norm(defect) <= np.linalg.norm(problem.uncertainty)
        if moved < 1e-12 or stalled or small or iterations == 1 or not free:
            break
        # Faults may be large: evaluate the slopes at the new values.
        repaired = dict(zip(members, faults.tolist(), strict=True))
        jacobian[:, movable] = (problem.slopes(repaired, free) * scales[movable, None]).T
    return _fit(problem, members, faults, jacobian, defect)


def _fit(
    problem: Resolved, members: Sequence[int], faults: Array, jacobian: Array, defect: Array
) -> Fit:
    """Build a fit from faults and the defect they leave, (n,); slopes in units of sizes, (n, m)."""
    hypotheses = [problem.hypotheses[i] for i in members]
    scales = np.array([hypothesis.size for hypothesis in hypotheses])
    variance = float(np.sum(defect**2)) / max(len(defect) - len(hypotheses), 1)
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
        remaining=problem.relative_size(defect),
    )


def _linear(problem: Resolved, start: Try) -> Fit:
    members = list(start.start)
    hypotheses = [problem.hypotheses[i] for i in members]
    scales = np.array([hypothesis.size for hypothesis in hypotheses])
    movable = np.array([not hypothesis.switch for hypothesis in hypotheses])
    rows = start.slopes[members] * scales[:, None]
    defect = problem.defect({}) - rows[~movable].sum(axis=0)
    jacobian = (rows * movable[:, None]).T
    step, *_ = np.linalg.lstsq(jacobian, defect, rcond=1e-12)
    faults = np.where(movable, step * scales, 1.0)
    return _fit(problem, members, faults, jacobian, defect - jacobian @ step)


def _descended(
    residual: Callable[[Array], Array], faults: Array, defect: Array, step: Array, share: float
) -> tuple[Array, Array]:
    """Return faults after some steps, or a part of them if it leaves less, and their defect."""
    for _ in range(5):
        candidate = faults + share * step
        tried = residual(candidate)
        if np.linalg.norm(tried) < np.linalg.norm(defect):
            return candidate, tried
        share /= 4
    return faults, defect


@dataclass(frozen=True)
class Try:
    """Initial values of a fit.

    Attributes:
        remaining: share of the discrepancy that its linear fit leaves.
        start: faults by index of hypothesis.
        slopes: of all hypotheses at the start, (H, n).
    """

    remaining: float
    start: Faults
    slopes: Array


def refine_each(problem: Resolved, tries: Sequence[Try], negligible: float) -> list[Fit]:
    """Fit each start, the most promising first.

    Once a fit leaves at most `negligible`, starts with a far worse linear fit keep that fit.
    """
    limit = np.inf
    fits = []
    for start in sorted(tries, key=lambda one: one.remaining):
        if start.remaining > limit and not any(start.start.values()):
            fits.append(_linear(problem, start))
            continue
        fit = refine(
            problem, start.start, start.slopes, ITERATIONS if start.remaining <= limit else 1
        )
        if fit.remaining <= negligible:
            limit = min(limit, max(MAX_FIT_RATIO * start.remaining, MAX_FIT_SHARE))
        fits.append(fit)
    return fits
