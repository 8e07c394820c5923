"""Diagnosis of a robot's file in an engine: the numbers that the engine reads differently."""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from msgspec import structs

from physics_crosscheck.harness.checks.findings import finding, place_of
from physics_crosscheck.harness.checks.scene import (
    compiled_inertias,
    inertia_difference,
    inertia_differences,
)
from physics_crosscheck.harness.checks.task import TreeTask
from physics_crosscheck.harness.engines.protocol import EngineError
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.numbers import ModelFile
from physics_crosscheck.harness.modelfiles.readers import RobotError, robot_numbers
from physics_crosscheck.harness.numerics.ladder import EPSILON
from physics_crosscheck.harness.numerics.segments import BlownUpError
from physics_crosscheck.harness.numerics.stepping import ROUNDED_DIGITS
from physics_crosscheck.harness.records.base import number
from physics_crosscheck.harness.records.cause import Cause
from physics_crosscheck.harness.records.finding import CLOSE, AuditFinding, Diagnosis, Explanation
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.mechanism.rotations import SpatialInertia
from physics_crosscheck.reference.solving.flows import Flow
from .diagnose import Ranking, diagnose, largest_remaining
from .fit import Fit
from .law_problem import NUMBERS_FITTED, diagnose_laws, law_problem
from .robot_followers import FollowersRun, Following, run_followers, scaled
from .robot_problem import SAME_INERTIA, RobotProblem, inertia_of, suspicions
from .samples import finite
from .task import RECORDED, explanation

STATES = 24
"""Segments of a diagnosis; almost each number affects nearly all of them."""

LARGE_ROBOT_DOF, LARGE_ROBOT_STATES, LARGE_ROBOT_FITS = 16, 12, 8
"""Degrees of freedom of a large robot; its number of states; its number of fits.

Each fit takes longer there, and each state carries more information.
"""


def diagnose_bodies(task: TreeTask) -> Diagnosis:
    """Diagnose a robot file, or a model of a folder that declares bodies."""
    return diagnose_robot(task, is_reference=task.sidecar is None)


def diagnose_robot(task: TreeTask, *, is_reference: bool) -> Diagnosis:
    """Find the numbers of a robot's file that explain a discrepancy.

    Args:
        task: the file in an engine.
        is_reference: whether the equations are those of the file itself. Otherwise the file is
            compared with another file or a declared tree, and its numbers are sought.

    Raises:
        RobotError, EngineError, BlownUpError, ReferenceError: for a failing run.
    """
    began = time.perf_counter()
    run = run_followers(at_some(task))
    diagnosis = None if _motion_differs(run) else _diagnose_steps(task)
    if diagnosis is None:
        diagnosis = _diagnose_motion(task, run, is_reference=is_reference)
    return structs.replace(diagnosis, seconds=time.perf_counter() - began)


def _motion_differs(run: FollowersRun) -> bool:
    """Return whether a difference of the motion is a case's, or may be: it is then unbounded."""
    apart, uncertainty = _apart(run)
    off = np.abs(apart).ravel()
    visible = (off > uncertainty) & (off + uncertainty > run.task.resolution)
    return bool(visible.any() or not np.isfinite(run.way.limits.limit.uncertainty).all())


def _diagnose_motion(task: TreeTask, run: FollowersRun, *, is_reference: bool) -> Diagnosis:
    """Find the behaviours of the engine, or the numbers, that explain a motion."""
    apart, uncertainty = _apart(run)
    explanations = _explained_by_engine_defaults(run)
    if not explanations and is_reference:
        explanations = _explained_by_compiler(run)
    ranking = Ranking((), False, 1.0)
    if not explanations and np.any(np.abs(apart).ravel() > uncertainty):
        ranking = ranked(task, run, is_reference=is_reference)
        if is_reference and not (ranking.explained and ranking.fits[0].is_read):
            explanations = _explained_by_compiled_bodies(run)
    elif not explanations:
        return Diagnosis(failure="no motion differs beyond its uncertainty")
    if explanations:
        return Diagnosis(explained=True, explanations=explanations, floor=number(0.0))
    diagnosis, behaviours = _diagnosis(ranking, task), _behaviours(run)
    if diagnosis.explained and (not is_reference or ranking.fits[0].is_read or not behaviours):
        return diagnosis
    return structs.replace(diagnosis, explained=False, behaviours=behaviours)


