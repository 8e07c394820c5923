"""Full runs, from start to end, and their global error."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace

import numpy as np

from physics_crosscheck.harness.engines.protocol import LoadedModel
from physics_crosscheck.reference.dynamics.equations import VectorFunction
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.signal import Inputs
from physics_crosscheck.reference.solving.segments import Motion
from .coordinates import CoordinateMap
from .ladder import EPSILON

MIN_SAMPLES = 1000
"""Smallest number of samples of a run with enough steps; at most twice as many."""

MOST_STEPS = 10_000_000
"""Largest number of steps of a full run. At a microsecond each, as in the fastest engines, it takes
ten seconds; the analysis takes three times as long."""


@dataclass(frozen=True, kw_only=True)
class SampledRun:
    """One sampled run at one step, from the start.

    Attributes:
        h: step, seconds.
        steps: number of steps.
        every: steps from sample to sample.
        t: sample times, (S,).
        states: (S, 2n).
        error: engine - reference, (S, 2n).
        epsilon: relative rounding of the engine's numbers.
    """

    h: float
    steps: int
    every: int
    t: Array
    states: Array
    error: Array
    epsilon: float = EPSILON

    def thinned(self, by: int) -> SampledRun:
        """Return the run with only every `by`-th sample."""
        return SampledRun(
            h=self.h,
            steps=self.steps,
            every=self.every * by,
            t=self.t[::by],
            states=self.states[::by],
            error=self.error[::by],
            epsilon=self.epsilon,
        )

    @property
    def rounding(self) -> float:
        """Relative rounding of its steps: half a last digit each, all of one sign at worst."""
        return self.epsilon * self.steps

    @property
    def finite(self) -> bool:
        """True if the run stayed finite."""
        return bool(np.isfinite(self.states).all())


@dataclass(frozen=True, kw_only=True)
class CompleteRun(SampledRun):
    """One run from start to end.

    Attributes:
        drift: largest constraint drift, in engine units.
        balance: its energy balance; None where events take energy.
        seconds: wall-clock time of the engine.
    """

    drift: float
    balance: EnergyBalance | None
    seconds: float

    @property
    def energy(self) -> float:
        """Largest imbalance of the energy, relative to the exchanged energy; nan if unknown."""
        return math.nan if self.balance is None else self.balance.error


def steps_of(duration: float, h: float) -> int:
    """Return the number of whole steps that fit into a motion."""
    return math.floor(duration / h * (1 + 1e-12))


def why_no_run(duration: float, h: float) -> str:
    """Return why a run with step h cannot be compared with a motion; empty if it can.

    A single step does not show how a motion continues.
    """
    if not (math.isfinite(h) and h > 0):
        return f"the time step is {h:g} s; set one above zero"
    count = (duration + h * 1e-12) / h
    if count < 2:
        reason = "it takes no step" if count < 1 else "it takes one step"
        return (
            f"dt = {h:g} s is too long for a motion of {duration:g} s: {reason}; set a shorter one"
        )
    if count > MOST_STEPS:
        return (
            f"a motion of {duration:g} s takes {count:.3g} steps of {h:g} s, and a "
            f"full run may take at most {MOST_STEPS:.0e}; set a longer time step"
        )
    return ""


def follows(motion: Motion, h: float) -> bool:
    """Return whether h allows two or more steps per period of the fastest rate (Shannon)."""
    return h * motion.fastest <= math.pi


def full_run(
    model: LoadedModel,
    coordinates: CoordinateMap,
    motion: Motion,
    power: VectorFunction | None,
    h: float,
    every: int = 0,
) -> CompleteRun:
    """Run a motion from start to end with step h, sampled every `every` steps (0: automatic)."""
    extent = _Extent.whole(motion, h, every)
    samples = _stepped(model, coordinates, motion.inputs, motion.duration, h, extent)
    return _complete(model, coordinates, motion, power, samples, h, extent)


def traced_run(
    model: LoadedModel,
    coordinates: CoordinateMap,
    motion: Motion,
    power: VectorFunction | None,
    h: float,
) -> tuple[CompleteRun, Array, Array]:
    """Run a motion from start to end as `full_run` does, and return all its states.

    Returns:
        The run, its states (S + 1, 2n), and their residuals of the coordinate map, (S + 1, 2nz),
        or without columns if the map is one to one.
    """
    extent = _Extent.whole(motion, h, 0)
    every_step = replace(extent, every=1)
    samples = _stepped(model, coordinates, motion.inputs, motion.duration, h, every_step)
    run = _complete(model, coordinates, motion, power, samples.thinned(extent.every), h, extent)
    residuals = np.zeros((len(samples.t), 0))
    if coordinates.redundant:
        residuals = coordinates.residual(samples.zs, samples.ws, samples.states)
    return run, samples.states, residuals


def _complete(
    model: LoadedModel,
    coordinates: CoordinateMap,
    motion: Motion,
    power: VectorFunction | None,
    samples: _Samples,
    h: float,
    extent: _Extent,
) -> CompleteRun:
    run = _sampled(motion, samples, h, extent, model.epsilon)
    return CompleteRun(
        **vars(run),
        drift=coordinates.drift(samples.zs),
        balance=None if power is None else energy_balance(run.t, run.states, motion, power),
        seconds=samples.seconds,
    )


def sampled_run(
    model: LoadedModel, coordinates: CoordinateMap, motion: Motion, h: float
) -> SampledRun:
    """Run a motion from start to end, without energy balance and drift."""
    return _rolled(model, coordinates, motion, h, _Extent.whole(motion, h, 0))


def beginning(
    model: LoadedModel, coordinates: CoordinateMap, motion: Motion, h: float, every: int, limit: int
) -> SampledRun:
    """Run the beginning of a motion, of at most `limit` steps, sampled every `every` steps."""
    steps = min(steps_of(motion.duration, h), limit)
    extent = _Extent(steps - steps % every, every, motion.start[0])
    return _rolled(model, coordinates, motion, h, extent)


def follow(
    model: LoadedModel,
    coordinates: CoordinateMap,
    motion: Motion,
    h: float,
    *,
    every: int = 0,
    moved: Array | None = None,
) -> tuple[Array, Array]:
    """Return sample times (S,) and states (S, 2n) of a motion's run with step h.

    Args:
        every: steps from sample to sample; 0 for automatic.
        moved: perturbation of the start, (2n,).
    """
    extent = _Extent.whole(motion, h, every)
    if moved is not None:
        extent = replace(extent, start=extent.start + moved)
    run = _rolled(model, coordinates, motion, h, extent)
    return run.t, run.states


def simulated(
    model: LoadedModel,
    coordinates: CoordinateMap,
    start: Array,
    inputs: Inputs,
    duration: float,
    h: float,
) -> tuple[Array, Array]:
    """Return sample times (S,) and states (S, 2n) of a run without a reference motion.

    Args:
        start: the first state, (2n,).
        inputs: constant over each step.
        duration: seconds.
        h: step, seconds.
    """
    extent = _Extent.of_duration(duration, start, h, 0)
    run = _stepped(model, coordinates, inputs, duration, h, extent)
    return run.t, run.states


@dataclass(frozen=True)
class _Extent:
    """Number of steps, steps between samples, and start state, (2n,)."""

    steps: int
    every: int
    start: Array

    @staticmethod
    def whole(motion: Motion, h: float, every: int) -> _Extent:
        return _Extent.of_duration(motion.duration, motion.start[0], h, every)

    @staticmethod
    def of_duration(duration: float, start: Array, h: float, every: int) -> _Extent:
        steps = steps_of(duration, h)
        # A power of two: runs of twice and of half the step share the samples.
        every = every or 2 ** max(0, (steps // MIN_SAMPLES).bit_length() - 1)
        return _Extent(steps - steps % every, every, start)


def _rolled(
    model: LoadedModel, coordinates: CoordinateMap, motion: Motion, h: float, extent: _Extent
) -> SampledRun:
    samples = _stepped(model, coordinates, motion.inputs, motion.duration, h, extent)
    return _sampled(motion, samples, h, extent, model.epsilon)


def _sampled(
    motion: Motion, samples: _Samples, h: float, extent: _Extent, epsilon: float
) -> SampledRun:
    return SampledRun(
        h=h,
        steps=extent.steps,
        every=extent.every,
        t=samples.t,
        states=samples.states,
        error=samples.states - motion.states_at(samples.t),
        epsilon=epsilon,
    )


@dataclass(frozen=True, kw_only=True)
class _Samples:
    """Samples of a run: times (S,), states (S, 2n), the engine's positions and velocities, (S, nz)
    each, and seconds.
    """

    t: Array
    states: Array
    zs: Array
    ws: Array
    seconds: float

    def thinned(self, by: int) -> _Samples:
        """Return only every `by`-th sample."""
        kept = slice(None, None, by)
        return replace(
            self, t=self.t[kept], states=self.states[kept], zs=self.zs[kept], ws=self.ws[kept]
        )


def held_inputs(inputs: Inputs, h: float, steps: int) -> Array:
    """Return the inputs that each step of h seconds holds, (steps, inputs)."""
    held: Array = inputs(h * np.arange(steps, dtype=np.float64), slack=1e-6 * h)
    return held


def _stepped(
    model: LoadedModel,
    coordinates: CoordinateMap,
    inputs: Inputs,
    duration: float,
    h: float,
    extent: _Extent,
) -> _Samples:
    steps, every, start = extent.steps, extent.every, extent.start
    held = held_inputs(inputs, h, steps)[None]
    z, w = coordinates.to_engine(start[None])
    force = coordinates.force(held)
    began = time.perf_counter()
    zs, ws = model.rollout(z, w, h, steps, force, every)
    seconds = time.perf_counter() - began
    grid: Array = h * every * np.arange(steps // every + 1, dtype=np.float64)
    t: Array = np.minimum(grid, duration)
    zs, ws = np.concatenate([z, zs[0]]), np.concatenate([w, ws[0]])
    states = coordinates.follow(zs, ws, start)
    return _Samples(t=t, states=states, zs=zs, ws=ws, seconds=seconds)


@dataclass(frozen=True)
class EnergyBalance:
    """Energies over a run, joules.

    Attributes:
        held: T + V at the samples, (S,).
        supplied: work of the inputs up to each sample, (S,).
        dissipated: work of the dampers up to each sample, (S,).
        scale: the largest exchanged energy: supplied, dissipated or kinetic.
    """

    held: Array
    supplied: Array
    dissipated: Array
    scale: float

    @property
    def error(self) -> float:
        """Largest imbalance, relative to the scale: of order h^p for a method of order p."""
        imbalance = self.held - self.held[0] - self.supplied + self.dissipated
        return float(np.max(np.abs(imbalance))) / self.scale if self.scale else 0.0


def energy_balance(t: Array, states: Array, motion: Motion, power: VectorFunction) -> EnergyBalance:
    """Compute the energy balance of a sampled run.

    Args:
        t: sample times, (S,).
        states: (q, v) there, (S, 2n).
        motion: provides the inputs and their breaks.
        power: (energy, supplied, dissipated) of (q, v, u, (t,)).
    """
    from scipy.integrate import cumulative_simpson  # slow import, not needed by every command

    n = states.shape[1] // 2

    def powers(times: Array, y: Array, u: Array) -> Array:
        return power(y[:, :n], y[:, n:], u, times[:, None])

    u = motion.inputs(t)
    held = powers(t, states, u)[:, 0]
    still = states * (np.arange(2 * n) < n)
    kinetic = held - powers(t, still, u)[:, 0]
    energies = np.zeros((len(t), 2))
    done = np.zeros(2)
    for span in motion.spans:
        # Integrate each piece from break to break, since an input that jumps between samples would
        # reduce the quadrature's order.
        stop = min(span.start + span.length * span.count, t[-1])
        inside = (t > span.start) & (t < stop)
        times = np.concatenate([[span.start], t[inside], [stop]])
        y = np.stack([np.interp(times, t, column) for column in states.T], axis=1)
        before_stop = np.minimum(times, stop - 1e-9 * span.length)
        rates = powers(times, y, motion.inputs(before_stop))[:, 1:]
        summed = cumulative_simpson(rates.T, x=times, initial=0.0).T + done
        energies[inside] = summed[1:-1]
        energies[t >= stop] = done = summed[-1]
    largest = max(float(np.ptp(held)), float(np.max(np.abs(energies))), float(np.max(kinetic)))
    return EnergyBalance(held, energies[:, 0], energies[:, 1], largest)
