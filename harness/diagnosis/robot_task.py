"""Diagnose a robot's file in an engine: which of its numbers the engine takes otherwise."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from physics_crosscheck.harness.checks.robot_record import place_of
from physics_crosscheck.harness.checks.robot_task import RobotTask
from physics_crosscheck.harness.diagnosis.diagnose import Ranking, diagnose
from physics_crosscheck.harness.diagnosis.fit import Fit
from physics_crosscheck.harness.diagnosis.robot_followers import (
    FollowersRun,
    Following,
    run_followers,
    scaled,
)
from physics_crosscheck.harness.diagnosis.robot_problem import RobotProblem
from physics_crosscheck.harness.diagnosis.robot_suspicions import suspicions
from physics_crosscheck.harness.diagnosis.task import RECORDED, explanation
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.readers import Numbers, robot_numbers
from physics_crosscheck.harness.modelfiles.robot_system import RobotError
from physics_crosscheck.harness.numerics.ladder import EPSILON
from physics_crosscheck.harness.records.base import number
from physics_crosscheck.harness.records.cause import Cause
from physics_crosscheck.harness.records.finding import Diagnosis, Explanation
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.flows import Flow
from physics_crosscheck.reference.solving.samples import Samples

STATES = 24
"""Segments that a diagnosis stands on: each number has a say in nearly all of them."""

FITTED = 16
"""Single numbers that are fitted: some of a robot's have no slope where they are right."""

MANY, ENOUGH, FEW = 16, 12, 8
"""A robot of more than so many freedoms takes so many states, and so many fits: each is longer, and
each state says more."""


@dataclass(frozen=True, kw_only=True)
class RobotDiagnosisTask:
    """A robot's file that differs in an engine.

    Attributes:
        task: the check.
        own: whether the equations are those of the file itself; else it is held against those of
            another, or of a declared tree, and its numbers are what is looked for.
    """

    task: RobotTask
    own: bool = True


def diagnose_robot(task: RobotDiagnosisTask) -> Diagnosis:
    """Name the numbers of a robot's file that explain a discrepancy.

    Raises:
        RobotError, EngineError, BlownUpError, ReferenceError: naming what could not be run.
    """
    began = time.perf_counter()
    run = _some_of(task.task)
    if found := _undone(task.task, run) or _taken(task, run):
        return Diagnosis(
            explained=True,
            explanations=found,
            floor=number(0.0),
            seconds=time.perf_counter() - began,
        )
    ranking = ranked(task, run)
    return Diagnosis(
        explained=ranking.explained,
        explanations=tuple(
            _told(fit, ranking.undone, task.task) for fit in ranking.fits[:RECORDED]
        ),
        floor=number(ranking.floor),
        failure="" if ranking.fits else "no number of the file affects the difference",
        seconds=time.perf_counter() - began,
    )


def _told(fit: Fit, undone: Sequence[str], check: RobotTask) -> Explanation:
    """A fit, with what the engine does beside it."""
    found = explanation(fit)
    return Explanation(
        causes=(*found.causes, *_own(undone, check)),
        remaining=found.remaining,
        tied_with=found.tied_with,
    )


def _some_of(check: RobotTask, *, again: bool = True) -> FollowersRun:
    """The segments that a diagnosis stands on, in the engine."""
    return run_followers(replace(check, samples=some_of(check.samples)), again=again)


def _undone(check: RobotTask, run: FollowersRun) -> tuple[Explanation, ...]:
    """What the engine does on its own, if nothing is left of the discrepancy where it does not.

    Each alone, and all together where no single one is enough.
    """
    apart, _ = _apart(run, check)
    size = float(np.linalg.norm(apart))
    for tried in _remedies(run):
        found = []
        for causes, settings in tried:
            left, uncertainty = _apart(_some_of(_under(check, settings), again=False), check)
            if np.all(np.abs(left).ravel() <= uncertainty):
                told = _own(causes, check)
                found.append(Explanation(causes=told, remaining=float(np.linalg.norm(left)) / size))
        if found:
            return tuple(found)
    return ()


_Remedy = tuple[tuple[str, ...], Mapping[str, object]]
"""What an engine does on its own, and the settings with which it does not."""


def _remedies(run: FollowersRun) -> tuple[list[_Remedy], ...]:
    """Each alone; then all together, where there are several."""
    remedies = run.way.model.corrective_settings
    alone: list[_Remedy] = [((cause,), settings) for cause, settings in remedies.items()]
    every = {key: value for settings in remedies.values() for key, value in settings.items()}
    return (alone, [(tuple(remedies), every)]) if len(remedies) > 1 else (alone,)


def _under(check: RobotTask, settings: Mapping[str, object]) -> RobotTask:
    return replace(check, settings={**check.settings, **settings})


def _taken(task: RobotDiagnosisTask, run: FollowersRun) -> tuple[Explanation, ...]:
    """What an engine that compiles the file makes of it, where no setting lets it do otherwise."""
    check = task.task
    numbers = robot_numbers(check.file, check.settings)
    if check.file.suffix not in engines()[check.engine].compiles or not task.own:
        return ()
    apart, uncertainty = _apart(run, check)
    problem = problem_of(check, numbers, apart, own=True)
    # The equations follow another tree to less digits than the engine's limits have.
    uncertainty = np.maximum(uncertainty, check.resolution)
    size = float(np.linalg.norm(apart))
    found = []
    for cause, tree in numbers.engine_variants():
        left = problem.left_by(tree)
        if np.all(np.abs(left) <= uncertainty):
            remaining = float(np.linalg.norm(left)) / size
            found.append(Explanation(causes=_own((cause,), check), remaining=remaining))
    return tuple(found)


