"""Comparison of an engine's next state with its own rule applied to the equations.

Limits describe a model as its step goes to zero, but not at the file's own time step. If an engine
documents its step, the same rule on the equations must give the same next state to the last digits.
A wrong model fails this, and so does an undocumented integrator, or an effect that occurs only at
that step, such as a soft equality.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.engines.protocol import Array, LoadedModel, StepRule
from physics_crosscheck.reference.mechanism.laws import Substeps
from physics_crosscheck.reference.solving.next_state import Stepped, next_states
from physics_crosscheck.reference.solving.segments import even_indices
from .coordinates import CoordinateMap
from .judgement import LimitVerdict, judge
from .ladder import EPSILON, movement
from .rounding import SHARED_DIGITS, Starts, quantization_error, with_companions, without_companions

LATER_STEPS, LONG_RUN_STEPS = 10, 1000
"""Steps after which the difference is measured again."""

CHUNK = 4096
"""Steps of a run that are compared at once, which bounds the memory of their mass matrices."""

LONG_RUN_STATES = 6
"""Number of states from which `LONG_RUN_STEPS` steps are taken."""

ROUNDED_DIGITS = 4.0
"""Last digits of a component that the few operations of a step may lose, on each side."""

ROUNDING_MARGIN = 4.0
"""Factor from rounding observed at some of the states to its bound at all. Robots with 7 to 23
degrees of freedom had up to 1.6 times the rounding of the companions of a quarter of the states."""

STABILITY_LIMIT = 2.785
"""Step times rate up to which a Runge-Kutta step of order 4 is stable (Hairer and Wanner 1996,
Solving Ordinary Differential Equations II, IV.2). Beyond it each stage is larger than the previous
one, up to angles of 1e6 rad, whose sine has lost six digits. No start reveals that loss."""


@dataclass(frozen=True, kw_only=True)
class StepComparison:
    """Difference of an engine's states after one step from those of its rule.

    Attributes:
        rule: as the engine documents it.
        step: seconds.
        states: B, the number of states.
        judgement: verdict for B states and 2n components, relative to the largest movement in a
            step.
        digits: the largest difference, in last digits of the component where it is largest.
        later: the difference after `LATER_STEPS` steps.
        long: the same in last digits after `LONG_RUN_STEPS` steps, from a few of the states; nan if
            not requested.
        rounding: rounding of a step that all states share, (2n,).
        defects: differences of the steps.
    """

    rule: StepRule
    step: float
    states: int
    judgement: LimitVerdict
    digits: float
    later: LaterSteps
    long: float
    rounding: Array
    defects: StepDefects


def is_linear(coordinates: CoordinateMap, states: Array) -> bool:
    """Return whether engine coordinates are linear in the system's."""
    slopes = coordinates.forward_slope(states[:, : coordinates.back.size])
    return bool(np.ptp(slopes, axis=0).max(initial=0.0) == 0.0)


def steps_alike(rule: StepRule, coordinates: CoordinateMap, states: Array) -> bool:
    """Return whether a rule steps the equations as it steps the engine's coordinates.

    If the rule couples pairs of engine coordinates, each must be a multiple of one system
    coordinate.
    """
    if rule.substeps is not None:
        return _equal_rows(coordinates, states) is not None
    if rule.coupled is None:
        return is_linear(coordinates, states)
    n = coordinates.back.size
    entries = coordinates.forward_slope(states[:1, :n]).reshape(-1, n) != 0
    one_to_one = len(entries) == n and bool(np.all(entries.sum(axis=1) == 1))
    return one_to_one and is_linear(coordinates, states)


def _equal_rows(coordinates: CoordinateMap, states: Array) -> tuple[int, ...] | None:
    """Return the engine's coordinate that equals each of the system's; None if one does not."""
    n = coordinates.back.size
    entries = coordinates.forward_slope(states[:1, :n]).reshape(-1, n)
    rows = tuple(int(row) for row in np.argmax(entries, axis=0))
    is_same = len(entries) == n and np.array_equal(entries[list(rows)], np.eye(n))
    starts_at_zero = not coordinates.forward(np.zeros((1, n))).any()
    return rows if is_same and starts_at_zero and is_linear(coordinates, states) else None


