"""Full runs, from start to end, at the shipped step and its neighbours, and their global error."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

import numpy as np

from harness.engines.protocol import Model
from harness.numerics.coordinates import CoordinateMap
from harness.numerics.energy import EnergyBalance, energy_balance
from harness.numerics.ladder import weights
from reference.motion import Motion
from reference.numeric import Array, NumericFunction

TARGETS = (0.01, 0.001, 0.0001)
"""Global errors, relative to the amplitude, for which a step is told."""

SAMPLES = 1000
SMALL = 0.05
"""Errors up to this share of the amplitude count as small: the expansion in h still leads there."""

ROUNDING = 1e-10

RESIDUAL = 1e-8
"""What rounding, and the samples, may leave of the extrapolated error of full runs."""
MOST_STEPS = 60_000
MOST_RUNS = 6


@dataclass(frozen=True, kw_only=True)
class FullRun:
    """One run from start to end at one step, sampled.

    Attributes:
        h: step, seconds.
        steps: steps taken.
        every: steps from sample to sample.
        t: sample times, (S,).
        states: (S, 2n).
        error: engine - reference, (S, 2n).
        drift: largest constraint drift, in engine units.
        balance: of the energy.
        seconds: that the engine took, of wall-clock time.
    """

    h: float
    steps: int
    every: int
    t: Array
    states: Array
    error: Array
    drift: float
    balance: EnergyBalance
    seconds: float

    @property
    def energy(self) -> float:
        """Largest imbalance of the energy, relative to what is exchanged."""
        return self.balance.error

    @property
    def finite(self) -> bool:
        """Whether the run stayed finite throughout."""
        return bool(np.isfinite(self.states).all())


@dataclass(frozen=True, kw_only=True)
class ErrorDecomposition:
    """An oscillation's error by its parts: engine(t) = (1 + gain) reference(t - lag) + shift.

    Gain, lag and shift are linear in t, found by least squares. For y = Re(a exp(s t)) + const this
    is every change of a and s that is small over the motion.

    Attributes:
        amplitude: relative error of the amplitude at the end.
        phase: phase error at the end, rad; positive lags behind.
        frequency: relative error of the frequency.
        damping: error of the damping ratio.
        explained: share of the mean square error that this explains.
    """

    amplitude: float
    phase: float
    frequency: float
    damping: float
    explained: float


@dataclass(frozen=True, kw_only=True)
class StepStudy:
    """What the step costs, from full runs at several.

    Attributes:
        shipped: run at the shipped step.
        finer: runs at half, and where needed a quarter, of it.
        global_error: largest position error at the shipped step, relative to the amplitude.
        global_order: observed order of the global error between the two finest runs.
        resolved_until: end of the stretch on which the order was read: errors are small there.
        converges: whether the global error falls with the claimed order, and to nothing.
        global_residual: what is left of it as h -> 0, by extrapolation of the runs where they are
            small, relative to the amplitude.
        decomposition: of the error of the position with the largest; None where it is not small.
        steps_for: step that would give each of `TARGETS`, seconds; None where the order is unknown.
        checked: (target, step, measured error) of the one prediction that was run.
    """

    shipped: FullRun
    finer: tuple[FullRun, ...]
    global_error: float
    global_order: float
    resolved_until: float
    converges: bool
    global_residual: float
    decomposition: ErrorDecomposition | None
    steps_for: tuple[float | None, ...]
    checked: tuple[float, float, float] | None


def full_run(
    model: Model,
    coordinates: CoordinateMap,
    motion: Motion,
    power: NumericFunction,
    h: float,
    every: int = 0,
) -> FullRun:
    """Run a motion from start to end with step h, sampled every so many steps (0: as it fits)."""
    t, states, zs, steps, every, seconds = _rolled(model, coordinates, motion, h, every)
    reference = motion.at(t)
    balance = energy_balance(t, states, motion, power)
    return FullRun(
        h=h,
        steps=steps,
        every=every,
        t=t,
        states=states,
        error=states - reference,
        drift=coordinates.drift(zs),
        balance=balance,
        seconds=seconds,
    )


def follow(
    model: Model, coordinates: CoordinateMap, motion: Motion, h: float
) -> tuple[Array, Array]:
    """Sample times (S,) and states (S, 2n) of a motion's run from start to end with step h."""
    return _rolled(model, coordinates, motion, h, 0)[:2]