def _behaviours(run: FollowersRun) -> tuple[AuditFinding, ...]:
    """Return the constraints of the file that the engine treats differently, with lines."""
    rest = np.zeros((1, len(run.way.model.coordinates)))
    return tuple(
        finding(one.kind, (one.message,), one.message, location=place_of(run.task.file, one))
        for one in run.way.model.remarks(rest, rest)
        if one.fault and one.kind == "constraint"
    )


def _diagnosis(ranking: Ranking, task: TreeTask) -> Diagnosis:
    return Diagnosis(
        explained=ranking.explained,
        explanations=tuple(
            _build_explanation(fit, ranking.switched_off, task) for fit in ranking.fits[:RECORDED]
        ),
        floor=number(ranking.floor),
        failure="" if ranking.fits else "no number of the file affects the difference",
    )


def _diagnose_steps(task: TreeTask) -> Diagnosis | None:
    """Find the numbers that explain why whole steps differ from their law; None if they agree."""
    problem = law_problem(task)
    if problem is None or problem.judge(task.resolution).outcome is not Outcome.DIFFERS:
        return None
    return _diagnosis(diagnose_laws(problem), task)


def _build_explanation(fit: Fit, behaviours: Sequence[str], check: TreeTask) -> Explanation:
    """Build the record of a fit, with the engine's behaviours that were switched off."""
    record = explanation(fit)
    return Explanation(
        causes=(*record.causes, *_engine_causes(behaviours, check)),
        remaining=record.remaining,
        tied_with=record.tied_with,
    )


def at_some(task: TreeTask) -> TreeTask:
    """Return the task at the states of a diagnosis."""
    drawn = task.target.samples
    large = task.target.tree.dof > LARGE_ROBOT_DOF
    count = LARGE_ROBOT_STATES if large else STATES
    return task.with_target(samples=drawn.pick(slice(count)))


def _explained_by_engine_defaults(run: FollowersRun) -> tuple[Explanation, ...]:
    """Return behaviours of the engine without which no discrepancy remains.

    Try each alone, then all together, without those that change nothing.
    """
    settings = run.way.model.corrective_settings
    shares = {(cause,): _left_without(run, (cause,)) for cause in settings}
    explained: dict[tuple[str, ...], float] = {
        causes: share for causes, share in shares.items() if share is not None
    }
    if not explained and len(settings) > 1:
        needed = tuple(settings)
        share = _left_without(run, needed)
        for cause in settings if share is not None else ():
            others = tuple(one for one in needed if one != cause)
            less = shares[others] if others in shares else _left_without(run, others)
            if less is not None:
                needed, share = others, less
        explained = {} if share is None else {needed: share}
    return tuple(
        Explanation(causes=_engine_causes(causes, run.task), remaining=share)
        for causes, share in explained.items()
    )


def _left_without(run: FollowersRun, causes: Sequence[str]) -> float | None:
    """Return the share of a discrepancy without some behaviours; None if it is visible there."""
    settings = {k: v for one in causes for k, v in run.way.model.corrective_settings[one].items()}
    try:
        other = run_followers(run.task.with_settings(**settings), again=False)
    except (EngineError, BlownUpError):
        return None
    (apart, _), (remaining, uncertainty) = _apart(run), _apart(other)
    share = float(np.linalg.norm(remaining) / np.linalg.norm(apart))
    # Hidden as a verdict has it: an engine's own rounding may leave less than that.
    is_hidden = np.all(np.abs(remaining).ravel() <= np.maximum(uncertainty, run.task.resolution))
    return share if is_hidden and share <= CLOSE else None


_Remedy = tuple[tuple[str, ...], Mapping[str, object]]
"""Behaviours of an engine, and the settings that switch them off."""