def step_engine(
    model: LoadedModel,
    coordinates: CoordinateMap,
    stepped: Stepped,
    states: Array,
    inputs: Array,
    resolution: float,
    *,
    fastest: float = 0.0,
    long: bool = False,
) -> StepComparison | None:
    """Take one step of the model from every state, and compare.

    Args:
        model: loaded model.
        coordinates: map between the equations' coordinates and the engine's.
        stepped: the equations.
        states: start states, (B, 2n).
        inputs: constant over the step, (B, inputs).
        resolution: smallest relative difference that counts.
        fastest: rate of the equations at these states, rad/s; zero if unknown.
        long: whether to take `LONG_RUN_STEPS` steps as well.

    Returns:
        None if the engine documents no rule, its coordinates step differently from the equations',
        a step overflows, or Runge-Kutta steps are unstable.
    """
    rule = model.step_rule
    if rule is None or not steps_alike(rule, coordinates, states):
        return None
    if rule.scheme == "Runge-Kutta 4" and model.step * fastest > STABILITY_LIMIT:
        return None
    run = Steps(model, coordinates, states, inputs)
    with np.errstate(all="ignore"):  # the engine may reach any state in a step
        took, expected = run.engine(1), run.rule(rule, stepped, 1)
        if not np.isfinite(expected).all():
            return None
        digit, rounding = run.digit(expected), run.rounding(took)
        if rule.substeps is not None:
            # Each adds an increment that hardly changes, so half a last digit is lost alike each
            # time. The digits add up, and act on the end like those of the start.
            lost = rule.substeps.count / 2
            digit *= 1 + lost / ROUNDED_DIGITS
            rounding *= 1 + lost / (ROUNDING_MARGIN * SHARED_DIGITS)
        apart = np.nan_to_num(np.abs(took[: len(states)] - expected), nan=np.inf)
        defects = _defects(apart, movement(expected, states), digit, rounding)
        digits = float(np.max(apart / np.max(digit, axis=0)))
    return StepComparison(
        rule=rule,
        step=model.step,
        states=len(states),
        judgement=judge(defects.defect, defects.uncertainty, resolution, None),
        digits=digits,
        later=run.later(rule, stepped, LATER_STEPS),
        long=_long(run, rule, stepped) if long else float("nan"),
        rounding=rounding,
        defects=defects,
    )


def _long(run: Steps, rule: StepRule, stepped: Stepped) -> float:
    return run.subset(LONG_RUN_STATES).later(rule, stepped, LONG_RUN_STEPS).digits


@dataclass(frozen=True, kw_only=True)
class StepDefects:
    """Relative differences of B steps from a rule, and their uncertainty, (B, 2n) each.

    Attributes:
        off_map: largest change of the coordinate map's residual in a step, relative to the largest
            movement of the engine's coordinates; zero if the map is one to one.
    """

    defect: Array
    uncertainty: Array
    off_map: float = 0.0


def _defects(apart: Array, scale: Array, digit: Array, rounding: Array) -> StepDefects:
    """Return differences relative to the largest movement of each component, (2n,)."""
    uncertainty = (ROUNDED_DIGITS * digit + ROUNDING_MARGIN * rounding) / scale
    return StepDefects(defect=apart / scale, uncertainty=uncertainty)


def compare_run(
    model: LoadedModel,
    coordinates: CoordinateMap,
    stepped: Stepped,
    states: Array,
    residuals: Array,
    inputs: Array,
    rounding: Array,
) -> StepDefects:
    """Compare each step of a run with the rule, from the state where the step starts.

    No difference grows with the motion, so that chaotic motions are compared to their ends. State
    that an engine carries from step to step shows, and so does any effect on a part of the motion.

    Args:
        model: the model; it has a rule that steps its coordinates as the equations'.
        states: all S + 1 states of the run at the file's own time step, (S + 1, 2n).
        residuals: their residuals of the coordinate map, (S + 1, 2nz), or without columns.
        inputs: inputs of each step, (S, inputs).
        rounding: rounding of a step that all states share, (2n,).
    """
    rule = model.step_rule
    assert rule is not None
    expected, digit = [], []
    for first in range(0, len(inputs), CHUNK):
        part = slice(first, first + CHUNK)
        run = Steps(model, coordinates, states[:-1][part], inputs[part])
        with np.errstate(all="ignore"):
            expected.append(run.rule(rule, stepped, 1))
            digit.append(run.digit(expected[-1]))
    ends = np.concatenate(expected)
    scale = engine_movement(coordinates, ends, states[:-1]) if residuals.size else np.ones(1)
    with np.errstate(all="ignore"):
        apart, moved = np.abs(states[1:] - ends), movement(ends, states[:-1])
        defects = _defects(apart, moved, np.concatenate(digit), rounding)
        off_map = np.max(np.abs(np.diff(residuals, axis=0)) / scale, initial=0.0)
    return replace(defects, off_map=float(off_map))


@dataclass(frozen=True, kw_only=True)
class LaterSteps:
    """Difference of states after some steps.

    Attributes:
        digits: the largest, in last digits of the component where it is largest.
        share: the largest, relative to the largest movement in these steps.
        off_map: the largest residual of the coordinate map, relative to the largest movement of the
            engine's coordinates; zero if the map is one to one.
    """

    digits: float
    share: float
    off_map: float


def engine_movement(coordinates: CoordinateMap, ends: Array, starts: Array) -> Array:
    """Return the largest movement of engine positions and velocities by the map, (2nz,)."""
    moved = (np.concatenate(coordinates.to_engine(one), axis=1) for one in (ends, starts))
    return movement(*moved)


