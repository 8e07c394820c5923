"""Full runs through events: their errors, their event times, and steps for given errors.

An event falls at another phase of a step at every step size, so errors scatter about order 1 or
less. All runs together show whether they fall, and the largest of them gives the steps.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from physics_crosscheck.harness.engines.protocol import LoadedModel
from physics_crosscheck.harness.records.case import EventTime
from physics_crosscheck.reference.dynamics.equations import VectorFunction
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.segments import EventMark, Motion
from .convergence import ROUNDING_FLOOR, FullRunCheck, largest, largest_velocity
from .coordinates import CoordinateMap
from .full_run import CompleteRun, SampledRun, full_run
from .rounding import without_companions
from .segments import run_rung
from .step_study import TARGETS, StepStudy

FACTORS = (4, 2, 1, 1 / 2, 1 / 4, 1 / 8, 1 / 16)
"""Steps of the runs, relative to the file's own one; at most `MOST_STEPS` steps each."""

MOST_STEPS = 60_000
MIN_STEPS = 16
"""Smallest number of steps of a coarser run."""

SCATTER = 4.0
"""Largest factor by which the error over the step may grow from the coarser half of the runs to the
finer half. Errors of order 1 scatter by the phase of the events, by a factor of 2 in most cases;
with order 0.5 the factor is 3 to 4."""

CLEARANCE_STEPS = 2
"""Steps around an event in which velocities are not compared, since they jump there."""

STILL = 1e-9
"""Largest condition that counts as zero, relative to its largest value in a window."""


PHASES = (-3 / 8, -1 / 8, 1 / 8, 3 / 8)
"""Shifts of an event from the middle of a step, in steps."""

PHASE_RUNGS = 9, 81
"""Odd numbers of steps of a segment with an event in its middle, coarse and fine."""

SHRINKS = 0.5
"""Largest ratio of two spreads or errors, at nine times the steps, of a motion that has a limit."""


CONTACT_RUNGS = 81, 243
"""Numbers of steps of a segment in which contacts are watched."""

FEW_OPEN = 0.02
"""Share of steps that counts as none."""

OPEN = 1e-13
"""Smallest gap of an open contact, m: above rounding."""


@dataclass(frozen=True, kw_only=True)
class PhaseSpread:
    """The state after an event whose place in a step differs: one component.

    Attributes:
        time: of the event, s.
        component: index of the component.
        low, high: smallest and largest value at the end of the segment.
        expected: that of the equations.
        relative: high - low over the component's scale.
        off: smallest distance of a limit from `expected`, over the scale; 0 if one can be equal.
        shrinks: whether the spread falls with the step.
    """

    time: float
    component: int
    low: float
    high: float
    expected: float
    relative: float
    off: float
    shrinks: bool


def phase_spread(
    model: LoadedModel, coordinates: CoordinateMap, motion: Motion, time: float
) -> PhaseSpread | None:
    """Return the spread of the states after the event nearest to a time; None without one."""
    rows = [int(np.argmin(np.abs(motion.t + motion.lengths / 2 - e))) for e in motion.events]
    if not rows:
        return None
    row = min(rows, key=lambda one: abs(float(motion.t[one]) - time))
    start, length = float(motion.t[row]), float(motion.lengths[row])
    segment = motion.pick(np.full(len(PHASES), row))
    spreads = list[Array]()
    for rung in PHASE_RUNGS:
        times = start + np.array(PHASES) * length / rung
        moved = replace(segment, start=motion.states_at(times), t=times,
                        end=motion.states_at(times + length))  # fmt: skip
        starts = without_companions(*coordinates.to_engine(moved.start))
        ends = run_rung(model, coordinates, moved, starts, rung)[0]
        spreads.append(ends - moved.end)
    coarse, fine = (np.ptp(one, axis=0) for one in spreads)
    low, high = spreads[-1].min(axis=0), spreads[-1].max(axis=0)
    shrinks = bool(np.all(fine <= SHRINKS * coarse + ROUNDING_FLOOR * motion.unit))
    # What remains of a spread that falls is smaller than it; an error that falls may vanish.
    error = np.maximum(low, -high)
    stays = error > SHRINKS * np.abs(spreads[0]).max(axis=0)
    off = np.maximum(0.0, error - fine) / motion.unit * (shrinks & stays)
    component = int(np.argmax(off if off.any() else fine / motion.unit))
    expected = float(motion.end[row, component])
    return PhaseSpread(
        time=start + length / 2,
        component=component,
        low=expected + float(low[component]),
        high=expected + float(high[component]),
        expected=expected,
        relative=float(fine[component] / motion.unit[component]),
        off=float(off[component]),
        shrinks=shrinks,
    )


