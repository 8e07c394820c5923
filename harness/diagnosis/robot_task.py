"""Diagnosis of a robot's file in an engine: the numbers that the engine reads differently."""

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
"""Segments of a diagnosis; almost each number affects nearly all of them."""

NUMBERS_FITTED = 16
"""Single numbers to fit: some numbers of a robot have zero slope at their right value."""

LARGE_ROBOT_DOF, LARGE_ROBOT_STATES, LARGE_ROBOT_FITS = 16, 12, 8
"""Degrees of freedom of a large robot; its number of states; its number of fits.

Each fit takes longer there, and each state carries more information.
"""


@dataclass(frozen=True, kw_only=True)
class RobotDiagnosisTask:
    """A robot's file that differs in an engine.

    Attributes:
        task: the check.
        is_reference: whether the equations are those of the file itself. Otherwise the file is
            compared with another file or a declared tree, and its numbers are sought.
    """

    task: RobotTask
    is_reference: bool = True


def diagnose_robot(task: RobotDiagnosisTask) -> Diagnosis:
    """Find the numbers of a robot's file that explain a discrepancy.

    Raises:
        RobotError, EngineError, BlownUpError, ReferenceError: for a failing run.
    """
    began = time.perf_counter()
    run = _some_of(task.task)
    if explanations := _explained_by_engine_defaults(task.task, run) or _explained_by_compiler(
        task, run
    ):
        return Diagnosis(
            explained=True,
            explanations=explanations,
            floor=number(0.0),
            seconds=time.perf_counter() - began,
        )
    ranking = ranked(task, run)
    return Diagnosis(
        explained=ranking.explained,
        explanations=tuple(
            _build_explanation(fit, ranking.switched_off, task.task)
            for fit in ranking.fits[:RECORDED]
        ),
        floor=number(ranking.floor),
        failure="" if ranking.fits else "no number of the file affects the difference",
        seconds=time.perf_counter() - began,
    )


def _build_explanation(fit: Fit, behaviours: Sequence[str], check: RobotTask) -> Explanation:
    """Build the record of a fit, with the engine's behaviours that were switched off."""
    record = explanation(fit)
    return Explanation(
        causes=(*record.causes, *_engine_causes(behaviours, check)),
        remaining=record.remaining,
        tied_with=record.tied_with,
    )


def _some_of(check: RobotTask, *, again: bool = True) -> FollowersRun:
    """Run the segments of a diagnosis in the engine."""
    return run_followers(replace(check, samples=some_of(check.samples)), again=again)


def _explained_by_engine_defaults(check: RobotTask, run: FollowersRun) -> tuple[Explanation, ...]:
    """Return behaviours of the engine without which no discrepancy remains.

    Try each alone, then all together if no single one suffices.
    """
    apart, _ = _apart(run, check)
    size = float(np.linalg.norm(apart))
    for tried in _remedy_groups(run):
        explanations = []
        for causes, settings in tried:
            remaining, uncertainty = _apart(_some_of(_under(check, settings), again=False), check)
            if np.all(np.abs(remaining).ravel() <= uncertainty):
                own_causes = _engine_causes(causes, check)
                explanations.append(
                    Explanation(
                        causes=own_causes, remaining=float(np.linalg.norm(remaining)) / size
                    )
                )
        if explanations:
            return tuple(explanations)
    return ()


_Remedy = tuple[tuple[str, ...], Mapping[str, object]]
"""Behaviours of an engine, and the settings that switch them off."""


def _remedy_groups(run: FollowersRun) -> tuple[list[_Remedy], ...]:
    """Return each remedy alone; then all together, if there are several."""
    settings_by_cause = run.way.model.corrective_settings
    singles: list[_Remedy] = [((cause,), settings) for cause, settings in settings_by_cause.items()]
    every = {
        key: value for settings in settings_by_cause.values() for key, value in settings.items()
    }
    return (
        (singles, [(tuple(settings_by_cause), every)]) if len(settings_by_cause) > 1 else (singles,)
    )


def _under(check: RobotTask, settings: Mapping[str, object]) -> RobotTask:
    return replace(check, settings={**check.settings, **settings})


def _explained_by_compiler(task: RobotDiagnosisTask, run: FollowersRun) -> tuple[Explanation, ...]:
    """Return how the engine's compiler changes the file, if no setting prevents it."""
    check = task.task
    numbers = robot_numbers(check.file, check.settings)
    if check.file.suffix not in engines()[check.engine].compiles or not task.is_reference:
        return ()
    apart, uncertainty = _apart(run, check)
    problem = problem_of(check, numbers, apart, is_reference=True)
    # The equations of another tree are less accurate than the engine's limits.
    uncertainty = np.maximum(uncertainty, check.resolution)
    size = float(np.linalg.norm(apart))
    explanations = []
    for cause, tree in numbers.engine_variants():
        defect = problem.left_by(tree)
        if np.all(np.abs(defect) <= uncertainty):
            remaining = float(np.linalg.norm(defect)) / size
            explanations.append(
                Explanation(causes=_engine_causes((cause,), check), remaining=remaining)
            )
    return tuple(explanations)