class Steps:
    """Steps of a model, and of the equations, from the same states."""

    def __init__(
        self, model: LoadedModel, coordinates: CoordinateMap, states: Array, inputs: Array
    ) -> None:
        self._model, self._coordinates = model, coordinates
        self._states, self._inputs = states, inputs
        self._starts = with_companions(*coordinates.to_engine(states), model.epsilon)
        n = coordinates.back.size
        slope = coordinates.forward_slope(states[:1, :n]).reshape(-1, n)
        self._slope = slope
        self._mixes = bool(np.any((slope != 0).sum(axis=1) > 1))

    def engine(self, steps: int) -> Array:
        """Return the engine's states after `steps` steps, companions included, (B + 2P, 2n)."""
        return self._after(steps, self._starts)

    def _after(self, steps: int, starts: Starts) -> Array:
        return self._states_of(*self._rolled(steps, starts), starts)

    def _rolled(self, steps: int, starts: Starts) -> tuple[Array, Array]:
        model = self._model
        held = self._inputs[starts.rows] * starts.gain[:, None]
        force = self._coordinates.force(np.repeat(held[:, None], steps, axis=1))
        z, w = model.rollout(starts.z, starts.w, model.step, steps, force, steps)
        return (
            z[:, 0] + quantization_error(starts.z, starts.epsilon),
            w[:, 0] + quantization_error(starts.w, starts.epsilon),
        )

    def _states_of(self, z: Array, w: Array, starts: Starts) -> Array:
        return self._coordinates.from_engine(z, w, self._states[starts.rows])

    def rule(self, rule: StepRule, stepped: Stepped, steps: int) -> Array:
        """Return the states after `steps` steps by the rule on the equations, (B, 2n)."""
        return next_states(
            stepped,
            self._states,
            np.repeat(self._inputs[:, None], steps, axis=1),
            self._model.step,
            scheme=rule.scheme,
            damping=self._of_equations(rule.damping),
            stiffness=self._of_equations(rule.stiffness),
            by_velocity=rule.by_velocity,
            coupled=None if rule.coupled is None else self._pairs_of_equations(rule.coupled),
            substeps=self._substeps_of_equations(rule),
            steps=steps,
        )

    def _of_equations(self, matrix: Array | None) -> Array | None:
        return None if matrix is None else self._slope.T @ matrix @ self._slope

    def _pairs_of_equations(self, coupled: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return pairs of the engine's coordinates as pairs of the equations', (n, n)."""
        same = self._slope != 0
        pairs: NDArray[np.bool_] = same.T @ coupled @ same
        return pairs

    def _substeps_of_equations(self, rule: StepRule) -> Substeps | None:
        rows = None if rule.substeps is None else _equal_rows(self._coordinates, self._states)
        return None if rule.substeps is None or rows is None else rule.substeps.reordered(rows)

    def subset(self, count: int) -> Steps:
        """Return the same steps from `count` of the states, spread evenly."""
        rows = even_indices(len(self._states), count)
        return Steps(self._model, self._coordinates, self._states[rows], self._inputs[rows])

    def later(self, rule: StepRule, stepped: Stepped, steps: int) -> LaterSteps:
        """Compare the states after `steps` steps."""
        with np.errstate(all="ignore"):  # some models blow up at the file's own time step
            expected = self.rule(rule, stepped, steps)
            starts = without_companions(*self._coordinates.to_engine(self._states))
            z, w = self._rolled(steps, starts)
            took = self._states_of(z, w, starts)
            apart = np.abs(took - expected)
            off = np.zeros(1)
            if self._coordinates.redundant:
                scale = engine_movement(self._coordinates, expected, self._states)
                off = np.abs(self._coordinates.residual(z, w, took)) / scale
            return LaterSteps(
                digits=float(np.max(apart / np.max(self.digit(expected), axis=0))),
                share=float(np.max(apart / movement(expected, self._states))),
                off_map=float(np.max(off)),
            )

    def rounding(self, took: Array) -> Array:
        """Return the effect of rounding shared by all runs on a step, (2n,).

        It is that of `harness.numerics.rounding`, for the change by the step, since the start is
        the same. In short numbers, solving for accelerations loses more than the start's last
        digit; the scatter of companions shows it.
        """
        starts = self._starts
        before = self._coordinates.from_engine(starts.z, starts.w, self._states[starts.rows])
        added = took - before
        shared = starts.last_digits(added)
        if starts.epsilon <= EPSILON:
            return shared
        return np.maximum(shared, starts.observed_rounding(added))

    def digit(self, ends: Array) -> Array:
        """Return the last digit of each component at each state, (B, 2n).

        A position includes h times its velocity. If engine coordinates are sums of several, all are
        as coarse as the largest of their kind.
        """
        states, h = self._states, self._model.step
        n = states.shape[1] // 2
        size = np.maximum(np.abs(states), np.abs(ends))
        parts = [np.maximum(size[:, :n], h * size[:, n:]), size[:, n:]]
        if self._mixes:
            parts = [np.broadcast_to(p.max(axis=1, keepdims=True), p.shape) for p in parts]
        sizes = np.concatenate(parts, axis=1)
        epsilon = self._model.epsilon
        digit: Array = epsilon * np.maximum(sizes, np.finfo(float).tiny / epsilon)
        return digit
