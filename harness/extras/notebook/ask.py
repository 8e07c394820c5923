"""`simulate` and `reference`: one motion alone, of a model in an engine or of the equations."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Mapping
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from physics_crosscheck.harness.extras.notebook import motions
from physics_crosscheck.harness.extras.notebook.columns import Columns
from physics_crosscheck.harness.extras.notebook.motions import (
    Asked,
    Simulated,
    Solved,
    is_number,
    start_from,
)
from physics_crosscheck.harness.extras.notebook.subject import (
    Name,
    Subject,
    engine_for,
    model_named,
    system_named,
)
from physics_crosscheck.harness.extras.notebook.trajectory import MotionError, Trajectory
from physics_crosscheck.harness.jobs.limits import Limits
from physics_crosscheck.harness.jobs.main_module import without_main
from physics_crosscheck.harness.jobs.workers import Failure, Workers
from physics_crosscheck.harness.modelfiles.parts import part_digests
from physics_crosscheck.harness.modelfiles.path_states import states_now
from physics_crosscheck.harness.modelfiles.quote import brief
from physics_crosscheck.reference.mechanism.numeric import Array

SAMPLES = 1000
"""Intervals at whose ends a reference motion is told, where no times are asked for."""

KEPT = 16
"""Reference motions that are kept: one is asked for again with every step that is tried."""

LIMITS = Limits(options="a notebook's ")

T = TypeVar("T")
V = TypeVar("V")


def simulate(
    model: Name,
    scenario: str | Mapping[str, float],
    step: float | None = None,
    *,
    engine: str | None = None,
    duration: float | None = None,
) -> Trajectory:
    """Run a model once, from start to end, and nothing else.

    A model is a file of a system folder, also of a built-in one (`"simple_pendulum/space.py"`),
    with what its sidecar says; or a robot's file alone, whose contacts, limits and friction are
    then left out, as where it is checked.

    Args:
        model: the file.
        scenario: name of a declared one; or a start, `{"theta": 0.1, "theta_dot": 0}`, without
            inputs, in which what is not named is zero.
        step: s; None: as the file or its sidecar ships.
        engine: that runs it; None: the first that is installed of those that do.
        duration: s; None: the scenario's.

    Returns:
        A trajectory of about a thousand times at most, in the coordinates of the system.

    Raises:
        MotionError: for an unknown scenario, coordinate or engine, one that is not installed, or a
            step that is none, with what there is; or with what became of the engine.
        FolderError, SidecarError: for a name that is no model.
    """
    subject = model_named(model)
    asked = _asked(subject, scenario, duration)
    if step is not None:
        step = _positive(step, "step")
    task = Simulated(asked=asked, engine=engine_for(subject, engine), step=step)
    return _done(motions.simulate, task, subject)


def solve(
    system: Name,
    scenario: str | Mapping[str, float],
    times: ArrayLike | None = None,
    *,
    duration: float | None = None,
) -> Trajectory:
    """Solve the equations of a system once, with a bound of the error of every value.

    Args:
        system: a system folder, or the name of a built-in one; or a robot's file alone, of which
            the equations are made: these take longer, half a minute where a motion is long.
        scenario: as in `simulate`.
        times: at which values are told, s, (n,); None: a thousand and one, evenly.
        duration: s; None: the scenario's.

    Returns:
        A trajectory with an uncertainty: what solving, rounding and interpolation leave open; inf
        where a chaotic motion leaves no bound.

    Raises:
        MotionError: for an unknown scenario or coordinate, or times that are not in the motion.
        FolderError: for a name that is no system.
    """
    subject = system_named(system)
    asked = _asked(subject, scenario, duration)
    found = _solved(asked)
    motion, columns = found.motion, Columns(found.declaration)
    at = _times(times, motion.duration)
    states = motion.at(at)
    return Trajectory(
        t=at,
        names=columns.names,
        units=columns.units,
        values=columns.values(at, states),
        uncertainty=columns.bounds(at, states, motion.global_bound_at(at)),
        system=found.declaration.name,
        scenario=_told(asked),
        origin=f"the equations, by {motion.method}",
        step=None,
    )


def _asked(subject: Subject, scenario: str | Mapping[str, float], duration: float | None) -> Asked:
    start = scenario if isinstance(scenario, str) else start_from(scenario)
    if duration is not None:
        duration = _positive(duration, "duration")
    return Asked(subject=subject, scenario=start, duration=duration)


def _told(asked: Asked) -> str:
    return asked.scenario if isinstance(asked.scenario, str) else motions.told(asked.scenario)


def _positive(value: float, what: str) -> float:
    if not is_number(value) or not 0 < value < math.inf:
        raise MotionError(f"the {what} is {value!r}, expected a number of seconds above zero")
    return float(value)


def _times(given: ArrayLike | None, duration: float) -> Array:
    if given is None:
        return np.linspace(0.0, duration, SAMPLES + 1)
    try:
        times = np.array(given, dtype=float)
    except (TypeError, ValueError):
        raise MotionError(f"times are {brief(given)}, expected ascending numbers") from None
    ascending = times.ndim == 1 and len(times) and np.all(np.diff(times) > 0)
    if not (ascending and np.all(np.isfinite(times))):
        raise MotionError("times are numbers in a row, ascending")
    if not (times[0] >= 0 and times[-1] <= duration * (1 + 1e-12)):
        raise MotionError(
            f"times go from {times[0]:g} to {times[-1]:g} s, and the motion from 0 to"
            f" {duration:g} s"
        )
    within: Array = np.minimum(times, duration)
    return within


_KEPT: OrderedDict[Asked, Solved] = OrderedDict()


def _solved(asked: Asked) -> Solved:
    """The motion, unless it is known and nothing that it was read from has changed."""
    known = _KEPT.pop(asked, None)
    if known is None or known.reads != _states_now(known.reads, asked.subject):
        known = _done(motions.solved, asked, asked.subject)
    _KEPT[asked] = known
    while len(_KEPT) > KEPT:
        _KEPT.popitem(last=False)
    return known


def _states_now(reads: Mapping[str, str], subject: Subject) -> dict[str, str]:
    """The states of what a motion was read from, as they are now."""
    named = {} if subject.folder is not None else part_digests(subject.place.absolute())
    return {**states_now(subject.base, reads), **named}


def _done(function: Callable[[T], V], task: T, subject: Subject) -> V:
    """What comes of a task in a worker process: an engine that crashes ends no notebook.

    Raises:
        MotionError: with the reason, and what was printed.
    """
    with without_main(), Workers(1, LIMITS) as workers:
        value = workers.outcome(workers.submit(function, task))
    if isinstance(value, Failure):
        printed = [f"  | {line}" for line in value.stdout.splitlines()[-6:]]
        raise MotionError("\n".join([value.about(subject.place), *printed]))
    return value
