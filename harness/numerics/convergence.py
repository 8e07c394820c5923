"""Convergence of full runs over steps that halve or double.

The runs show the order of the global error, its limit as h -> 0, and whether the error at the
file's own time step matches the prediction of the other runs. Only resolved parts of a run count.
Where a chaotic motion amplifies every difference, the runs do not test the model.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.engines.protocol import LoadedModel
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.segments import Motion
from .coordinates import CoordinateMap
from .full_run import SampledRun, follow
from .ladder import EPSILON, weights
from .rounding import COMPANION_EXPONENT, without_companions
from .segments import run_rung

SMALL_ERROR = 0.05
"""Largest error, relative to the amplitude, for which the expansion in h is dominated by its first
term."""

ROUNDING_FLOOR = 1e-10

RESIDUAL_TOLERANCE = 1e-8
"""Largest extrapolated error of full runs that rounding and sampling may cause."""

ORDER_TOLERANCE = 0.3
"""Tolerance of an observed order, for runs that are too coarse for the leading term alone."""

NEXT_ORDERS = 3
"""Orders after the leading one that an error may contain. For each of them, the predictions change
between runs by at least a known share of their error."""

START_PERTURBATION = 1e-7
"""Relative perturbation of the start, to measure how a motion amplifies differences."""


@dataclass(frozen=True, kw_only=True)
class Sensitivity:
    """Amplification of differences by a motion, and the expected error of a run.

    An error made at time s grows until time t like the difference of two runs. So the error is at
    most the sum over the segments started, K(t) e max g(t)/g(s), s <= t.

    Attributes:
        t: times, (S,).
        growth: largest g(t')/g(s) for s <= t' <= t, (S,).
        started: number of segments started at each time, (S,).
        local: largest error e over a segment, relative to the amplitude, at `step`.
        step: seconds.
        order: order of the method.
        epsilon: relative rounding of the engine's numbers.
    """

    t: Array
    growth: Array
    started: Array
    local: float
    step: float
    order: int
    epsilon: float = EPSILON

    def horizon(self, h: float) -> float:
        """Return the time until which a run with step h should have a small error."""
        expected = self.started * self.growth * self.local * (h / self.step) ** self.order
        large = expected > SMALL_ERROR
        return float(self.t[max(int(np.argmax(large)) - 1, 0)] if large.any() else self.t[-1])

    def of_rounding(self, until: float) -> float:
        """Return the effect of one epsilon of rounding per segment, relative to the amplitude."""
        share = (self.started * self.growth)[self.t <= until]
        return float(np.max(share, initial=0.0)) * self.epsilon


def sensitivity(
    model: LoadedModel,
    coordinates: CoordinateMap,
    motion: Motion,
    run: SampledRun,
    order: int,
    size: Array,
) -> Sensitivity:
    """Measure the amplification with a run from a perturbed start, and segments of two steps.

    Args:
        run: the finest run.
        order: order that the engine claims.
        size: amplitudes, (2n,).
    """
    nudge = max(START_PERTURBATION, model.epsilon**COMPANION_EXPONENT)
    _, states = follow(model, coordinates, motion, run.h, every=run.every, moved=nudge * size)
    count = min(len(states), len(run.states))
    apart = np.max(np.abs(states[:count] - run.states[:count]) / size, axis=1) / nudge
    apart = np.where(np.isfinite(apart), apart, np.inf)
    least = np.minimum.accumulate(np.maximum(apart, model.epsilon / nudge))
    starts = without_companions(*coordinates.to_engine(motion.start))
    ends, _ = run_rung(model, coordinates, motion, starts, 2)
    off = np.max(np.abs(ends - motion.end) / size)
    return Sensitivity(
        t=run.t[:count],
        growth=np.maximum.accumulate(np.maximum(apart / least, 1.0)),
        started=np.searchsorted(motion.t, run.t[:count], side="left").astype(np.float64) + 1,
        local=float(off) if math.isfinite(off) else math.inf,
        step=float(np.max(motion.lengths)) / 2,
        order=order,
        epsilon=model.epsilon,
    )


@dataclass(frozen=True, kw_only=True)
class FullRunCheck:
    """Evidence from full runs, of positions, relative to the amplitude.

    Attributes:
        order: order of the error, observed between the two finest runs; nan if unknown.
        until: end of the interval with small errors, on which the order is measured.
        residual: error extrapolated to h -> 0 from the three finest runs.
        bound: bound of the residual: the finest run's change of it, rounding, and the reference.
        expected: largest error of the run at the file's time step, predicted by two other runs on
            the interval where they predict small ones.
        deviation: difference of that run's error from the prediction.
        deviation_bound: uncertainty of the prediction.
        order_plausible: whether the order is one that the engine may claim, or unknown.
        converges: whether order and residual converge as an accurate model's do.
        partly_chaotic: whether only a part of the runs was used, since the motion is chaotic.
        growth: largest amplification of differences, if measured; else 1.
    """

    order: float
    until: float
    residual: float
    bound: float
    expected: float
    deviation: float
    deviation_bound: float
    order_plausible: bool
    converges: bool
    partly_chaotic: bool
    growth: float

    @property
    def predicted(self) -> bool:
        """True if the run at the file's time step matches the prediction of the other runs."""
        return self.deviation <= self.deviation_bound

    @property
    def conclusive(self) -> bool:
        """True if the runs converge, and predict the run at the file's time step."""
        return self.converges and self.predicted


def check_full_runs(
    runs: Sequence[SampledRun],
    claimed: int,
    size: Array,
    motion: Motion,
    sensitive: Sensitivity | None = None,
) -> FullRunCheck:
    """Return the evidence of runs: first at the file's time step, then at halves and doubles of it.

    Args:
        claimed: order that the engine claims.
        size: amplitudes of the positions, (n,).
        sensitive: amplification of differences, to exclude the chaotic part of the motion.
    """
    base = runs[0]
    others = runs[1:3]
    runs = sorted(runs, key=lambda run: -run.h)
    first = first_break_off(runs[0].h, motion)
    ends = [motion.duration, motion.duration]
    if sensitive is not None:
        ends = [sensitive.horizon(run.h) for run in (runs[max(len(runs) - 3, 0)], runs[0])]
    lost = max(run.rounding for run in runs)
    order, until = _order(*_above_rounding(runs, size, max(ROUNDING_FLOOR, lost)), size, ends[0])
    until = float(min(until, first))
    residual, increment = _residual(runs[-3:], until, claimed, size)
    times = runs[0].t[runs[0].t <= until]
    reference_bound = motion.global_bound_at(times)[:, : len(size)] / size
    bound = increment + max(RESIDUAL_TOLERANCE, lost) + float(np.max(reference_bound, initial=0.0))
    if sensitive is not None:
        bound += sensitive.of_rounding(until)
    nothing = sensitive is not None and not math.isfinite(order)
    low, high = claimed - ORDER_TOLERANCE, claimed + NEXT_ORDERS + ORDER_TOLERANCE
    rounded = min(largest(runs[0], size), largest(runs[-1], size)) <= max(ROUNDING_FLOOR, lost)
    order_plausible = rounded or nothing or low <= order <= high
    expected, deviation, deviation_bound = _prediction(
        base, others, min(first, ends[1]), claimed, size
    )
    return FullRunCheck(
        order=order,
        until=until,
        residual=residual,
        bound=bound,
        expected=expected,
        deviation=deviation,
        deviation_bound=deviation_bound,
        order_plausible=order_plausible,
        converges=base.finite and order_plausible and residual <= bound,
        partly_chaotic=sensitive is not None and min(ends) < motion.duration * (1 - 1e-9),
        growth=1.0 if sensitive is None else float(sensitive.growth[-1]),
    )


def largest(run: SampledRun, size: Array) -> float:
    """Return the largest position error, relative to the amplitude; infinite if not finite."""
    value = float(np.max(np.abs(run.error[:, : len(size)]) / size))
    return value if math.isfinite(value) else math.inf


def largest_velocity(run: SampledRun, size: Array) -> float:
    """Return the largest velocity error, relative to the amplitude; infinite if not finite."""
    value = float(np.max(np.abs(run.error[:, -len(size) :]) / size))
    return value if math.isfinite(value) else math.inf


def _above_rounding(
    runs: Sequence[SampledRun], size: Array, floor: float
) -> tuple[SampledRun, SampledRun]:
    """Return the two finest runs with errors above rounding, else the two finest."""
    for coarse, fine in reversed(list(pairwise(runs))):
        if largest(fine, size) > floor:
            return coarse, fine
    return runs[-2], runs[-1]


def _order(coarse: SampledRun, fine: SampledRun, size: Array, end: float) -> tuple[float, float]:
    """Return the observed order of two runs, on the interval where both errors are small."""
    if not (coarse.finite and fine.finite):
        return math.nan, 0.0
    n = len(size)
    until = min(coarse.t[-1], fine.t[-1], end)
    for run in (coarse, fine):
        until = min(until, _until(run.t, np.abs(run.error[:, :n]) > SMALL_ERROR * size))
    errors = [float(np.max(np.abs(run.error[run.t <= until, :n]) / size)) for run in (coarse, fine)]
    if min(errors) == 0.0 or until == 0.0:
        return math.nan, until
    return math.log(errors[0] / errors[1]) / math.log(coarse.h / fine.h), until


def _until(t: Array, large: NDArray[np.bool_]) -> float:
    """Return the last time before any component is large; the last of all if all are small."""
    any_large = np.any(large, axis=1)
    if not any_large.any():
        return float(t[-1])
    return float(t[max(int(np.argmax(any_large)) - 1, 0)])


def first_break_off(h: float, motion: Motion) -> float:
    """Return the time of the first input break that is not a multiple of h; else the end.

    Afterwards the error also depends on the position of the break within a step.
    """
    for span in motion.spans[1:]:
        if abs(span.start / h - round(span.start / h)) > 1e-6:
            return span.start
    return motion.duration


def _residual(
    runs: Sequence[SampledRun], until: float, claimed: int, size: Array
) -> tuple[float, float]:
    """Return the error extrapolated to h -> 0, and how much the finest run changed it.

    Only this error contains effects that an engine carries over more than a segment. For an
    accurate model, each finer run changes it by more than what remains.
    """
    if not all(run.finite for run in runs) or len(runs) < 3:
        return 0.0, 0.0
    errors = _together(runs, until, size)
    until = _until(runs[0].t[: errors.shape[1]], np.abs(errors[0]) > SMALL_ERROR)
    errors = errors[:, runs[0].t[: errors.shape[1]] <= until]
    rungs = tuple(2**i for i in range(len(runs)))
    fine = np.tensordot(weights(rungs, (claimed, 1)), errors, axes=1)
    coarse = np.tensordot(weights(rungs[:-1], (claimed, 1)), errors[:-1], axes=1)
    return float(np.max(np.abs(fine))), float(np.max(np.abs(fine - coarse)))


def _together(runs: Sequence[SampledRun], until: float, size: Array) -> Array:
    """Return relative position errors of all runs up to `until`, (runs, S, n), at common times."""
    count = min(int(np.sum(run.t <= until * (1 + 1e-12))) for run in runs)
    return np.stack([run.error[:count, : len(size)] / size for run in runs])


def _prediction(
    base: SampledRun, others: Sequence[SampledRun], until: float, claimed: int, size: Array
) -> tuple[float, float, float]:
    """Return the predicted largest error, the deviation from it, and its uncertainty.

    They are for the run at the file's time step, from two other runs. With e(h) = c_p h^p + c_(p+1)
    h^(p+1) + ..., one other run predicts the leading term, and two runs also the next. For each of
    the next `NEXT_ORDERS` orders, both predictions differ by a known share of the error of the
    second. An error that occurs only at the file's time step has no order, and changes neither.
    """
    runs = (base, *others)
    lost = max(run.rounding for run in runs)
    if len(others) < 2 or not all(run.finite for run in runs):
        return 0.0, 0.0, max(RESIDUAL_TOLERANCE, lost)
    errors, *other_errors = _together(runs, until, size)
    ratios = [Fraction(other.h / base.h) for other in others]
    single, double = _powers(ratios[:1], claimed), _powers(ratios, claimed)
    rough = float(single[0]) * other_errors[0]
    better = np.tensordot([float(w) for w in double], np.stack(other_errors), axes=1)
    t = base.t[: len(errors)]
    kept = t <= _until(t, np.maximum(np.abs(rough), np.abs(better)) > SMALL_ERROR)
    share = Fraction(0)
    for exponent in range(claimed + 2, claimed + NEXT_ORDERS + 1):
        by_one, by_two = (
            sum((w * r**exponent for w, r in zip(ws, ratios, strict=False)), Fraction(0))
            for ws in (single, double)
        )
        share = max(share, abs(1 - by_two) / abs(by_two - by_one))
    moved = float(np.max(np.abs(better - rough)[kept]))
    off = float(np.max(np.abs(errors - better)[kept]))
    return (
        float(np.max(np.abs(better)[kept])),
        off,
        float(share) * moved + max(RESIDUAL_TOLERANCE, lost),
    )


def _powers(ratios: Sequence[Fraction], lead: int) -> list[Fraction]:
    """Return weights of errors at one or two multiples of a step that sum to the error at it.

    They are exact for errors in its powers `lead`, `lead` + 1, ..., as many as there are weights.
    """
    if len(ratios) == 1:
        return [1 / ratios[0] ** lead]
    # a + b = 1 and a r + b s = 1 for the shares a and b of the power `lead`.
    r, s = ratios
    a = (1 - s) / (r - s)
    return [a / r**lead, (1 - a) / s**lead]