def _engine_causes(causes: Sequence[str], check: RobotTask) -> tuple[Cause, ...]:
    """Return causes for behaviours of an engine, with the relevant lines of the file."""
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
    task: RobotDiagnosisTask,
    run: FollowersRun | None = None,
    known_problem: RobotProblem | None = None,
) -> Ranking:
    """Rank all fits.

    If no single number explains the discrepancy, a behaviour of the engine may hide part of its
    effect. Switch off such behaviours, and report those that were switched off if one number then
    explains it.

    Args:
        task: the check.
        run: the segments in the engine, if they have run.
        known_problem: effects of the numbers, from another discrepancy of these equations.
    """
    run = run or _some_of(task.task)
    ranking, problem = _ranked(task, run, known_problem)
    if not ranking.fits or _single(ranking):
        return ranking
    for causes, settings in (one for tried in _remedy_groups(run) for one in tried):
        other = replace(task, task=_under(task.task, settings))
        corrected, _ = _ranked(other, _some_of(other.task), problem)
        if _single(corrected):
            return replace(corrected, switched_off=causes)
    return ranking


def _single(ranking: Ranking) -> bool:
    """Return whether one number explains the discrepancy."""
    return ranking.explained and len(ranking.fits[0].members) == 1


def _ranked(
    task: RobotDiagnosisTask, run: FollowersRun, known_problem: RobotProblem | None
) -> tuple[Ranking, RobotProblem]:
    if known_problem is None:
        problem, uncertainty = robot_problem(task, run)
    else:
        apart, uncertainty = _apart(run, task.task)
        problem = known_problem.with_discrepancy(apart)
    fits = LARGE_ROBOT_FITS if problem.flow.tree.dof > LARGE_ROBOT_DOF else NUMBERS_FITTED
    return diagnose(problem, uncertainty, fits), problem


def robot_problem(
    task: RobotDiagnosisTask, run: FollowersRun | None = None
) -> tuple[RobotProblem, Array]:
    """Return the discrepancy of a robot's file at some states, and its uncertainty, (N,).

    Args:
        task: the check.
        run: these states in the engine, if they have run.

    Raises:
        RobotError, EngineError, BlownUpError, ReferenceError: for a failing run.
    """
    check = task.task
    run = run or _some_of(check)
    numbers = robot_numbers(check.file, check.settings)
    apart, uncertainty = _apart(run, check)
    return problem_of(check, numbers, apart, is_reference=task.is_reference), uncertainty


def some_of(drawn: Samples) -> Samples:
    """Return the samples of a diagnosis."""
    count = LARGE_ROBOT_STATES if drawn.forces.shape[1] > LARGE_ROBOT_DOF else STATES
    return replace(
        drawn, start=drawn.start[:count], forces=drawn.forces[:count], end=drawn.end[:count]
    )


def problem_of(
    check: RobotTask, numbers: Numbers, apart: Array | None = None, *, is_reference: bool
) -> RobotProblem:
    """Build the problem of a discrepancy, with the effects of a file's numbers.

    Args:
        check: of the file that the engine runs.
        numbers: of that file.
        apart: engine - reference at the ends of `some_of`, scaled, (B, 2n + 2k), with k followers;
            None: zero.
        is_reference: as in `RobotDiagnosisTask`.

    Raises:
        RobotError, ReferenceError: if the file does not fit these states.
    """
    some = some_of(check.samples)
    tree = numbers.tree({})
    if tree is None or tree.dof != some.forces.shape[1]:
        raise RobotError(f"{check.file}: its tree differs from the tree of the equations")
    following = Following.from_tree(tree, some, check.tree)
    scale = scaled(some, following)
    return RobotProblem(
        numbers=numbers,
        flow=Flow(tree, some.start, some.forces, some.length),
        suspicions=tuple(suspicions(numbers, is_reference=is_reference)),
        apart=np.zeros((len(some.start), len(scale))) if apart is None else apart,
        scale=scale,
        way=1 if is_reference else -1,
        following=following,
    )


def _apart(run: FollowersRun, check: RobotTask) -> tuple[Array, Array]:
    """Return engine - reference and its uncertainty, in the equations' order; followers last."""
    way = run.way
    limit, samples = way.found.limit, way.samples
    apart = (limit.value - samples.end) / way.scale
    largest = np.max(np.abs(apart))
    uncertain = np.where(np.isfinite(limit.uncertainty), limit.uncertainty / way.scale, largest)
    uncertainty = np.maximum(uncertain + samples.bound / way.scale, EPSILON)
    order = [way.names.index(name) for name in check.names]
    both = [*order, *(len(order) + i for i in order)]
    off, off_uncertainty = run.apart(replace(check, samples=some_of(check.samples)))
    return (
        np.concatenate([apart[:, both], off], axis=1),
        np.concatenate([uncertainty[:, both], off_uncertainty], axis=1).ravel(),
    )