@dataclass(frozen=True, kw_only=True)
class LostContact:
    """A contact that opens and closes from step to step, though the motion keeps it pressed.

    Attributes:
        name: of the contact.
        steps: two step sizes, s.
        open: shares of the steps after which it is open.
    """

    name: str
    steps: tuple[float, float]
    open: tuple[float, float]


def lost_contact(
    model: LoadedModel, coordinates: CoordinateMap, motion: Motion, time: float
) -> LostContact | None:
    """Return a contact that is lost in the segment at a time, at two step sizes; None if none is.

    Engines that move along a tangent lift a contact off by the square of the step.
    """
    row = max(int(np.searchsorted(motion.t, time, side="right")) - 1, 0)
    start, length = float(motion.t[row]), float(motion.lengths[row])
    segment = motion.pick(np.array([row]))
    starts = coordinates.to_engine(segment.start)
    runs = []
    for rung in CONTACT_RUNGS:
        h = length / rung
        force = coordinates.force(segment.step_inputs(np.zeros(1, dtype=np.intp), rung))
        z, w = model.rollout(*starts, h, rung, force, 1)
        ends = np.repeat(segment.end, rung, axis=0)
        times: Array = start + h * np.arange(1, rung + 1, dtype=np.float64)
        runs.append((times, coordinates.from_engine(z[0], w[0], ends)))
    for contact in motion.pressed:
        shares = []
        for t, states in runs:
            inside = (t > contact.start) & (t < contact.stop)
            if inside.any():
                q, v = np.split(states[inside], 2, axis=1)
                gaps = contact.gap(q, v, motion.inputs(t[inside]), t[inside, None])[:, 0]
                shares.append(float(np.mean(gaps > OPEN)))
        if shares and min(shares) > FEW_OPEN and max(shares) < 1 - FEW_OPEN:
            first, second = (length / rung for rung in CONTACT_RUNGS)
            return LostContact(
                name=contact.name, steps=(first, second), open=(shares[0], shares[-1])
            )
    return None


def study_events(
    model: LoadedModel,
    coordinates: CoordinateMap,
    motion: Motion,
    *,
    power: VectorFunction | None,
    amplitude: Array,
) -> StepStudy:
    """Run at the file's own time step and related ones, and report errors and event times.

    Args:
        amplitude: unit of relative errors, per component, (2n,), nowhere zero.
    """

    def run(h: float) -> CompleteRun:
        every = 1 if motion.duration / h <= MOST_STEPS else 0
        return full_run(model, coordinates, motion, power, h, every)

    steps = [model.step * factor for factor in FACTORS]
    wanted = [h for h in steps if MIN_STEPS <= motion.duration / h <= MOST_STEPS]
    base = run(model.step)
    others = [run(h) for h in wanted if h != model.step]
    size, rates = np.split(amplitude, 2)
    times = event_times(base, motion)
    errors = [(base.h, _error(base, times, amplitude))] if base.finite else []
    errors += [
        (one.h, _error(one, event_times(one, motion), amplitude)) for one in others if one.finite
    ]
    predicted = tuple(step_for(target, errors) for target in TARGETS)
    checked, first = None, predicted[0]
    if first is not None and motion.duration / first <= MOST_STEPS:
        again = run(first)
        checked = (TARGETS[0], first, _error(again, event_times(again, motion), amplitude))
    return StepStudy(
        base_run=base,
        others=tuple(others),
        global_error=largest(base, size),
        velocity_error=largest_velocity(away_from_events(base, times), rates),
        full_run_check=_evidence(base, errors, motion),
        decomposition=None,
        steps_for=predicted,
        checked=checked,
        events=times,
    )


def _error(run: SampledRun, times: Sequence[EventTime], amplitude: Array) -> float:
    """Return the larger of position error, and velocity error away from events."""
    size, rates = np.split(amplitude, 2)
    return max(largest(run, size), largest_velocity(away_from_events(run, times), rates))


