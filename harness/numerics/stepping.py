"""An engine's very next state, against the same rule on the equations: a witness at its own step.

Limits say what a model is as its step goes to zero, and nothing of the step it ships with. Where an
engine documents how it steps, the equations stepped so give the state that it must come to, to the
last digits: no model that differs, and no integrator that is another than it is said to be, comes
there. So does nothing that acts at that step alone, such as a soft equality.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from physics_crosscheck.harness.engines.protocol import Array, Model
from physics_crosscheck.harness.engines.step_rule import StepRule
from physics_crosscheck.harness.numerics.batch import movement
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.evenly import evenly
from physics_crosscheck.harness.numerics.judgement import Judgement, judge
from physics_crosscheck.harness.numerics.ladder import EPSILON
from physics_crosscheck.harness.numerics.rounding import (
    Starts,
    unheld,
    with_companions,
    without_companions,
)
from physics_crosscheck.reference.solving.next_state import Stepped, next_states

LATER, LONG = 10, 1000
"""Steps after which the difference is told once more."""

FEW = 6
"""States from which so many steps are taken."""

ROUNDED = 4.0
"""Last digits of a component that the few operations of a step may lose, each side's."""

MARGIN = 4.0
"""Rounding is seen at some of the states and bounded at all: robots of 7 to 23 degrees of freedom
went to 1.6 times what the companions of a quarter of the states showed."""

STABLE = 2.785
"""Step times rate up to which a Runge-Kutta step of order 4 is stable (Hairer and Wanner 1996,
Solving Ordinary Differential Equations II, IV.2). Beyond it each stage is larger than the one
before, up to angles of 1e6 rad, of which a sine has lost six digits: no start shows how many."""


@dataclass(frozen=True, kw_only=True)
class Stepping:
    """How far an engine's states after one step are from the rule's.

    Attributes:
        rule: as the engine documents it.
        step: seconds.
        judgement: of B states and 2n components, relative to how far each moves in a step at most.
        digits: the largest difference, in last digits of the component where it is largest.
        later: the same after `LATER` steps.
        long: after `LONG`, from a few of the states; nan where that was not asked for.
    """

    rule: StepRule
    step: float
    judgement: Judgement
    digits: float
    later: float
    long: float


def is_linear(coordinates: CoordinateMap, states: Array) -> bool:
    """Whether engine coordinates are linear in the system's, so that one rule steps both alike."""
    slopes = coordinates.forward_slope(states[:, : coordinates.back.size])
    return bool(np.ptp(slopes, axis=0).max(initial=0.0) == 0.0)


def steps_alike(rule: StepRule, coordinates: CoordinateMap, states: Array) -> bool:
    """Whether a rule steps the equations as it steps the engine's coordinates.

    Where it tells pairs of these apart, each is to be one of the system's.
    """
    if rule.coupled is None:
        return is_linear(coordinates, states)
    n = coordinates.back.size
    entries = coordinates.forward_slope(states[:1, :n]).reshape(-1, n) != 0
    alone = len(entries) == n and bool(np.all(entries.sum(axis=1) == 1))
    return alone and is_linear(coordinates, states)


def step_engine(
    model: Model,
    coordinates: CoordinateMap,
    stepped: Stepped,
    states: Array,
    inputs: Array,
    resolution: float,
    *,
    fastest: float = 0.0,
    long: bool = False,
) -> Stepping | None:
    """Take a step of the model's own from every state, and compare.

    Args:
        model: as its engine has loaded it.
        coordinates: between the equations' coordinates and the engine's.
        stepped: the equations.
        states: where steps start, (B, 2n).
        inputs: held over the step, (B, inputs).
        resolution: that is asked of a difference, relative.
        fastest: rate of the equations at these states, rad/s; zero where it is not known.
        long: whether `LONG` steps are taken too.

    Returns:
        None where the engine tells no rule, its coordinates don't step as the equations' do, one
        step is more than numbers can hold, or Runge-Kutta steps are not stable.
    """
    rule = model.step_rule
    if rule is None or not steps_alike(rule, coordinates, states):
        return None
    if rule.scheme == "Runge-Kutta 4" and model.step * fastest > STABLE:
        return None
    run = Steps(model, coordinates, states, inputs)
    with np.errstate(all="ignore"):
        took, expected = run.engine(1), run.rule(rule, stepped, 1)
    if not np.isfinite(expected).all():
        return None
    digit = run.digit(expected)
    # What is no number is as far off as can be.
    apart = np.nan_to_num(np.abs(took[: len(states)] - expected), nan=np.inf)
    scale = movement(expected, states)
    return Stepping(
        rule=rule,
        step=model.step,
        judgement=judge(
            apart / scale, (ROUNDED * digit + MARGIN * run.rounding(took)) / scale, resolution, None
        ),
        digits=float(np.max(apart / np.max(digit, axis=0))),
        later=run.later(rule, stepped, LATER),
        long=_long(run, rule, stepped) if long else float("nan"),
    )


