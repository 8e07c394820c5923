"""The time step of a model: its error over a smooth motion, and whether it is stable.

The error needs no solved motion. Runs of an engine at h and h/2 differ by (1 - 2^-p) of the error
at h, up to higher powers of h (Richardson). The model itself is compared with the equations by
other checks. A step is unstable if its linearization has an eigenvalue outside the unit circle,
unless the equations grow alike, as an inverted pendulum does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from physics_crosscheck.harness.engines.protocol import LoadedModel
from physics_crosscheck.harness.records.outcome import FLOOR
from physics_crosscheck.reference.mechanism.numeric import Array
from .coordinates import CoordinateMap

SECONDS = 1.0
"""Length of the smooth motion."""

MOST_STEPS = 1000
"""Largest number of steps of the coarsest run; the error of shorter steps follows by the order."""

SAMPLES = 100
"""Number of times at which runs are compared."""

MAX_HALVINGS = 2
"""Further halvings of the step until the runs differ in line with the order."""

SMALL = 0.1
"""Error above which the next power of h matters, so that no other step is predicted from it."""

ORDER_RATIO = 1.5
"""Largest factor between the observed and the expected ratio of two differences."""

GROWTH = 1e-3
"""Smallest growth a step that counts; differences of steps leave about the root of their error."""

FASTER = 3.0
"""A step is unstable if it grows this many times faster than the equations."""

CONFIRMED = 10.0
"""Growth of a small deviation, over steps of the engine, that confirms an eigenvalue."""

MAX_CONFIRMING = 2000
"""Largest number of these steps."""

LARGEST_STEP = 0.1
"""Largest step that is tried, s."""

DIGITS = 2e-2
"""Relative accuracy of the largest stable step, which is rounded down to two digits."""


@dataclass(frozen=True, kw_only=True)
class RestPose:
    """A position at rest, held by forces, and the equations linearized there.

    Attributes:
        name: in words.
        state: q, and v = 0, (2n,).
        hold: inputs that hold it, (inputs,).
        slopes: derivatives of the accelerations by q and v, (n, 2n).
    """

    name: str
    state: Array
    hold: Array
    slopes: Array

    @property
    def rate(self) -> float:
        """Largest growth rate of the equations, 1/s; zero if they decay or swing."""
        return max(0.0, float(np.max(np.linalg.eigvals(by_state(self.slopes)).real)))

    @property
    def settling(self) -> float:
        """Largest rate at which dampers stop the joints, 1/s."""
        n = len(self.slopes)
        return float(np.max(np.abs(np.linalg.eigvals(self.slopes[:, n:])), initial=0.0))


@dataclass(frozen=True, kw_only=True)
class GrowingMode:
    """The fastest growing deviation from a pose.

    Attributes:
        pose: the pose.
        growth: factor by which it grows a step, its sign included if it is real.
        coordinate: index of the coordinate that takes part most.
        direction: the deviation, (2n,).
    """

    pose: RestPose
    growth: complex
    coordinate: int
    direction: Array


def step_matrix(step: Callable[[Array], Array], state: Array, epsilon: float) -> Array:
    """Return the derivatives of the state after a step by the state before, (2n, 2n).

    Args:
        step: next states, (B, 2n), of states (B, 2n).
        state: (2n,).
        epsilon: relative rounding of the engine's numbers.
    """
    by = epsilon ** (1 / 3) * np.maximum(np.abs(state), 1.0)
    ends = step(np.concatenate([state + np.diag(by), state - np.diag(by)]))
    slopes: Array = (ends[: len(by)] - ends[len(by) :]).T / (2 * by)
    return slopes


def fastest_mode(matrix: Array, pose: RestPose) -> GrowingMode | None:
    """Return the mode of a step's matrix that grows most; None if it is not finite."""
    if not np.isfinite(matrix).all():
        return None
    values, vectors = np.linalg.eig(matrix)
    k, n = int(np.argmax(np.abs(values))), len(matrix) // 2
    try:
        share = np.abs(vectors[:, k] * np.linalg.inv(vectors)[k])  # participation
    except np.linalg.LinAlgError:
        share = np.abs(vectors[:, k])
    return GrowingMode(
        pose=pose,
        growth=complex(values[k]),
        coordinate=int(np.argmax(share[:n] + share[n:])),
        direction=vectors[:, k].real / (np.max(np.abs(vectors[:, k].real)) or 1.0),
    )


