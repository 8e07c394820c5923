"""The time step of a model: its error over a smooth motion, and whether it is stable.

The error needs no solved motion. Runs of an engine at h and h/2 differ by (1 - 2^-p) of the error
at h, up to higher powers of h (Richardson). The model itself is compared with the equations by
other checks. A step is unstable if its linearization has an eigenvalue outside the unit circle,
unless the equations grow alike, as an inverted pendulum does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.engines.protocol import LoadedModel, WholeModel, WholeState
from physics_crosscheck.harness.records.outcome import FLOOR
from physics_crosscheck.reference.mechanism.numeric import Array
from .coordinates import CoordinateMap

SECONDS = 1.0
"""Length of the smooth motion."""

MOST_STEPS = 1000
"""Largest number of steps of the coarsest run; the error of shorter steps follows by the order."""

MANY_STEPS = 20 * MOST_STEPS
"""The same if longer steps are unstable."""

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

WHOLE_GROWTH = 1.05
"""The same for steps with all forces, whose equations are not linearized."""

WHOLE_DEVIATION = 1e-6
"""Deviation from such a state, rad or m, and per second."""

ALIKE = 1.2
"""Largest ratio of its growths by slopes over a small and a large difference."""

FASTER = 3.0
"""A step is unstable if it grows this many times faster than the equations."""

CONFIRMED = 10.0
"""Growth of a small deviation, over steps of the engine, that confirms an eigenvalue."""

MAX_CONFIRMING = 2000
"""Largest number of these steps."""

SMALLEST_STEP, LARGEST_STEP = 1e-9, 0.1
"""Smallest and largest step that are tried, s."""

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
    """The fastest growing deviation from a state.

    Attributes:
        growth: factor by which it grows a step.
        coordinate: index of the coordinate that takes part most.
        direction: the deviation, (2n,).
        pose: the pose; None for a state with all forces.
    """

    growth: float
    coordinate: int
    direction: Array
    pose: RestPose | None = None

    @property
    def confirming_steps(self) -> int:
        """Number of steps over which it grows by the square of `CONFIRMED`."""
        return min(math.ceil(2 * math.log(CONFIRMED) / math.log(self.growth)), MAX_CONFIRMING)


def overshoots(values: NDArray[np.complex128]) -> NDArray[np.bool_]:
    """Return which eigenvalues of a step belong to no motion that the step follows.

    A motion that falls or tips turns by less than a right angle in a step, and grows less than
    twofold.
    """
    size = np.abs(values)
    result: NDArray[np.bool_] = (size > 2) | ((values.real < 0) & (size > WHOLE_GROWTH))
    return result


def step_matrix(
    step: Callable[[Array], Array], state: Array, epsilon: float, *, central: bool = True
) -> Array:
    """Return the derivatives of the state after a step by the state before, (2n, 2n).

    Args:
        step: next states, (B, 2n), of states (B, 2n).
        state: (2n,).
        epsilon: relative rounding of the engine's numbers.
        central: whether differences are central; otherwise they take half the steps.
    """
    by = epsilon ** (1 / 3 if central else 1 / 2) * np.maximum(np.abs(state), 1.0)
    other = state - np.diag(by) if central else state[None]
    ends = step(np.concatenate([state + np.diag(by), other]))
    slopes: Array = (ends[: len(by)] - ends[len(by) :]).T / (by * (2 if central else 1))
    return slopes


def fastest_mode(
    matrix: Array, counts: Callable[[NDArray[np.complex128]], NDArray[np.bool_]]
) -> GrowingMode | None:
    """Return the mode of a step's matrix that grows most; None if none counts.

    Args:
        matrix: (2n, 2n).
        counts: which eigenvalues count.
    """
    if not np.isfinite(matrix).all():
        return None
    values, vectors = np.linalg.eig(matrix)
    size = np.where(counts(values), np.abs(values), 0.0)
    k, n = int(np.argmax(size)), len(matrix) // 2
    if not size[k]:
        return None
    try:
        share = np.abs(vectors[:, k] * np.linalg.inv(vectors)[k])  # participation
    except np.linalg.LinAlgError:
        share = np.abs(vectors[:, k])
    real = vectors[:, k].real
    return GrowingMode(
        growth=float(size[k]),
        coordinate=int(np.argmax(share[:n] + share[n:])),
        direction=real / (np.max(np.abs(real)) or 1.0),
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
            step = partial(self.after, inputs=pose.hold, h=h)
            least = math.exp(max(math.log1p(GROWTH), FASTER * pose.rate * h))
            matrix = step_matrix(step, pose.state, self.model.epsilon)
            mode = fastest_mode(matrix, partial(_exceeds, least=least))
            if mode is not None:
                modes.append(replace(mode, pose=pose))
        return max(modes, key=lambda mode: mode.growth, default=None)

    def confirms(self, mode: GrowingMode, h: float) -> bool:
        """Return whether a small deviation along a mode grows in steps of the engine."""
        assert mode.pose is not None
        small = math.sqrt(self.model.epsilon) / max(1.0, CONFIRMED**2 * mode.growth)
        starts = np.stack([mode.pose.state, mode.pose.state + small * mode.direction])
        ends = self.after(starts, mode.pose.hold, h, mode.confirming_steps)
        grown = np.max(np.abs(ends[1] - ends[0])) / small
        return not grown < CONFIRMED  # not finite: it grew beyond all numbers

    def largest_stable_step(self, poses: Sequence[RestPose], h: float) -> float | None:
        """Return the largest stable step near h, as `largest_stable` does."""
        return largest_stable(lambda step: self.unstable_mode(poses, step) is None, h)


def _exceeds(values: NDArray[np.complex128], least: float) -> NDArray[np.bool_]:
    result: NDArray[np.bool_] = np.abs(values) > least
    return result


def whole_mode(model: WholeModel, state: WholeState) -> GrowingMode | None:
    """Return the mode of steps with all forces that overshoots most at a state; None without one.

    The engine confirms it: a small deviation grows in its own steps.
    """
    n, epsilon = len(state.m), float(np.finfo(float).eps)

    def moved(values: Array) -> WholeState:
        return state._replace(z=values[:n], m=values[n:])

    def stepped(states: Array) -> Array:
        ends = [model.moved(moved(one), 1) for one in states]
        return np.array([np.concatenate([end.z, end.m]) for end in ends])

    def exactly(states: Array) -> Array:
        ends = [model.evaluate(moved(one)).after for one in states]
        return np.array([np.concatenate([end.z, end.m]) for end in ends])

    here = np.concatenate([state.z, state.m])
    with np.errstate(all="ignore"):
        wider = fastest_mode(step_matrix(stepped, here, epsilon), overshoots)
        if wider is None:
            return None
        mode = fastest_mode(step_matrix(exactly, here, epsilon, central=False), overshoots)
        # Forces that jump, as where a contact opens, have no slope.
        if mode is None or not 1 / ALIKE <= wider.growth / mode.growth <= ALIKE:
            return None
        pair = [moved(here), moved(here + WHOLE_DEVIATION * mode.direction)]
        grown = min(CONFIRMED, 0.8 * mode.growth) * WHOLE_DEVIATION
        for _ in range(mode.confirming_steps):  # a contact may open again
            pair = [model.moved(one, 1) for one in pair]
            apart = np.concatenate([pair[1].z - pair[0].z, pair[1].m - pair[0].m])
            if not np.max(np.abs(apart)) < grown:
                return mode
    return None


def largest_stable(stable: Callable[[float], bool], h: float) -> float | None:
    """Return the largest stable step below an unstable one, or above a stable one, s.

    None if all steps up to `LARGEST_STEP` are stable, or none is.
    """
    low, high = h, h
    if stable(h):
        while high <= LARGEST_STEP and stable(high):
            low, high = high, 2 * high
        if high > LARGEST_STEP:
            return None
    else:
        while not stable(low):
            low, high = low / 2, low
            if low < SMALLEST_STEP:
                return None
    while high > (1 + DIGITS / 2) * low:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if stable(middle) else (low, middle)
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


def smooth_error(
    studied: StudiedModel, start: Array, h: float, poses: Sequence[RestPose]
) -> SmoothError:
    """Return the error of steps of h over a motion from a state at rest, (2n,), without inputs.

    Runs at h, h/2 and so on are compared until their differences are small, and fall in line with
    the order. Of very short steps only multiples are run, if they are stable at the poses. The
    error is nan if that takes too many steps.
    """
    order = studied.model.exponents(False)[0]
    factor = max(1, math.ceil(SECONDS / h / MOST_STEPS))
    while factor > 1 and studied.unstable_mode(poses, 2 * factor * h) is not None:
        factor = (factor + 1) // 2
    coarse = factor * h
    if coarse * MANY_STEPS < SECONDS:
        return SmoothError(error=math.nan, order=order, shorter=h, shorter_error=math.inf)
    steps = max(2, round(SECONDS / coarse))
    stride = max(1, steps // SAMPLES)
    runs = [studied.path(start, coarse, steps, stride)]
    apart: list[float] = []
    for k in range(1, MAX_HALVINGS + 2):
        runs.append(studied.path(start, coarse / 2**k, steps * 2**k, stride * 2**k))
        apart.append(_apart(runs[-2], runs[-1]))
        if apart[-1] < SMALL**2 or (k > 1 and apart[-1] < SMALL / 2 and _falls(apart, order)):
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