def event_times(run: SampledRun, motion: Motion) -> tuple[EventTime, ...]:
    """Return the events of a motion, with their times in a run.

    A run shows an event where the condition that ends the mode crosses zero, between the middles to
    the neighbouring events. A condition that turns back before zero is extrapolated from there,
    as of an engine that predicts contacts.
    """
    marks = motion.marks or ()
    edges = [0.0, *(mark.time for mark in marks), motion.duration]
    seen = []
    for k, mark in enumerate(marks):
        low = (edges[k] + edges[k + 1]) / 2 if k else 0.0
        window = (run.t >= low) & (run.t <= (edges[k + 1] + edges[k + 2]) / 2)
        values = _condition(mark, run.t[window], run.states[window], motion)
        in_run = crossing(run.t[window], values)
        seen.append(EventTime(part=mark.part, change=mark.change, time=mark.time, in_run=in_run))
    return tuple(seen)


def _condition(mark: EventMark, t: Array, states: Array, motion: Motion) -> Array:
    q, v = np.split(states, 2, axis=1)
    values: Array = mark.guards(q, v, motion.inputs(t), t[:, None])[:, mark.guard]
    return values


def crossing(t: Array, values: Array) -> float | None:
    """Return the time at which positive values reach zero, or would; None if they do not.

    Args:
        t: times, (S,).
        values: the condition there, (S,).
    """
    positive = values > STILL * np.abs(values).max(initial=0.0)
    if not (positive.any() and np.isfinite(values).all()):
        return None
    start = int(np.argmax(positive))
    t, values, positive = t[start:], values[start:], positive[start:]
    if len(t) < 3:
        return None
    if not positive.all():
        first, last = (k := int(np.argmin(positive))) - 1, k
    else:
        first, last = (k := max(int(np.argmin(values)), 1)) - 1, k
        if values[first] <= values[last] or values[first] - values[last] < values[last]:
            return None  # a step more would not reach zero
    slope = (values[first] - values[last]) / (t[last] - t[first])
    return float(t[first] + values[first] / slope)


def away_from_events(run: SampledRun, events: Sequence[EventTime]) -> SampledRun:
    """Return a run without the samples at which velocities jump in the run or in the reference."""
    kept = np.ones(len(run.t), dtype=bool)
    clearance = CLEARANCE_STEPS * run.h * run.every
    for event in events:
        both = np.array([event.time, event.time if event.in_run is None else event.in_run])
        kept &= (run.t < both.min() - clearance) | (run.t > both.max() + clearance)
    return replace(run, t=run.t[kept], states=run.states[kept], error=run.error[kept])


def order_of(errors: Sequence[tuple[float, float]]) -> float:
    """Return the least-squares order of errors, (step, error); nan if they are rounding."""
    some = [(math.log(h), math.log(error)) for h, error in errors if error > ROUNDING_FLOOR]
    if len(some) < 3:
        return math.nan
    h, error = np.array(some).T
    return float(np.polyfit(h, error, 1)[0])


def falls(errors: Sequence[tuple[float, float]]) -> bool:
    """Return whether errors, (step, error), fall in proportion to the step, or are rounding."""
    rates = [error / h for h, error in sorted(errors)]
    half = len(rates) // 2
    if half < 2:
        return False
    rounded = max(error for _, error in sorted(errors)[:half]) <= ROUNDING_FLOOR
    return rounded or max(rates[:half]) <= SCATTER * max(rates[half:])


def step_for(target: float, errors: Sequence[tuple[float, float]]) -> float | None:
    """Return a step below which the error stays below a target; None if errors do not fall.

    The line of order 1 through the largest error over the step bounds all runs.
    """
    steps = [h / error for h, error in errors if error > 0]
    if not steps or not falls(errors):
        return None
    h = target * min(steps)
    digits = 1 - math.floor(math.log10(h))
    return math.floor(h * 10.0**digits) / 10.0**digits


def _evidence(
    base: CompleteRun, errors: Sequence[tuple[float, float]], motion: Motion
) -> FullRunCheck:
    converges = base.finite and falls(errors)
    return FullRunCheck(
        order=order_of(errors),
        until=motion.duration,
        residual=min(errors, default=(math.nan, math.nan))[1],
        bound=math.nan,
        expected=0.0,
        deviation=0.0,
        deviation_bound=0.0,
        order_plausible=converges,
        converges=converges,
        partly_chaotic=False,
        growth=1.0,
    )
