"""Diagnose a robot's file in an engine: which of its numbers the engine takes otherwise."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from harness.cases.robot import Followed, RobotTask, follow_robot, scale_of
from harness.diagnosis.diagnose import Ranking, diagnose
from harness.diagnosis.robot_problem import RobotProblem
from harness.diagnosis.robot_suspicions import suspicions
from harness.diagnosis.samples import RUNGS_USED
from harness.diagnosis.task import RECORDED, explanation
from harness.numerics.ladder import EPSILON
from harness.records.base import number
from harness.records.cause import Cause
from harness.records.finding import Diagnosis, Explanation
from harness.robots.named import Numbers, robot_numbers
from harness.robots.system import RobotError
from reference.flows import Flow
from reference.numeric import Array
from reference.samples import Samples

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
    way = _some_of(task.task)
    if found := _undone(task.task, way):
        return Diagnosis(
            explained=True,
            explanations=found,
            floor=number(0.0),
            seconds=time.perf_counter() - began,
        )
    ranking = ranked(task, way)
    return Diagnosis(
        explained=ranking.explained,
        explanations=tuple(explanation(fit) for fit in ranking.fits[:RECORDED]),
        floor=number(ranking.floor),
        failure="" if ranking.fits else "no number of the file has a say in what differs",
        seconds=time.perf_counter() - began,
    )


def _some_of(check: RobotTask) -> Followed:
    """The segments that a diagnosis stands on, in the engine."""
    return follow_robot(replace(check, samples=some_of(check.samples)), RUNGS_USED)


def _undone(check: RobotTask, way: Followed) -> tuple[Explanation, ...]:
    """What the engine does on its own, if nothing is left of the discrepancy where it does not.

    Each alone, and all together where no single one is enough.
    """
    apart, _ = _apart(way, check.names)
    size = float(np.linalg.norm(apart))
    remedies = way.model.remedies
    alone: list[tuple[tuple[str, ...], Mapping[str, object]]]
    alone = [((cause,), settings) for cause, settings in remedies.items()]
    every = {key: value for settings in remedies.values() for key, value in settings.items()}
    for tried in (alone, [(tuple(remedies), every)] if len(remedies) > 1 else []):
        found = []
        for causes, settings in tried:
            left, uncertainty = _left(check, settings)
            if np.all(np.abs(left).ravel() <= uncertainty):
                told = tuple(map(_own, causes))
                found.append(Explanation(causes=told, remaining=float(np.linalg.norm(left)) / size))
        if found:
            return tuple(found)
    return ()


def _left(check: RobotTask, settings: Mapping[str, object]) -> tuple[Array, Array]:
    """What is left of the discrepancy under further settings, and its uncertainty."""
    return _apart(_some_of(replace(check, settings={**check.settings, **settings})), check.names)


def _own(cause: str) -> Cause:
    """What an engine does on its own."""
    return Cause(
        kind="default",
        subject=(cause,),
        nominal=number(0.0),
        estimate=number(1.0),
        standard_error=number(0.0),
    )


def ranked(
    task: RobotDiagnosisTask, way: Followed | None = None, known: RobotProblem | None = None
) -> Ranking:
    """All fits.

    Args:
        task: the check.
        way: the segments in the engine, where they have been run.
        known: what the numbers do to them, where another discrepancy of the same equations has
            asked for it.
    """
    if known is None:
        problem, uncertainty = robot_problem(task, way)
    else:
        apart, uncertainty = _apart(way or _some_of(task.task), task.task.names)
        problem = known.beside(apart)
    return diagnose(problem, uncertainty, FEW if problem.flow.tree.freedoms > MANY else FITTED)


def robot_problem(
    task: RobotDiagnosisTask, way: Followed | None = None
) -> tuple[RobotProblem, Array]:
    """The discrepancy of a robot's file at some states, and its uncertainty, (N,).

    Args:
        task: the check.
        way: these states in the engine, where they have been run.

    Raises:
        RobotError, EngineError, BlownUpError, ReferenceError: naming what could not be run.
    """
    check = task.task
    some, way = some_of(check.samples), way or _some_of(check)
    numbers = robot_numbers(check.file, check.settings)
    apart, uncertainty = _apart(way, check.names)
    return problem_of(check.file, numbers, some, apart, own=task.own), uncertainty


def some_of(drawn: Samples) -> Samples:
    """Of samples, those that a diagnosis stands on."""
    count = ENOUGH if drawn.forces.shape[1] > MANY else STATES
    return replace(
        drawn, start=drawn.start[:count], forces=drawn.forces[:count], end=drawn.end[:count]
    )


def problem_of(
    file: Path, numbers: Numbers, some: Samples, apart: Array, *, own: bool
) -> RobotProblem:
    """What the numbers of a file do to a discrepancy.

    Args:
        file: that the engine runs.
        numbers: of it.
        some: states.
        apart: engine - reference at their ends, scaled, (B, 2n).
        own: as in `RobotDiagnosisTask`.

    Raises:
        RobotError, ReferenceError: where it is no file of these states.
    """
    tree = numbers.tree({})
    if tree is None or tree.freedoms != some.forces.shape[1]:
        raise RobotError(f"{file}: it makes another tree than that of the equations")
    return RobotProblem(
        numbers=numbers,
        flow=Flow(tree, some.start, some.forces, some.length),
        suspicions=tuple(suspicions(numbers, own=own)),
        apart=apart,
        scale=scale_of(some),
        way=1 if own else -1,
    )


def _apart(way: Followed, names: Sequence[str]) -> tuple[Array, Array]:
    """Engine - reference and its uncertainty, in the order of the equations."""
    limit, samples = way.found.limit, way.samples
    apart = (limit.value - samples.end) / way.scale
    largest = np.max(np.abs(apart))
    known = np.where(np.isfinite(limit.uncertainty), limit.uncertainty / way.scale, largest)
    uncertainty = np.maximum(known + samples.bound / way.scale, EPSILON)
    order = [way.names.index(name) for name in names]
    both = [*order, *(len(order) + i for i in order)]
    return apart[:, both], uncertainty[:, both].ravel()