def _long(run: Steps, rule: StepRule, stepped: Stepped) -> float:
    return run.few(FEW).later(rule, stepped, LONG)


class Steps:
    """Steps of a model, and of the equations, from the same states."""

    def __init__(
        self, model: Model, coordinates: CoordinateMap, states: Array, inputs: Array
    ) -> None:
        self._model, self._coordinates = model, coordinates
        self._states, self._inputs = states, inputs
        self._starts = with_companions(*coordinates.to_engine(states), model.epsilon)
        n = coordinates.back.size
        slope = coordinates.forward_slope(states[:1, :n]).reshape(-1, n)
        self._slope = slope
        self._mixes = bool(np.any((slope != 0).sum(axis=1) > 1))

    def engine(self, steps: int) -> Array:
        """States after so many, the companions' too, (B + 2P, 2n)."""
        return self._after(steps, self._starts)

    def _after(self, steps: int, starts: Starts) -> Array:
        model = self._model
        held = self._inputs[starts.rows] * starts.gain[:, None]
        force = self._coordinates.force(np.repeat(held[:, None], steps, axis=1))
        z, w = model.rollout(starts.z, starts.w, model.step, steps, force, steps)
        z, w = (end[:, 0] + unheld(a, starts.epsilon) for end, a in ((z, starts.z), (w, starts.w)))
        return self._coordinates.from_engine(z, w, self._states[starts.rows])

    def rule(self, rule: StepRule, stepped: Stepped, steps: int) -> Array:
        """States after so many by the rule on the equations, (B, 2n)."""
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
            steps=steps,
        )

    def _of_equations(self, late: Array | None) -> Array | None:
        """A matrix of the engine's coordinates, in the equations', (n, n)."""
        return None if late is None else self._slope.T @ late @ self._slope

    def _pairs_of_equations(self, coupled: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Pairs of the engine's coordinates, of the equations', (n, n)."""
        same = self._slope != 0
        found: NDArray[np.bool_] = same.T @ coupled @ same
        return found

    def few(self, count: int) -> Steps:
        """The same from so many of its states, spread evenly."""
        rows = evenly(len(self._states), count)
        return Steps(self._model, self._coordinates, self._states[rows], self._inputs[rows])

    def later(self, rule: StepRule, stepped: Stepped, steps: int) -> float:
        """The largest difference after so many steps, in last digits."""
        with np.errstate(all="ignore"):  # some blow up at the step that they ship with
            expected = self.rule(rule, stepped, steps)
            alone = without_companions(*self._coordinates.to_engine(self._states))
            took = self._after(steps, alone)
            return float(np.max(np.abs(took - expected) / np.max(self.digit(expected), axis=0)))

    def rounding(self, took: Array) -> Array:
        """What numbers rounded alike on the way make of a step, (2n,).

        As in `harness.numerics.rounding`, of what the step adds: its start is one and the same. In
        short numbers solving for accelerations takes more digits than the start's last one, which
        shows in how companions scatter.
        """
        starts = self._starts
        before = self._coordinates.from_engine(starts.z, starts.w, self._states[starts.rows])
        added = took - before
        told = starts.last_digits(added)
        if starts.epsilon <= EPSILON:
            return told
        return np.maximum(told, starts.observed_rounding(added))

    def digit(self, ends: Array) -> Array:
        """The last digit of each component at each state, (B, 2n).

        A position takes in h times its velocity. Where engine coordinates are sums of several, all
        are as coarse as the largest of their like.
        """
        states, h = self._states, self._model.step
        n = states.shape[1] // 2
        size = np.maximum(np.abs(states), np.abs(ends))
        parts = [np.maximum(size[:, :n], h * size[:, n:]), size[:, n:]]
        if self._mixes:
            parts = [np.broadcast_to(p.max(axis=1, keepdims=True), p.shape) for p in parts]
        found = np.concatenate(parts, axis=1)
        epsilon = self._model.epsilon
        digit: Array = epsilon * np.maximum(found, np.finfo(float).tiny / epsilon)
        return digit
