"""What full runs at one step after another, each half or twice the last, bear out together.

The order of the global error, its limit as h -> 0, and whether the shipped step's own error is what
the finer runs make expect. A run bears witness as far as it is resolved: where a motion multiplies
any difference, as chaos does, what the runs are from there on says nothing of the model.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.engines.protocol import Model
from physics_crosscheck.harness.numerics.batch import Batch
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.full_run import SampledRun, follow
from physics_crosscheck.harness.numerics.ladder import EPSILON, weights
from physics_crosscheck.harness.numerics.rounding import NEAR, without_companions
from physics_crosscheck.harness.numerics.segments import run_rung
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.motion import Motion

SMALL = 0.05
"""Errors up to this share of the amplitude count as small: the expansion in h still leads there."""

ROUNDING = 1e-10

RESIDUAL = 1e-8
"""What rounding, and the samples, may leave of the extrapolated error of full runs."""

SLACK = 0.3
"""An observed order may be this far off: runs are not fine enough for the leading term alone."""

NEXT_ORDERS = 3
"""Orders after the leading one that a shipped step's error may be made of. Whichever of them leads,
what the other runs foretell moves with each run by no less than a known share of what it is off."""

NUDGE = 1e-7
"""Relative distance of the start whose run shows how a motion multiplies differences."""


@dataclass(frozen=True, kw_only=True)
class Sensitivity:
    """How a motion multiplies differences, and what is to be expected of a run's error.

    An error made at time s is at time t what a difference between two runs has become since. So the
    error is at most the sum over the segments begun, K(t) e max g(t)/g(s), s <= t.

    Attributes:
        t: times, (S,).
        growth: largest g(t')/g(s) for s <= t' <= t, (S,).
        begun: segments begun at each time, (S,).
        local: largest error e over a segment, relative to the amplitude, at `step`.
        step: seconds.
        order: of the method.
        epsilon: relative rounding of the engine's numbers.
    """

    t: Array
    growth: Array
    begun: Array
    local: float
    step: float
    order: int
    epsilon: float = EPSILON

    def horizon(self, h: float) -> float:
        """Time until which the error of a run with step h is to be expected small."""
        expected = self.begun * self.growth * self.local * (h / self.step) ** self.order
        large = expected > SMALL
        return float(self.t[max(int(np.argmax(large)) - 1, 0)] if large.any() else self.t[-1])

    def of_rounding(self, until: float) -> float:
        """What an epsilon of the amplitude in every segment has become by then, relative to it."""
        share = (self.begun * self.growth)[self.t <= until]
        return float(np.max(share, initial=0.0)) * self.epsilon


def sensitivity(
    model: Model,
    coordinates: CoordinateMap,
    motion: Motion,
    run: SampledRun,
    order: int,
    size: Array,
) -> Sensitivity:
    """Run once more from a start close by, and every segment in two steps.

    Args:
        run: the finest.
        order: that the engine claims.
        size: amplitudes, (2n,).
    """
    nudge = max(NUDGE, model.epsilon**NEAR)
    _, states = follow(model, coordinates, motion, run.h, every=run.every, moved=nudge * size)
    count = min(len(states), len(run.states))
    apart = np.max(np.abs(states[:count] - run.states[:count]) / size, axis=1) / nudge
    apart = np.where(np.isfinite(apart), apart, np.inf)
    least = np.minimum.accumulate(np.maximum(apart, model.epsilon / nudge))
    batch = Batch.of(motion, size)
    starts = without_companions(*coordinates.to_engine(batch.states))
    ends, _ = run_rung(model, coordinates, batch, starts, 2)
    off = np.max(np.abs(ends - motion.end) / size)
    return Sensitivity(
        t=run.t[:count],
        growth=np.maximum.accumulate(np.maximum(apart / least, 1.0)),
        begun=np.searchsorted(motion.t, run.t[:count], side="left").astype(np.float64) + 1,
        local=float(off) if math.isfinite(off) else math.inf,
        step=float(np.max(motion.lengths)) / 2,
        order=order,
        epsilon=model.epsilon,
    )


@dataclass(frozen=True, kw_only=True)
class Witness:
    """What full runs bear out, of positions, relative to the amplitude.

    Attributes:
        order: of the error, observed between the two finest runs; nan where none can be.
        until: end of the stretch on which it was read: errors are small there.
        residual: what is left of the error as h -> 0, by extrapolation of the three finest runs.
        left: how much may be left: what the finest run moved that, rounding, and the reference.
        expected: largest error of the shipped run by what the two beside it foretell, where they
            foretell a small one.
        surprise: by how much the shipped run's error is another there.
        unsure: how sure they are of it.
        settled: whether the order is one that the engine may claim, or can't be told.
        bears_out: whether order and residual are an honest engine's.
        excused: whether less than all runs show was looked at, since the motion is sensitive.
        growth: by what it multiplies differences at most, where that was looked at; else 1.
    """

    order: float
    until: float
    residual: float
    left: float
    expected: float
    surprise: float
    unsure: float
    settled: bool
    bears_out: bool
    excused: bool
    growth: float

    @property
    def foretold(self) -> bool:
        """Whether the shipped run is what the finer ones foretell."""
        return self.surprise <= self.unsure


def witness(
    runs: Sequence[SampledRun],
    claimed: int,
    size: Array,
    motion: Motion,
    sensitive: Sensitivity | None = None,
) -> Witness:
    """What runs bear out: the shipped one, then others, of halves and doubles of its step.

    Args:
        claimed: order that the engine claims.
        size: amplitudes of the positions, (n,).
        sensitive: how the motion multiplies differences, where that is to be an excuse.
    """
    shipped = runs[0]
    beside = runs[1:3]
    runs = sorted(runs, key=lambda run: -run.h)
    first = first_break_off(runs[0].h, motion)
    ends = [motion.duration, motion.duration]
    if sensitive is not None:
        ends = [sensitive.horizon(run.h) for run in (runs[max(len(runs) - 3, 0)], runs[0])]
    lost = max(run.rounding for run in runs)
    order, until = _order(*_legible(runs, size, max(ROUNDING, lost)), size, ends[0])
    until = float(min(until, first))
    residual, increment = _residual(runs[-3:], until, claimed, size)
    times = runs[0].t[runs[0].t <= until]
    known = motion.global_bound_at(times)[:, : len(size)] / size
    left = increment + max(RESIDUAL, lost) + float(np.max(known, initial=0.0))
    if sensitive is not None:
        left += sensitive.of_rounding(until)
    nothing = sensitive is not None and not math.isfinite(order)
    low, high = claimed - SLACK, claimed + NEXT_ORDERS + SLACK
    rounded = min(largest(runs[0], size), largest(runs[-1], size)) <= max(ROUNDING, lost)
    settled = rounded or nothing or low <= order <= high
    expected, surprise, unsure = _foretold(shipped, beside, min(first, ends[1]), claimed, size)
    return Witness(
        order=order,
        until=until,
        residual=residual,
        left=left,
        expected=expected,
        surprise=surprise,
        unsure=unsure,
        settled=settled,
        bears_out=shipped.finite and settled and residual <= left,
        excused=sensitive is not None and min(ends) < motion.duration * (1 - 1e-9),
        growth=1.0 if sensitive is None else float(sensitive.growth[-1]),
    )


def largest(run: SampledRun, size: Array) -> float:
    """Largest position error of a run, relative to the amplitude; infinite if it is not finite."""
    value = float(np.max(np.abs(run.error[:, : len(size)]) / size))
    return value if math.isfinite(value) else math.inf


def largest_velocity(run: SampledRun, size: Array) -> float:
    """Largest velocity error of a run, relative to the amplitude; infinite if it is not finite."""
    value = float(np.max(np.abs(run.error[:, -len(size) :]) / size))
    return value if math.isfinite(value) else math.inf


def _legible(
    runs: Sequence[SampledRun], size: Array, floor: float
) -> tuple[SampledRun, SampledRun]:
    """Of runs from coarse to fine the two finest whose errors are above rounding, if any are."""
    for coarse, fine in reversed(list(pairwise(runs))):
        if largest(fine, size) > floor:
            return coarse, fine
    return runs[-2], runs[-1]


def _order(coarse: SampledRun, fine: SampledRun, size: Array, end: float) -> tuple[float, float]:
    """Observed order of two runs, read where both errors are still small."""
    if not (coarse.finite and fine.finite):
        return math.nan, 0.0
    n = len(size)
    until = min(coarse.t[-1], fine.t[-1], end)
    for run in (coarse, fine):
        until = min(until, _until(run.t, np.abs(run.error[:, :n]) > SMALL * size))
    errors = [float(np.max(np.abs(run.error[run.t <= until, :n]) / size)) for run in (coarse, fine)]
    if min(errors) == 0.0 or until == 0.0:
        return math.nan, until
    return math.log(errors[0] / errors[1]) / math.log(coarse.h / fine.h), until


def _until(t: Array, large: NDArray[np.bool_]) -> float:
    """The last of the times before any component is large; the last of all where none is."""
    any_large = np.any(large, axis=1)
    if not any_large.any():
        return float(t[-1])
    return float(t[max(int(np.argmax(any_large)) - 1, 0)])


def first_break_off(h: float, motion: Motion) -> float:
    """Time of the first break of the input that steps of h don't reach; else the end.

    From there on the error depends on where between two steps the break falls, not on h alone.
    """
    for span in motion.spans[1:]:
        if abs(span.start / h - round(span.start / h)) > 1e-6:
            return span.start
    return motion.duration


def _residual(
    runs: Sequence[SampledRun], until: float, claimed: int, size: Array
) -> tuple[float, float]:
    """Error of the runs extrapolated to h -> 0, and by how much the finest run moved it.

    What is carried from step to step over longer than a segment shows here alone: each finer run
    of an honest engine leaves less than it moves.
    """
    if not all(run.finite for run in runs) or len(runs) < 3:
        return 0.0, 0.0
    errors = _together(runs, until, size)
    until = _until(runs[0].t[: errors.shape[1]], np.abs(errors[0]) > SMALL)
    errors = errors[:, runs[0].t[: errors.shape[1]] <= until]
    rungs = tuple(2**i for i in range(len(runs)))
    fine = np.tensordot(weights(rungs, (claimed, 1)), errors, axes=1)
    coarse = np.tensordot(weights(rungs[:-1], (claimed, 1)), errors[:-1], axes=1)
    return float(np.max(np.abs(fine))), float(np.max(np.abs(fine - coarse)))


def _together(runs: Sequence[SampledRun], until: float, size: Array) -> Array:
    """Position errors of all runs at their common times up to `until`, (runs, S, n), relative."""
    count = min(int(np.sum(run.t <= until * (1 + 1e-12))) for run in runs)
    return np.stack([run.error[:count, : len(size)] / size for run in runs])


def _foretold(
    shipped: SampledRun, others: Sequence[SampledRun], until: float, claimed: int, size: Array
) -> tuple[float, float, float]:
    """The shipped run's error by two others, by how much it is another, and how sure that is.

    With e(h) = c_p h^p + c_(p+1) h^(p+1) + ..., one other run foretells the leading term, two the
    next as well. Whichever later order leads, of the next `NEXT_ORDERS`, both foretellings differ
    by a known share of what the second is off. An error that the shipped step alone makes is of no
    order: neither moves.
    """
    runs = (shipped, *others)
    lost = max(run.rounding for run in runs)
    if len(others) < 2 or not all(run.finite for run in runs):
        return 0.0, 0.0, max(RESIDUAL, lost)
    own, *beside = _together(runs, until, size)
    ratios = [Fraction(other.h / shipped.h) for other in others]
    one, two = _powers(ratios[:1], claimed), _powers(ratios, claimed)
    rough = float(one[0]) * beside[0]
    better = np.tensordot([float(w) for w in two], np.stack(beside), axes=1)
    t = shipped.t[: len(own)]
    kept = t <= _until(t, np.maximum(np.abs(rough), np.abs(better)) > SMALL)
    share = Fraction(0)
    for exponent in range(claimed + 2, claimed + NEXT_ORDERS + 1):
        by_one, by_two = (
            sum((w * r**exponent for w, r in zip(ws, ratios, strict=False)), Fraction(0))
            for ws in (one, two)
        )
        share = max(share, abs(1 - by_two) / abs(by_two - by_one))
    moved = float(np.max(np.abs(better - rough)[kept]))
    off = float(np.max(np.abs(own - better)[kept]))
    return float(np.max(np.abs(better)[kept])), off, float(share) * moved + max(RESIDUAL, lost)


def _powers(ratios: Sequence[Fraction], lead: int) -> list[Fraction]:
    """Weights of the errors at one multiple of a step, or two, that give that at the step itself.

    Exact for errors in its powers `lead`, `lead` + 1, ..., as many as there are weights.
    """
    if len(ratios) == 1:
        return [1 / ratios[0] ** lead]
    # a + b = 1 and a r + b s = 1 for the shares a and b of the power `lead`.
    r, s = ratios
    a = (1 - s) / (r - s)
    return [a / r**lead, (1 - a) / s**lead]