def _rolled(
    model: Model, coordinates: CoordinateMap, motion: Motion, h: float, every: int
) -> tuple[Array, Array, Array, int, int, float]:
    steps = math.floor(motion.duration / h * (1 + 1e-12))
    every = every or max(1, steps // SAMPLES)
    steps -= steps % every
    inputs = motion.inputs(h * np.arange(steps, dtype=np.float64), slack=1e-6 * h)[None]
    z, w = coordinates.to_engine(motion.start[:1])
    force = coordinates.force(inputs)
    began = time.perf_counter()
    zs, ws = model.rollout(z, w, h, steps, force, every)
    seconds = time.perf_counter() - began
    grid: Array = h * every * np.arange(steps // every + 1, dtype=np.float64)
    t: Array = np.minimum(grid, motion.duration)
    zs, ws = np.concatenate([z, zs[0]]), np.concatenate([w, ws[0]])
    states = coordinates.follow(zs, ws, motion.start[0])
    return t, states, zs, steps, every, seconds


def study_step(
    model: Model,
    coordinates: CoordinateMap,
    motion: Motion,
    *,
    power: NumericFunction,
    amplitude: Array,
    claimed: int,
) -> StepStudy:
    """Run at the shipped step and its neighbours, and tell what the step costs.

    Args:
        amplitude: what errors are relative to, per component, (2n,).
        claimed: order that the engine claims.
    """
    n = len(amplitude) // 2
    size = amplitude[:n]

    def run(h: float) -> FullRun:
        return full_run(model, coordinates, motion, power, h)

    shipped = run(model.step)
    runs = [shipped]
    order, until = math.nan, 0.0
    # Three runs to extrapolate; more where errors are not small enough yet for the leading term.
    while _wants_more(runs, order, claimed, size):
        half = runs[-1].h / 2, 2 * runs[-1].every
        runs.append(full_run(model, coordinates, motion, power, *half))
        order, until = _order(runs[-2], runs[-1], size)
    until = min(until, _first_break_off(model.step, motion))
    residual, increment = _residual(runs, until, claimed, size)
    converges = shipped.finite and _bears_out(order, claimed, runs, size)
    converges = converges and residual <= increment + RESIDUAL
    predicted = tuple(_step_for(target, runs, size, motion) for target in TARGETS)
    return StepStudy(
        shipped=shipped,
        finer=tuple(runs[1:]),
        global_error=_largest(shipped, size),
        global_order=order,
        resolved_until=until,
        converges=converges,
        global_residual=residual,
        decomposition=_decompose(shipped, motion, size),
        steps_for=predicted,
        checked=_check(run, predicted, motion.duration, size),
    )


def _largest(run: FullRun, size: Array) -> float:
    value = float(np.max(np.abs(run.error[:, : len(size)]) / size))
    return value if math.isfinite(value) else math.inf


def _order(coarse: FullRun, fine: FullRun, size: Array) -> tuple[float, float]:
    """Observed order of two runs, read where the finer one's error is still small."""
    if not (coarse.finite and fine.finite):
        return math.nan, 0.0
    n = len(size)
    until = min(coarse.t[-1], fine.t[-1])
    for run in (coarse, fine):
        large = np.any(np.abs(run.error[:, :n]) > SMALL * size, axis=1)
        if large.any():
            until = min(until, float(run.t[max(int(np.argmax(large)) - 1, 0)]))
    errors = [float(np.max(np.abs(run.error[run.t <= until, :n]) / size)) for run in (coarse, fine)]
    if min(errors) == 0.0 or until == 0.0:
        return math.nan, until
    return math.log(errors[0] / errors[1]) / math.log(coarse.h / fine.h), until


def _wants_more(runs: list[FullRun], order: float, claimed: int, size: Array) -> bool:
    last = runs[-1]
    if len(runs) < 2 or (len(runs) < 3 and last.steps <= MOST_STEPS):
        return True
    unsettled = not _bears_out(order, claimed, runs, size)
    return unsettled and len(runs) < MOST_RUNS and last.steps <= MOST_STEPS


def _bears_out(order: float, claimed: int, runs: list[FullRun], size: Array) -> bool:
    if _largest(runs[0], size) <= ROUNDING or _largest(runs[-1], size) <= ROUNDING:
        return True
    return order >= claimed - 0.3


def _first_break_off(h: float, motion: Motion) -> float:
    """Time of the first break of the input that steps of h don't reach; else the end.

    From there on the error depends on where between two steps the break falls, not on h alone.
    """
    for span in motion.spans[1:]:
        if abs(span.start / h - round(span.start / h)) > 1e-6:
            return span.start
    return motion.duration


def _residual(runs: list[FullRun], until: float, claimed: int, size: Array) -> tuple[float, float]:
    """Error of the runs extrapolated to h -> 0, and by how much the finest run moved it.

    What is carried from step to step over longer than a segment shows here alone: each finer run
    of an honest engine leaves less than it moves.
    """
    if not all(run.finite for run in runs) or len(runs) < 3:
        return 0.0, 0.0
    count = min(int(np.sum(run.t <= until * (1 + 1e-12))) for run in runs)
    errors = np.stack([run.error[:count, : len(size)] / size for run in runs])
    rungs = tuple(2**i for i in range(len(runs)))
    fine = np.tensordot(weights(rungs, (claimed, 1)), errors, axes=1)
    coarse = np.tensordot(weights(rungs[:-1], (claimed, 1)), errors[:-1], axes=1)
    return float(np.max(np.abs(fine))), float(np.max(np.abs(fine - coarse)))


def _step_for(target: float, runs: list[FullRun], size: Array, motion: Motion) -> float | None:
    """The step of a target error: on the line through the runs' errors, log over log.

    None while even the finest run's error is not small: the line has no meaning there.
    """
    points = [(run.h, _largest(run, size)) for run in runs]
    if not all(0 < error < math.inf for _, error in points) or points[-1][1] > SMALL:
        return None
    pairs = list(pairwise(points))
    coarse, fine = next((p for p in pairs if p[1][1] <= target), pairs[-1])
    slope = math.log(coarse[1] / fine[1]) / math.log(coarse[0] / fine[0])
    if slope < 0.3:
        return None
    return _handy(fine[0] * (target / fine[1]) ** (1 / slope), motion)


def _handy(h: float, motion: Motion) -> float:
    """A step no coarser than h that reaches every break of the input, or else has two digits.

    A force that sets in between two steps would cost more than the step itself.
    """
    breaks = [Fraction(span.start).limit_denominator(10**6) for span in motion.spans[1:]]
    if breaks:
        grid = breaks[0]
        for b in breaks[1:]:
            grid = Fraction(
                math.gcd(grid.numerator * b.denominator, b.numerator * grid.denominator),
                grid.denominator * b.denominator,
            )
        return float(grid / math.ceil(grid / Fraction(h)))
    digits = -math.floor(math.log10(h)) + 1
    return math.floor(h * 10.0**digits) / 10.0**digits


def _check(
    run: Callable[[float], FullRun],
    predicted: tuple[float | None, ...],
    duration: float,
    size: Array,
) -> tuple[float, float, float] | None:
    """Run the finest predicted step that is cheap enough: (target, step, measured error)."""
    for target, h in reversed(list(zip(TARGETS, predicted, strict=True))):
        if h is not None and duration / h <= MOST_STEPS / 3:
            measured = run(h)
            return (target, h, _largest(measured, size)) if measured.finite else None
    return None


def _decompose(run: FullRun, motion: Motion, size: Array) -> ErrorDecomposition | None:
    """Split the error of the worst position into amplitude and phase, and their growth."""
    n = len(size)
    if not run.finite or _largest(run, size) > 0.3:
        return None
    component = int(np.argmax(np.max(np.abs(run.error[:, :n]), axis=0) / size))
    engine = run.states[:, component]
    end = run.t[-1]
    gain, lag, shift = np.zeros(2), np.zeros(2), np.zeros(2)
    share = np.stack([np.ones_like(run.t), run.t / end], axis=1)
    # Gauss-Newton from no error at all: a phase error of a tenth leaves half a percent of amplitude
    # to the second order, which would read as damping.
    for _ in range(4):
        times = run.t - share @ lag
        inside = (times >= 0) & (times <= end)
        reference = motion.at(np.clip(times, 0, end))
        y, rate = reference[:, component], reference[:, n + component]
        left = engine - (1 + share @ gain) * y - share @ shift
        basis = np.concatenate([share * y[:, None], -share * rate[:, None], share], axis=1)
        fit, *_ = np.linalg.lstsq(basis[inside], left[inside], rcond=1e-10)
        gain, lag, shift = gain + fit[:2], lag + fit[2:4], shift + fit[4:]
    left = (left - basis @ fit)[inside]
    total = float(np.sum(run.error[inside, component] ** 2))
    pace = float(np.std(rate) / max(float(np.std(y)), 1e-300))
    return ErrorDecomposition(
        amplitude=float(gain.sum()),
        phase=float(lag.sum() * pace),
        frequency=float(-lag[1] / end),
        damping=float(-gain[1] / end / pace) if pace > 0 else 0.0,
        explained=1.0 - float(np.sum(left**2)) / total if total > 0 else 1.0,
    )