@dataclass(frozen=True, kw_only=True)
class StudiedModel:
    """A loaded model whose time step is studied.

    Attributes:
        model: the model.
        coordinates: map from the equations' coordinates to the engine's.
    """

    model: LoadedModel
    coordinates: CoordinateMap

    def after(self, states: Array, inputs: Array, h: float, steps: int = 1) -> Array:
        """Return the states (B, 2n) after some steps under constant inputs, (inputs,)."""
        z, w = self.coordinates.to_engine(states)
        held = np.broadcast_to(inputs, (len(z), steps, len(inputs)))
        with np.errstate(all="ignore"):
            z, w = self.model.rollout(z, w, h, steps, self.coordinates.force(held), steps)
            return self.coordinates.from_engine(z[:, -1], w[:, -1], states)

    def path(self, start: Array, h: float, steps: int, every: int) -> Array:
        """Return the states along a motion from a state, without inputs, (S, 2n)."""
        z, w = self.coordinates.to_engine(start[None])
        with np.errstate(all="ignore"):
            z, w = self.model.rollout(z, w, h, steps, None, every)
            return self.coordinates.follow(z[0], w[0], start)

    def unstable_mode(self, poses: Sequence[RestPose], h: float) -> GrowingMode | None:
        """Return the mode that grows most at a step; None if none grows unlike the equations."""
        modes = []
        for pose in poses:
            matrix = step_matrix(
                lambda states, held=pose.hold: self.after(states, held, h),  # type: ignore[misc]
                pose.state,
                self.model.epsilon,
            )
            mode = fastest_mode(matrix, pose)
            least = max(math.log1p(GROWTH), FASTER * pose.rate * h)
            if mode is not None and math.log(abs(mode.growth)) > least:
                modes.append(mode)
        return max(modes, key=lambda mode: abs(mode.growth), default=None)

    def confirms(self, mode: GrowingMode, h: float) -> bool:
        """Return whether a small deviation along a mode grows in steps of the engine."""
        size = abs(mode.growth)
        steps = math.ceil(2 * math.log(CONFIRMED) / math.log(size))
        small = math.sqrt(self.model.epsilon) / max(1.0, CONFIRMED**2 * size)
        state = mode.pose.state
        starts = np.stack([state, state + small * mode.direction])
        ends = self.after(starts, mode.pose.hold, h, min(steps, MAX_CONFIRMING))
        grown = np.max(np.abs(ends[1] - ends[0])) / small
        return not grown < CONFIRMED  # not finite: it grew beyond all numbers

    def largest_stable_step(self, poses: Sequence[RestPose], h: float) -> float | None:
        """Return the largest stable step below an unstable one, or above a stable one, s.

        None if all steps up to `LARGEST_STEP` are stable, or none is.
        """
        low, high = h, h
        if self.unstable_mode(poses, h) is None:
            while high <= LARGEST_STEP and self.unstable_mode(poses, high) is None:
                low, high = high, 2 * high
            if high > LARGEST_STEP:
                return None
        else:
            for _ in range(60):
                low, high = low / 2, low
                if self.unstable_mode(poses, low) is None:
                    break
            else:
                return None
        while high > (1 + DIGITS / 2) * low:
            middle = math.sqrt(low * high)
            low, high = (
                (middle, high) if self.unstable_mode(poses, middle) is None else (low, middle)
            )
        return rounded_down(low)


def rounded_down(value: float) -> float:
    """Return a positive number rounded down to two digits."""
    digits = 1 - math.floor(math.log10(value))
    return float(f"{math.floor(value * 10.0**digits * (1 + 1e-9)) / 10.0**digits:.6g}")


@dataclass(frozen=True, kw_only=True)
class SmoothError:
    """The error of a step over the smooth motion.

    Attributes:
        error: largest error at the step, relative to the amplitude of each component; inf if
            the motion blows up.
        order: exponent of h in the error.
        shorter: the shortest step that was compared, s.
        shorter_error: its error.
    """

    error: float
    order: int
    shorter: float
    shorter_error: float

    def step_for(self, target: float) -> float | None:
        """Return the step that gives an error, s; None if every error is too large."""
        if not 0 < self.shorter_error <= SMALL:
            return None
        ratio = (target / self.shorter_error) ** (1 / self.order)
        return rounded_down(min(self.shorter * ratio, LARGEST_STEP))


def smooth_error(studied: StudiedModel, start: Array, h: float) -> SmoothError:
    """Return the error of steps of h over a motion from a state at rest, (2n,), without inputs.

    Runs at h, h/2 and so on are compared until their differences are small, and fall as the order
    says. Of very short steps only multiples are run.
    """
    order = studied.model.exponents(False)[0]
    factor = max(1, math.ceil(SECONDS / h / MOST_STEPS))
    coarse = factor * h
    steps = max(2, round(SECONDS / coarse))
    stride = max(1, steps // SAMPLES)
    runs = [studied.path(start, coarse, steps, stride)]
    apart: list[float] = []
    for k in range(1, MAX_HALVINGS + 2):
        runs.append(studied.path(start, coarse / 2**k, steps * 2**k, stride * 2**k))
        apart.append(_apart(runs[-2], runs[-1]))
        if apart[-1] < SMALL**2 or (k > 1 and apart[-1] < SMALL and _falls(apart, order)):
            break
    shares = [1 - 2.0 ** (-order * k) for k in (1, len(apart))]
    trusted = apart[-1] < SMALL**2 or (len(apart) > 1 and _falls(apart, order))
    error = _apart(runs[0], runs[-1]) / shares[1] / factor**order
    return SmoothError(
        error=error,
        order=order,
        shorter=coarse / 2 ** (len(apart) - 1),
        shorter_error=apart[-1] / shares[0] if trusted else math.inf,
    )


def _falls(apart: Sequence[float], order: int) -> bool:
    """Return whether the last two differences of runs fall in line with the order."""
    ratio = apart[-2] / max(apart[-1], 1e-300) / 2.0**order
    return 1 / ORDER_RATIO <= ratio <= ORDER_RATIO


def _apart(path: Array, finer: Array) -> float:
    """Return the largest difference of two motions, relative to the amplitude; inf if not finite"""
    with np.errstate(all="ignore"):
        largest = float(np.max(np.abs(path - finer) / amplitude(finer), initial=0.0))
    return largest if math.isfinite(largest) else math.inf


def amplitude(path: Array) -> Array:
    """Return the largest magnitudes of states (S, 2n), at least a share of the largest, (2n,)."""
    size = np.max(np.abs(path), axis=0)
    n = len(size) // 2
    largest = np.repeat([np.max(size[:n], initial=0.0), np.max(size[n:], initial=0.0)], n)
    scale = np.maximum(size, FLOOR * largest)
    result: Array = np.where(scale > 0, scale, 1.0)
    return result


def by_state(slopes: Array) -> Array:
    """Return the derivatives of the rates of a state, (2n, 2n), from those of accelerations."""
    n = len(slopes)
    return np.block([[np.zeros((n, n)), np.eye(n)], [slopes]])
