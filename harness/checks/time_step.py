"""The time step of a model in an engine, without a full run: its error and its stability."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.engines.protocol import LoadedModel
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.numerics.coordinates import CoordinateMap
from physics_crosscheck.harness.numerics.step_study import TARGETS
from physics_crosscheck.harness.numerics.time_step import (
    SECONDS,
    GrowingMode,
    RestPose,
    SmoothError,
    StudiedModel,
    by_state,
    rounded_down,
    smooth_error,
)
from physics_crosscheck.harness.records.base import SourceLine, number
from physics_crosscheck.harness.records.case import TargetStep, TimeStep
from physics_crosscheck.harness.results.status import duration
from physics_crosscheck.reference.dynamics.tree_equations import TreeEquations
from physics_crosscheck.reference.mechanism.numeric import Array
from .findings import finding
from .plausibility.facts import documents_of, element_line
from .prepare import Prepared, PreparedSystem, PreparedTree
from .task import ModelTask

POSES = 12
"""Number of drawn positions of which the one with the fastest rates is linearized."""

DAMPED = (1.7, 2.05)
"""Largest stable step times the rate of the dampers, if they alone make the step unstable: 2, and
less by the rounding of that step."""

MOST_OFF = 2.0
"""Largest error of a run at a predicted step, as a multiple of the target."""


def case_time_step(
    task: ModelTask[Prepared], model: LoadedModel, coordinates: CoordinateMap
) -> TimeStep | None:
    """Return the error of the step over a smooth motion of bodies, and what makes it unstable.

    The motion is that of a full run from rest. None if the engine has no integrator, and for a
    stable step if full runs show its error, or the engine compiles each number of steps.
    """
    target, h = task.target, model.step
    if not model.steps_itself or not (np.isfinite(h) and 0 < h < SECONDS):
        return None
    studied, poses = StudiedModel(model=model, coordinates=coordinates), poses_of(target)
    mode = studied.unstable_mode(poses, h)
    if mode is not None and studied.confirms(mode, h):
        return _unstable(task, studied, mode, poses)
    if not isinstance(target, PreparedTree) or engines()[task.engine].on_request:
        return None
    start = start_of(target)
    error = smooth_error(studied, start, h)
    steps = [(one, step_for(studied, start, poses, error, one)) for one in TARGETS]
    return TimeStep(
        step=number(h),
        duration=SECONDS,
        error=number(error.error),
        order=error.order,
        steps_for=tuple(TargetStep(target=one, step=number(step)) for one, step in steps),
    )


def start_of(target: PreparedTree) -> Array:
    """Return the start of the smooth motion: the first drawn position, at rest, (2n,)."""
    return np.concatenate([target.samples.start[0, : len(target.names)], 0 * target.home])


def poses_of(target: Prepared) -> tuple[RestPose, ...]:
    """Return poses at rest: the declared equilibria, or two of a tree.

    These are the middle of the joints' ranges, and the drawn position with the fastest rates.
    """
    if isinstance(target, PreparedSystem):
        if target.system.interactions:  # no linearization describes motions that switch
            return ()
        return tuple(
            RestPose(
                name=f"about {one.name}",
                state=np.concatenate([one.position, 0 * one.position]),
                hold=one.hold,
                slopes=one.matrices["A"][len(one.position) :],
            )
            for one in target.equilibria
        )
    assert isinstance(target, PreparedTree)
    equations, n = TreeEquations(target.system), len(target.names)
    q = np.concatenate([target.home[None], target.samples.start[:POSES, :n]])
    states = np.concatenate([q, 0 * q], axis=1)
    hold = equations.forces_for(q, 0 * q, 0 * q)
    slopes = equations.pushed_slopes(states, hold)
    rates = [float(np.max(np.abs(np.linalg.eigvals(by_state(one))))) for one in slopes]
    fastest = 1 + int(np.argmax(rates[1:]))
    places = ("in the middle of the joints' ranges", 0), ("at a drawn position", fastest)
    return tuple(
        RestPose(name=name, state=states[k], hold=hold[k], slopes=slopes[k]) for name, k in places
    )


def step_for(
    studied: StudiedModel,
    start: Array,
    poses: Sequence[RestPose],
    error: SmoothError,
    target: float,
) -> float | None:
    """Return the step for an error of the smooth motion, s; None if unknown.

    A step above the file's own is run, and must be stable.
    """
    h = error.step_for(target)
    if h is None or h <= studied.model.step:
        return h
    if studied.unstable_mode(poses, h) is not None:
        return None
    run = smooth_error(studied, start, h)
    return run.step_for(target) if run.error <= MOST_OFF * target else None


def _unstable(
    task: ModelTask[Prepared], studied: StudiedModel, mode: GrowingMode, poses: Sequence[RestPose]
) -> TimeStep:
    """Return the record of an unstable step, with the joint and its line."""
    target, h, title = task.target, studied.model.step, engines()[task.engine].title
    joint, rate = target.names[mode.coordinate], mode.pose.rate
    largest = studied.largest_stable_step(poses, h)
    parts = [f"the largest stable step is {duration(largest)}"] if largest else []
    links = target.tree.links if isinstance(target, PreparedTree) else ()
    damping = next((one.damping for one in links if one.name == joint), 0.0)
    if largest and damping and DAMPED[0] <= largest * mode.pose.settling <= DAMPED[1]:
        stable = rounded_down(2 * damping / (h * mode.pose.settling))
        parts.append(f"damping up to {stable:g} instead of {damping:g} is stable at {duration(h)}")
    behaviour = f"grow {growth_words(math.exp(rate * h))}" if rate else "do not"
    message = (
        f"{joint} is unstable in {title} at the step of {duration(h)}: {mode.pose.name}, a "
        f"deviation grows {growth_words(abs(mode.growth))} a step, and the equations {behaviour}"
    )
    unstable = finding(
        "unstable step",
        (task.engine, joint),
        "; ".join([message, *parts]),
        location=_line_of(task.file, joint),
        expected=largest,
        actual=h,
    )
    return TimeStep(
        step=number(h),
        growth=number(abs(mode.growth)),
        joint=joint,
        largest_stable=number(largest),
        finding=unstable,
    )


def growth_words(growth: float) -> str:
    """Return a growth in words: `14-fold`, `by 3.2 %`."""
    return f"{growth:.2g}-fold" if growth >= 2 else f"by {100 * (growth - 1):.2g} %"


def _line_of(file: Path, joint: str) -> SourceLine:
    """Return the line of a joint's dynamics, or of the joint."""
    place = element_line(documents_of(file), "joint", joint, "dynamics")
    return place or SourceLine(file=str(file))