def _remedy_groups(run: FollowersRun) -> tuple[list[_Remedy], ...]:
    settings_by_cause = run.way.model.corrective_settings
    singles: list[_Remedy] = [((cause,), settings) for cause, settings in settings_by_cause.items()]
    every = {
        key: value for settings in settings_by_cause.values() for key, value in settings.items()
    }
    return (
        (singles, [(tuple(settings_by_cause), every)]) if len(settings_by_cause) > 1 else (singles,)
    )


def _explained_by_compiler(run: FollowersRun) -> tuple[Explanation, ...]:
    """Return how the engine's compiler changes the file, if no setting prevents it."""
    task = run.task
    if task.file.suffix not in engines()[task.engine].compiles:
        return ()
    numbers = robot_numbers(task.file, task.spec.settings)
    apart, uncertainty = _apart(run)
    problem = problem_of(task, numbers, apart, is_reference=True)
    # The equations of another tree are less accurate than the engine's limits.
    uncertainty = np.maximum(uncertainty, task.resolution)
    size = float(np.linalg.norm(apart))
    explanations = []
    for cause, tree in numbers.engine_variants():
        defect = problem.left_by(tree)
        if np.all(np.abs(defect) <= uncertainty):
            remaining = float(np.linalg.norm(defect)) / size
            explanations.append(
                Explanation(causes=_engine_causes((cause,), task), remaining=remaining)
            )
    return tuple(explanations)


def _explained_by_compiled_bodies(run: FollowersRun) -> tuple[Explanation, ...]:
    """Return the inertias that the engine compiled, if no discrepancy remains by them."""
    task, model = run.task, run.way.model
    compiled = compiled_inertias(task.target.tree, model.inertias)
    links, causes = list(task.target.tree.links), list[Cause]()
    same = max(SAME_INERTIA, ROUNDED_DIGITS * model.epsilon)
    names = {link: name for name, (link, _) in task.target.tree.frames.items()}
    for i, body in compiled.items():
        stated = inertia_of(links[i])
        if inertia_difference(body, stated) > same:
            links[i] = replace(links[i], **body._asdict())
            causes += _read_causes(names[i], stated, body, same)
    if not causes:
        return ()
    apart, uncertainty = _apart(run)
    numbers = robot_numbers(task.file, task.spec.settings)
    problem = problem_of(task, numbers, apart, is_reference=True)
    defect = problem.left_by(replace(problem.flow.tree, links=tuple(links)))
    if np.any(np.abs(defect) > np.maximum(uncertainty, task.resolution)):
        return ()
    share = float(np.linalg.norm(defect) / np.linalg.norm(apart))
    return (Explanation(causes=tuple(causes), remaining=share),)


def _read_causes(
    name: str, stated: SpatialInertia, body: SpatialInertia, same: float
) -> Iterator[Cause]:
    for what, first, other, off in inertia_differences(stated, body):
        if off > same:
            yield Cause(
                kind="taken",
                subject=(f"{what} of {name}",),
                nominal=number(first),
                estimate=number(other),
                standard_error=number(0.0),
                is_read=True,
            )


def _engine_causes(causes: Sequence[str], check: TreeTask) -> tuple[Cause, ...]:
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
    task: TreeTask,
    run: FollowersRun | None = None,
    known_problem: RobotProblem | None = None,
    *,
    is_reference: bool,
) -> Ranking:
    """Rank all fits.

    If no single number explains the discrepancy, a behaviour of the engine may hide part of its
    effect. Switch off such behaviours, and report those that were switched off if one number then
    explains it.

    Args:
        task: the file in an engine.
        run: the segments in the engine, if they have run.
        known_problem: effects of the numbers, from another discrepancy of these equations.
        is_reference: as in `diagnose_robot`.
    """
    run = run or run_followers(at_some(task))
    ranking, problem = _ranked(run, known_problem, is_reference=is_reference)
    if not ranking.fits or ranking.is_single:
        return ranking
    for causes, settings in (one for tried in _remedy_groups(run) for one in tried):
        try:
            other = run_followers(at_some(task.with_settings(**settings)))
        except EngineError:  # it can't move the file without this behaviour
            continue
        corrected, _ = _ranked(other, problem, is_reference=is_reference)
        if corrected.is_single:
            return replace(corrected, switched_off=causes)
    return ranking


