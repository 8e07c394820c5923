"""`simulate` and `solve`: one motion of a model in an engine, or of the equations."""

import math
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from physics_crosscheck.harness.baseline.fingerprint import folder_files
from physics_crosscheck.harness.documents.errors import quote
from physics_crosscheck.harness.jobs.environment import without_main
from physics_crosscheck.harness.jobs.limits import Limits
from physics_crosscheck.harness.jobs.workers import Failure, Workers
from physics_crosscheck.harness.modelfiles.code_reads import UNKNOWN, states_now
from physics_crosscheck.harness.modelfiles.parts import part_digests
from physics_crosscheck.reference.mechanism.numeric import Array
from . import motions
from .columns import Columns
from .motions import MotionRequest, Solved, is_number, start_from
from .subject import Name, NotebookSubject, engine_for, model_named, system_named
from .trajectory import MotionError, Trajectory

SAMPLES = 1000
"""Default number of intervals of an exact motion."""

KEPT = 16
"""Number of exact motions in memory; comparing time steps needs the same one repeatedly."""

LIMITS = Limits(options="a notebook's ")

V = TypeVar("V")


def simulate(
    model: Name,
    scenario: str | Mapping[str, float],
    step: float | None = None,
    *,
    engine: str | None = None,
    duration: float | None = None,
) -> Trajectory:
    """Run a model file once, at one time step.

    A file in a system folder, also a built-in one (`"simple_pendulum/space.py"`), uses its sidecar.
    A robot file runs without contacts, joint limits and dry friction, as in `crosscheck run`.

    Args:
        model: model file.
        scenario: name of a declared scenario; or a start without inputs, such as
            `{"theta": 0.1, "theta_dot": 0}`. Values that are not named are zero.
        step: time step, s; None: that of the file or its sidecar.
        engine: name; None: the first installed engine that runs the file.
        duration: s; None: that of the scenario.

    Returns:
        A trajectory of at most about 1000 times, in the coordinates of the system.

    Raises:
        MotionError: if scenario, coordinate, engine or step is invalid, or the engine is not
            installed or fails. The message lists the alternatives.
        FolderError, SidecarError: if the name is not a model.
    """
    subject = model_named(model)
    request = _motion_request(subject, scenario, duration)
    if step is not None:
        step = _positive(step, "step")
    request = replace(request, engine=engine_for(subject, engine), step=step)
    return _done(motions.simulate, request)


def solve(
    system: Name,
    scenario: str | Mapping[str, float],
    times: ArrayLike | None = None,
    *,
    duration: float | None = None,
) -> Trajectory:
    """Solve the equations of a system, with an error bound for every value.

    Args:
        system: system folder, name of a built-in system, or robot file. A long motion of a robot
            file takes up to half a minute.
        scenario: as in `simulate`.
        times: ascending times of the values, s, (n,); None: 1001 equidistant times.
        duration: s; None: that of the scenario.

    Returns:
        A trajectory whose uncertainty bounds the errors of solution, rounding and interpolation.
        It is inf if a chaotic motion has no bound.

    Raises:
        MotionError: if scenario or coordinate is unknown, or a time is outside the motion.
        FolderError: if the name is not a system.
    """
    subject = system_named(system)
    request = _motion_request(subject, scenario, duration)
    solved = _solved(request)
    motion, columns = solved.motion, Columns(solved.declaration)
    sample_times = _times(times, motion.duration)
    states = motion.states_at(sample_times)
    return Trajectory(
        t=sample_times,
        names=columns.names,
        units=columns.units,
        values=columns.values(sample_times, states),
        uncertainty=columns.bounds(sample_times, states, motion.global_bound_at(sample_times)),
        system=solved.declaration.name,
        scenario=_start_text(request),
        origin=f"the equations, by {motion.method}",
        step=None,
    )


def _motion_request(
    subject: NotebookSubject, scenario: str | Mapping[str, float], duration: float | None
) -> MotionRequest:
    start = scenario if isinstance(scenario, str) else start_from(scenario)
    if duration is not None:
        duration = _positive(duration, "duration")
    return MotionRequest(subject=subject, scenario=start, duration=duration)


def _start_text(request: MotionRequest) -> str:
    return (
        request.scenario
        if isinstance(request.scenario, str)
        else motions.format_start(request.scenario)
    )


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
        raise MotionError(f"times are {quote(given)}, expected ascending numbers") from None
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


_KEPT: OrderedDict[MotionRequest, Solved] = OrderedDict()


def _solved(request: MotionRequest) -> Solved:
    """Return the motion, from memory if none of its input files has changed."""
    solved = _KEPT.pop(request, None)
    if (
        solved is None
        or UNKNOWN in solved.reads.values()
        or solved.reads != _states_now(solved.reads, request.subject)
    ):
        solved = _done(motions.solved, request)
    _KEPT[request] = solved
    while len(_KEPT) > KEPT:
        _KEPT.popitem(last=False)
    return solved


def _states_now(reads: Mapping[str, str], subject: NotebookSubject) -> dict[str, str]:
    """Return the current state of the input files of a motion."""
    if subject.folder is None:
        return part_digests(subject.place.absolute())
    content = folder_files(subject.folder).system
    return {**states_now(subject.base, reads), motions.CONTENT: content}


def _done(function: Callable[[MotionRequest], V], request: MotionRequest) -> V:
    """Run a task in a worker process, so that a crash of the engine does not stop the notebook.

    Raises:
        MotionError: with the reason and the printed output.
    """
    with without_main(), Workers(1, LIMITS) as workers:
        value = workers.outcome(workers.submit(function, request))
    if isinstance(value, Failure):
        printed = [f"  | {line}" for line in value.stdout.splitlines()[-6:]]
        raise MotionError("\n".join([value.about(request.subject.place), *printed]))
    return value