def _own(causes: Sequence[str], check: RobotTask) -> tuple[Cause, ...]:
    """What an engine does on its own, with the lines of the file that it concerns."""
    remarks = tuple(engines()[check.engine].file_remarks(check.file))
    return tuple(
        Cause(
            kind="default",
            subject=(cause,),
            nominal=number(0.0),
            estimate=number(1.0),
            standard_error=number(0.0),
            locations=tuple(place_of(check.file, one) for one in remarks if one.cause == cause),
        )
        for cause in causes
    )


def ranked(
    task: RobotDiagnosisTask, run: FollowersRun | None = None, known: RobotProblem | None = None
) -> Ranking:
    """All fits.

    Where no single number explains what is there, an engine may hide a part of what one does: what
    it does on its own is then undone, and where one does now, that is told.

    Args:
        task: the check.
        run: the segments in the engine, where they have been run.
        known: what the numbers do to them, where another discrepancy of the same equations has
            asked for it.
    """
    run = run or _some_of(task.task)
    found, problem = _ranked(task, run, known)
    if not found.fits or _single(found):
        return found
    for causes, settings in (one for tried in _remedies(run) for one in tried):
        other = replace(task, task=_under(task.task, settings))
        beside, _ = _ranked(other, _some_of(other.task), problem)
        if _single(beside):
            return replace(beside, undone=causes)
    return found


def _single(ranking: Ranking) -> bool:
    """Whether one number explains what is there."""
    return ranking.explained and len(ranking.fits[0].members) == 1


def _ranked(
    task: RobotDiagnosisTask, run: FollowersRun, known: RobotProblem | None
) -> tuple[Ranking, RobotProblem]:
    if known is None:
        problem, uncertainty = robot_problem(task, run)
    else:
        apart, uncertainty = _apart(run, task.task)
        problem = known.beside(apart)
    fits = FEW if problem.flow.tree.dof > MANY else FITTED
    return diagnose(problem, uncertainty, fits), problem


def robot_problem(
    task: RobotDiagnosisTask, run: FollowersRun | None = None
) -> tuple[RobotProblem, Array]:
    """The discrepancy of a robot's file at some states, and its uncertainty, (N,).

    Args:
        task: the check.
        run: these states in the engine, where they have been run.

    Raises:
        RobotError, EngineError, BlownUpError, ReferenceError: naming what could not be run.
    """
    check = task.task
    run = run or _some_of(check)
    numbers = robot_numbers(check.file, check.settings)
    apart, uncertainty = _apart(run, check)
    return problem_of(check, numbers, apart, own=task.own), uncertainty


def some_of(drawn: Samples) -> Samples:
    """Of samples, those that a diagnosis stands on."""
    count = ENOUGH if drawn.forces.shape[1] > MANY else STATES
    return replace(
        drawn, start=drawn.start[:count], forces=drawn.forces[:count], end=drawn.end[:count]
    )


def problem_of(
    check: RobotTask, numbers: Numbers, apart: Array | None = None, *, own: bool
) -> RobotProblem:
    """What the numbers of a file do to a discrepancy.

    Args:
        check: of the file that the engine runs.
        numbers: of it.
        apart: engine - reference at the ends of what `some_of` picks, scaled, (B, 2n + 2k), k
            joints following others; None: nothing.
        own: as in `RobotDiagnosisTask`.

    Raises:
        RobotError, ReferenceError: where it is no file of these states.
    """
    some = some_of(check.samples)
    tree = numbers.tree({})
    if tree is None or tree.dof != some.forces.shape[1]:
        raise RobotError(f"{check.file}: its tree differs from the tree of the equations")
    following = Following.of(tree, some, check.tree)
    scale = scaled(some, following)
    return RobotProblem(
        numbers=numbers,
        flow=Flow(tree, some.start, some.forces, some.length),
        suspicions=tuple(suspicions(numbers, own=own)),
        apart=np.zeros((len(some.start), len(scale))) if apart is None else apart,
        scale=scale,
        way=1 if own else -1,
        following=following,
    )


def _apart(run: FollowersRun, check: RobotTask) -> tuple[Array, Array]:
    """Engine - reference and its uncertainty, in the order of the equations; what follows last."""
    way = run.way
    limit, samples = way.found.limit, way.samples
    apart = (limit.value - samples.end) / way.scale
    largest = np.max(np.abs(apart))
    known = np.where(np.isfinite(limit.uncertainty), limit.uncertainty / way.scale, largest)
    uncertainty = np.maximum(known + samples.bound / way.scale, EPSILON)
    order = [way.names.index(name) for name in check.names]
    both = [*order, *(len(order) + i for i in order)]
    off, beside = run.apart(replace(check, samples=some_of(check.samples)))
    return (
        np.concatenate([apart[:, both], off], axis=1),
        np.concatenate([uncertainty[:, both], beside], axis=1).ravel(),
    )