def _ranked(
    run: FollowersRun, known_problem: RobotProblem | None, *, is_reference: bool
) -> tuple[Ranking, RobotProblem]:
    if known_problem is None:
        problem, uncertainty = robot_problem(run.task, run, is_reference=is_reference)
        if is_reference:
            compiled = compiled_inertias(problem.flow.tree, run.way.model.inertias)
            problem = replace(problem, compiled=compiled)
    else:
        apart, uncertainty = _apart(run)
        problem = known_problem.with_discrepancy(apart)
    fits = LARGE_ROBOT_FITS if problem.flow.tree.dof > LARGE_ROBOT_DOF else NUMBERS_FITTED
    return _not_contradicted(diagnose(problem, uncertainty, fits), problem), problem


def _not_contradicted(ranking: Ranking, problem: RobotProblem) -> Ranking:
    fits = list[Fit]()
    for fit in ranking.fits:
        read = problem.is_read(fit.repair)
        if read and all("inertial" in str(one) for one in fit.causes):
            fits.append(replace(fit, is_read=True, tied_with=()))
        elif read is not False:
            fits.append(fit)
    explained = bool(fits) and fits[0].remaining <= largest_remaining(ranking.floor)
    return replace(ranking, fits=tuple(fits), explained=ranking.explained and explained)


def robot_problem(
    task: TreeTask, run: FollowersRun | None = None, *, is_reference: bool
) -> tuple[RobotProblem, Array]:
    """Return the discrepancy of a robot's file at some states, and its uncertainty, (N,).

    Args:
        task: the file in an engine.
        run: these states in the engine, if they have run.
        is_reference: as in `diagnose_robot`.

    Raises:
        RobotError, EngineError, BlownUpError, ReferenceError: for a failing run.
    """
    run = run or run_followers(at_some(task))
    numbers = robot_numbers(task.file, task.spec.settings)
    apart, uncertainty = _apart(run)
    return problem_of(task, numbers, apart, is_reference=is_reference), uncertainty


def problem_of(
    task: TreeTask, numbers: ModelFile, apart: Array | None = None, *, is_reference: bool
) -> RobotProblem:
    """Build the problem of a discrepancy, with the effects of a file's numbers.

    Args:
        task: the file that the engine runs.
        numbers: of that file.
        apart: engine - reference at the ends of `at_some`, scaled, (B, 2n + 2k), with k followers;
            None: zero.
        is_reference: as in `diagnose_robot`.

    Raises:
        RobotError, ReferenceError: if the file does not fit these states.
    """
    target = at_some(task).target
    some = target.samples
    tree = numbers.tree({})
    if tree is None or tree.dof != target.tree.dof:
        raise RobotError(f"{task.file}: its tree differs from the tree of the equations")
    following = Following.from_tree(tree, some, target.tree)
    scale = scaled(target.scale, following)
    return RobotProblem(
        numbers=numbers,
        flow=Flow(tree, some.start, some.start_inputs, some.length),
        hypotheses=tuple(suspicions(numbers, is_reference=is_reference)),
        apart=np.zeros((len(some.start), len(scale))) if apart is None else apart,
        scale=scale,
        way=1 if is_reference else -1,
        following=following,
    )


def _apart(run: FollowersRun) -> tuple[Array, Array]:
    limit, target = run.way.limits.limit, run.task.target
    apart = (limit.value - target.samples.end) / target.scale
    uncertain = finite(limit.uncertainty / target.scale, apart)
    uncertainty = np.maximum(uncertain + target.samples.bound / target.scale, EPSILON)
    off, off_uncertainty = run.apart()
    return (
        np.concatenate([apart, off], axis=1),
        np.concatenate([uncertainty, off_uncertainty], axis=1).ravel(),
    )
