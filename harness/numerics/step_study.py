"""Error of the file's own time step, and steps for given errors."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

import numpy as np

from physics_crosscheck.harness.engines.protocol import LoadedModel
from physics_crosscheck.harness.records.base import number
from physics_crosscheck.harness.records.case import ErrorDecomposition, EventTime
from physics_crosscheck.reference.dynamics.equations import VectorFunction
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.segments import Motion
from .convergence import (
    SMALL_ERROR,
    FullRunCheck,
    check_full_runs,
    first_break_off,
    largest,
    largest_velocity,
    sensitivity,
)
from .coordinates import CoordinateMap
from .full_run import CompleteRun, SampledRun, beginning, follows, full_run

TARGETS = (0.01, 0.001, 0.0001)
"""Errors of positions and velocities, relative to their amplitudes, for which a step is given."""

MOST_STEPS = 60_000
MOST_RUNS = 6

TINY_ERROR = 1e-5
"""Up to this global error, relative to the amplitude, only coarser runs are compared. They show
orders where finer runs show only rounding, and together take fewer steps than the first run. They
may miss less than the reported error. Above it, runs of half and twice the step are compared; if
these do not converge, runs of a quarter and less."""

CLEAR_ERROR = 1e-6
"""Coarser runs are added until their errors are clearly above rounding, and at least two."""

MOST_COARSER = 7
MIN_STEPS = 16
"""Smallest number of steps of a coarser run, per period of the fastest rate, and in total."""

MAX_DECOMPOSED_ERROR = 0.3
"""Largest error, relative to the amplitude, that is decomposed."""


@dataclass(frozen=True, kw_only=True)
class StepStudy:
    """Cost and error of the time step, from full runs at several steps.

    Attributes:
        base_run: run at the file's own time step.
        others: runs at half of it, and at twice or a quarter; or at twice of it and more.
        global_error: largest position error at the file's time step, relative to the amplitude.
        velocity_error: largest velocity error there, relative to the amplitude.
        full_run_check: joint evidence of the runs.
        decomposition: of the error of the worst position; None if it is not small.
        steps_for: step at which all errors of positions and velocities are at most each of
            `TARGETS`, seconds; None if the order is unknown.
        checked: (target, step, larger measured error of both) of the one prediction that was run.
        events: events in the run at the file's time step.
    """

    base_run: CompleteRun
    others: tuple[CompleteRun, ...]
    global_error: float
    velocity_error: float
    full_run_check: FullRunCheck
    decomposition: ErrorDecomposition | None
    steps_for: tuple[float | None, ...]
    checked: tuple[float, float, float] | None
    events: tuple[EventTime, ...] = ()


def study_step(
    model: LoadedModel,
    coordinates: CoordinateMap,
    motion: Motion,
    *,
    power: VectorFunction | None,
    amplitude: Array,
    claimed: int,
    agrees: bool = True,
    thorough: bool = True,
    base: CompleteRun | None = None,
) -> StepStudy:
    """Run at the file's own time step and related steps, and report the error of the step.

    Unless it is thorough, the study compares coarser runs, which together take fewer steps than the
    first, and runs finer ones only if these leave the order or the convergence open.

    Args:
        amplitude: unit of relative errors, per component, (2n,), nowhere zero.
        claimed: order that the engine claims.
        agrees: whether the segments agree. If the runs do not converge then, a further run decides
            whether the motion is chaotic.
        thorough: whether finer runs and a check of the predicted steps are always run.
        base: the run at the file's own time step, each step of which follows the engine's rule;
            one related run is then enough.
    """
    size, rates = np.split(amplitude, 2)

    def run(h: float, every: int = 0) -> CompleteRun:
        return full_run(model, coordinates, motion, power, h, every)

    needed = 3 if base is None else 2
    base = base or run(model.step)
    tiny = largest(base, size) <= TINY_ERROR
    limit = MOST_COARSER if tiny or not thorough else 1
    runs = _coarser(run, base, motion, size, limit=limit)
    evidence = _evidence(runs, claimed, size, motion, needed)
    if not (evidence and evidence.conclusive) and (needed < 3 or not tiny):
        runs = [base, _half(run, base), *runs[1:2]]
        evidence = _evidence(runs, claimed, size, motion, needed)
    if evidence is None or (agrees and not evidence.conclusive):
        runs, evidence = _finer(
            run,
            runs[:2] if len(runs) > 1 and runs[1].h < base.h else [base],
            model=model,
            coordinates=coordinates,
            motion=motion,
            claimed=claimed,
            amplitude=amplitude,
            agrees=agrees,
        )
    coarse_to_fine = sorted(runs, key=lambda one: -one.h)
    predicted = tuple(
        _step_for(target, coarse_to_fine, (size, rates), motion) for target in TARGETS
    )
    return StepStudy(
        base_run=base,
        others=tuple(runs[1:]),
        global_error=largest(base, size),
        velocity_error=largest_velocity(base, rates),
        full_run_check=evidence,
        decomposition=_decomposed(base, motion, size),
        steps_for=predicted,
        checked=_check(run, predicted, motion.duration, (size, rates)) if thorough else None,
    )


def _evidence(
    runs: Sequence[CompleteRun], claimed: int, size: Array, motion: Motion, needed: int
) -> FullRunCheck | None:
    return check_full_runs(_alike(runs), claimed, size, motion) if len(runs) >= needed else None


def _half(run: Callable[[float, int], CompleteRun], base: CompleteRun) -> CompleteRun:
    return run(base.h / 2, 2 * base.every)


def _coarser(
    run: Callable[[float, int], CompleteRun],
    base: CompleteRun,
    motion: Motion,
    size: Array,
    *,
    limit: int,
) -> list[CompleteRun]:
    """Return the run at the file's time step, and coarser ones while they follow the motion."""
    runs, every = [base], base.every
    whole = first_break_off(base.h, motion)
    for _ in range(limit):
        h, every = 2 * runs[-1].h, max(1, every // 2)
        is_coarse = motion.duration / h < MIN_STEPS or h * motion.fastest * MIN_STEPS > 2 * math.pi
        large = (
            2 * largest(runs[-1], size) > SMALL_ERROR
        )  # twice the step doubles the error at least
        if is_coarse or large or first_break_off(h, motion) < whole:
            break
        coarse = run(h, every)
        if not coarse.finite or largest(coarse, size) > SMALL_ERROR:
            break
        runs.append(coarse)
        if len(runs) > 2 and largest(coarse, size) > CLEAR_ERROR:
            break
    return runs


def _alike(runs: Sequence[CompleteRun]) -> list[SampledRun]:
    """Return the same runs, sampled at the times of the one with the fewest samples."""
    spacing = max(run.h * run.every for run in runs)
    return [run.thinned(round(spacing / (run.h * run.every))) for run in runs]


def _finer(
    run: Callable[[float, int], CompleteRun],
    runs: list[CompleteRun],
    *,
    model: LoadedModel,
    coordinates: CoordinateMap,
    motion: Motion,
    claimed: int,
    amplitude: Array,
    agrees: bool,
) -> tuple[list[CompleteRun], FullRunCheck]:
    """Return the runs at the file's time step, half of it and less, and their evidence."""
    size = amplitude[: len(amplitude) // 2]
    base = runs[0]
    runs = runs if len(runs) > 1 else [base, _half(run, base)]
    evidence = check_full_runs(runs, claimed, size, motion)
    # Extrapolation needs three runs, and more while errors are too large for the leading term.
    while _wants_more(runs, evidence):
        runs.append(_half(run, runs[-1]))
        evidence = check_full_runs(runs, claimed, size, motion)
    together: list[SampledRun] = [*runs]
    if len(runs) == 2:  # a third full run would take too many steps
        quarter = runs[-1].h / 2, 2 * runs[-1].every
        together.append(beginning(model, coordinates, motion, *quarter, limit=MOST_STEPS))
        evidence = check_full_runs(together, claimed, size, motion)
    usable = agrees and follows(motion, base.h) and base.finite and runs[-1].finite
    if usable and not evidence.conclusive:
        # These runs do not converge, unless no run can follow the motion.
        sensitive = sensitivity(model, coordinates, motion, runs[-1], claimed, amplitude)
        evidence = check_full_runs(together, claimed, size, motion, sensitive)
    return runs, evidence


def _wants_more(runs: list[CompleteRun], evidence: FullRunCheck) -> bool:
    if runs[-1].steps > MOST_STEPS:
        return False
    return len(runs) < 3 or (len(runs) < MOST_RUNS and not evidence.order_plausible)


def _decomposed(run: CompleteRun, motion: Motion, size: Array) -> ErrorDecomposition | None:
    if not run.finite or largest(run, size) > MAX_DECOMPOSED_ERROR:
        return None
    n = len(size)
    component = int(np.argmax(np.max(np.abs(run.error[:, :n]), axis=0) / size))
    return decompose(run.t, run.states[:, component], motion, component)


_Sizes = tuple[Array, Array]
"""Amplitudes of positions and of velocities, (n,) each."""


def _step_for(
    target: float, runs: list[CompleteRun], sizes: _Sizes, motion: Motion
) -> float | None:
    """Return the step for a target error of both positions and velocities.

    None if the step of either is unknown.
    """
    size, rates = sizes
    steps = [
        _on_line(target, [(run.h, largest(run, size)) for run in runs]),
        _on_line(target, [(run.h, largest_velocity(run, rates)) for run in runs]),
    ]
    known_steps = [step for step in steps if step is not None]
    return _handy(min(known_steps), motion) if len(known_steps) == len(steps) else None


def _on_line(target: float, points: list[tuple[float, float]]) -> float | None:
    """Return the step for a target error, on the line through (step, error) in log-log scale.

    None if even the finest run's error is not small, since the line is meaningless there.
    """
    if not all(0 < error < math.inf for _, error in points) or points[-1][1] > SMALL_ERROR:
        return None
    pairs = list(pairwise(points))
    coarse, fine = next((p for p in pairs if p[1][1] <= target), pairs[-1])
    slope = math.log(coarse[1] / fine[1]) / math.log(coarse[0] / fine[0])
    if slope < 0.3:
        return None
    return float(fine[0] * (target / fine[1]) ** (1 / slope))


def _handy(h: float, motion: Motion) -> float:
    """Return a step of at most h that divides every input break, or else has two digits.

    A force that starts between two steps would cause a larger error than the step itself.
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
    run: Callable[..., CompleteRun],
    predicted: tuple[float | None, ...],
    duration: float,
    sizes: _Sizes,
) -> tuple[float, float, float] | None:
    """Run the finest predicted step that is cheap enough: (target, step, measured error)."""
    for target, h in reversed(list(zip(TARGETS, predicted, strict=True))):
        if h is not None and duration / h <= MOST_STEPS / 3:
            measured = run(h)
            size, rates = sizes
            error = max(largest(measured, size), largest_velocity(measured, rates))
            return (target, h, error) if measured.finite else None
    return None


def decompose(t: Array, engine: Array, motion: Motion, component: int) -> ErrorDecomposition:
    """Decompose an error: engine(t) = (1 + gain) reference(t - lag) + shift.

    Gain, lag and shift are linear in t, fitted by least squares. For y = Re(a exp(s t)) + const
    this covers every change of a and s that is small over the motion. With s = -sigma + i omega,

        a exp(s (t - lag)) = a exp(sigma lag) exp(s t - i omega lag):

    a delayed oscillation has decayed less. The amplitude at the end changes by the factor (1 +
    gain) exp(sigma lag), which is to first order gain + damping ratio times phase (of the undamped
    frequency). The phase lags by omega lag.

    Args:
        t: evenly spaced sample times, (S,).
        engine: positions there, (S,).
        component: index of the position in the motion.
    """
    n = motion.start.shape[1] // 2
    end = t[-1]
    gain, lag, shift = np.zeros(2), np.zeros(2), np.zeros(2)
    share = np.stack([np.ones_like(t), t / end], axis=1)
    # Gauss-Newton from zero error: at first order, a phase error of a tenth would leave half a
    # percent of amplitude, which would appear as damping.
    for _ in range(4):
        times = t - share @ lag
        inside = (times >= 0) & (times <= end)
        reference = motion.states_at(np.clip(times, 0, end))
        y, rate = reference[:, component], reference[:, n + component]
        residual = engine - (1 + share @ gain) * y - share @ shift
        basis = np.concatenate([share * y[:, None], -share * rate[:, None], share], axis=1)
        fit, *_ = np.linalg.lstsq(basis[inside], residual[inside], rcond=1e-10)
        gain, lag, shift = gain + fit[:2], lag + fit[2:4], shift + fit[4:]
    residual = (residual - basis @ fit)[inside]
    error = engine - motion.states_at(t)[:, component]
    total = float(np.sum(error[inside] ** 2))
    pace = float(np.std(rate) / max(float(np.std(y)), 1e-300))
    kept = float(np.exp(_decay(t, motion, component) * lag.sum()))
    return ErrorDecomposition(
        amplitude=number(float((1 + gain.sum()) * kept - 1)),
        phase=number(float(lag.sum() * pace)),
        frequency=number(float(-lag[1] / end)),
        damping=number(-gain[1] / end / pace) if pace > 0 else 0.0,
        explained=number(1.0 - float(np.sum(residual**2)) / total) if total > 0 else 1.0,
    )


def _decay(t: Array, motion: Motion, component: int) -> float:
    """Return the decay rate sigma of a position's oscillation, 1/s.

    Between samples, (y - const, v) of Re(a exp(s t)) + const is multiplied by a constant matrix,
    whose determinant is exp(-2 sigma) of the time between. The matrix is fitted. The result has no
    meaning for other motions.
    """
    n = motion.start.shape[1] // 2
    states = motion.states_at(t)
    pair = np.stack([states[:, component], states[:, n + component]], axis=1)
    size = np.max(np.abs(pair), axis=0)
    if len(t) < 8 or not size.all():
        return 0.0
    pair = pair / size
    before = np.concatenate([pair[:-1], np.ones((len(t) - 1, 1))], axis=1)
    turned, *_ = np.linalg.lstsq(before, pair[1:], rcond=None)
    determinant = float(np.linalg.det(turned[:2]))
    return -np.log(determinant) / (2 * float(t[1] - t[0])) if determinant > 0 else 0.0
