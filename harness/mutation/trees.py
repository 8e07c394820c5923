"""Models of declared bodies, and robot files: their numbers made wrong, one at a time.

What a number does to the ends of segments follows from the equations, so that only those on which
motions depend are run. Of known mistakes none is made: these need declared energies.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from physics_crosscheck.harness.checks.robot_case import run_robot
from physics_crosscheck.harness.checks.robot_task import RobotTask
from physics_crosscheck.harness.diagnosis.hypotheses.trial import scratch
from physics_crosscheck.harness.diagnosis.robot_task import (
    RobotDiagnosisTask,
    problem_of,
    ranked,
    some_of,
)
from physics_crosscheck.harness.engines.protocol import EngineError
from physics_crosscheck.harness.modelfiles.copies import copy_with_texts
from physics_crosscheck.harness.modelfiles.numbers import SMALL, Number
from physics_crosscheck.harness.modelfiles.quote import original_paths
from physics_crosscheck.harness.modelfiles.readers import robot_numbers
from physics_crosscheck.harness.mutation.faults import SIZES
from physics_crosscheck.harness.mutation.survey import MutationError
from physics_crosscheck.harness.numerics.ladder import EPSILON
from physics_crosscheck.harness.numerics.segments import BlownUpError
from physics_crosscheck.harness.records.base import number
from physics_crosscheck.harness.records.cause import CauseId
from physics_crosscheck.harness.records.mutation import FaultKind, FaultVerdict, Mutation
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.integrate import ReferenceError

SHOWN = 2.0
"""A fault whose effect is larger than what is uncertain by so many times has to be caught."""


@dataclass(frozen=True, kw_only=True)
class TreeFault:
    """A number of a sound model made wrong.

    Attributes:
        model: the sound model, at the states of a diagnosis.
        index: of the number.
        size: what it is called by how much it is wrong: a key of `SIZES`.
        first_seen: share of its size at which the number is first seen; inf: never.
        uncertainty: of the ends of the sound model's segments, relative.
    """

    model: RobotTask
    index: int
    size: str
    first_seen: float
    uncertainty: float

    @property
    def share(self) -> float:
        """Of the number's size, by which it is wrong."""
        return SIZES[self.size] - 1


def faults_of(task: RobotTask) -> tuple[TreeFault, ...]:
    """All that is to be made wrong: each number that may say something of the bodies, three times.

    Raises:
        MutationError: for a model that is not sound to begin with.
        RobotError, EngineError, BlownUpError: naming what could not be run.
    """
    task = replace(task, samples=some_of(task.samples))
    case = run_robot(task)
    if case.outcome is not Outcome.AGREES or case.verdict is None:
        raise MutationError(
            f"{task.file}: it does not agree with its equations in {task.engine}; to show what"
            " would be caught it must be right: see `crosscheck run`"
        )
    known = max(case.verdict.largest_uncertainty or 0.0, task.resolution)
    numbers = robot_numbers(task.file, task.settings)
    problem = problem_of(task, numbers, is_reference=False)
    return tuple(
        TreeFault(
            model=task,
            index=index,
            size=size,
            first_seen=_first(problem.effect(k), _size(numbers.numerals[index]), known),
            uncertainty=known,
        )
        for k, index in enumerate(numbers.relevant_numbers)
        for size in SIZES
    )


def _size(one: Number) -> float:
    """A number's own, or that of those beside it where it is as good as zero."""
    return abs(one.value) if abs(one.value) > SMALL else one.scale


def _first(slope: Array | None, size: float, known: float) -> float:
    """Share of a number's size from which on it is seen; inf where it has no say at all.

    0 where no slope is known: the engine shows what it does.
    """
    if slope is None:
        return 0.0
    effect = float(np.max(np.abs(slope), initial=0.0)) * size
    return known / effect if effect > EPSILON else np.inf


def mutated_tree(fault: TreeFault) -> Mutation:
    """Make one number of a model wrong, and see what the check says."""
    began = time.process_time()
    numbers = robot_numbers(fault.model.file, fault.model.settings)
    one = numbers.numerals[fault.index]
    value = one.value + fault.share * _size(one)
    row = _row(fault, one.address, FaultVerdict.UNTESTED)
    if np.isfinite(fault.first_seen):
        with scratch() as copies:
            copy = copy_with_texts(fault.model.file, numbers.texts({fault.index: value}), copies)
            try:
                row = _judged(fault, one, value, replace(fault.model, file=copy))
            except (EngineError, BlownUpError) as error:
                row = _row(fault, one.address, FaultVerdict.REFUSED, str(error))
            said = original_paths(row.message, copy.parent, fault.model.file.parent)
            row = msgspec.structs.replace(row, message=said)
    return msgspec.structs.replace(row, seconds=time.process_time() - began)


def died(fault: TreeFault, reason: str) -> Mutation:
    """The row of a fault that the engine does not run."""
    numbers = robot_numbers(fault.model.file, fault.model.settings)
    return _row(fault, numbers.numerals[fault.index].address, FaultVerdict.REFUSED, reason)


def _judged(fault: TreeFault, one: Number, value: float, wrong: RobotTask) -> Mutation:
    """The row of a fault, from the motions of the wrong model."""
    case = run_robot(wrong)
    size = None if case.verdict is None else case.verdict.largest_discrepancy
    if case.outcome is not Outcome.DIFFERS:
        verdict = FaultVerdict.UNTESTED if _is_faint(fault, value) else FaultVerdict.MISSED
        return _row(fault, one.address, verdict, f"{case.outcome} {case.reason}".strip(), size)
    ranking = ranked(RobotDiagnosisTask(task=wrong, is_reference=False))
    if not ranking.fits:
        return _row(fault, one.address, FaultVerdict.CAUGHT, "", size)
    first, cause = ranking.fits[0], CauseId(kind="literal", subject=(one.address,))
    right = len(first.causes) == 1 and cause in (*first.causes, *first.tied_with)
    verdict = FaultVerdict.NAMED if right and ranking.explained else FaultVerdict.CAUGHT
    row = _row(fault, one.address, verdict, " and ".join(map(str, first.causes)), size)
    fit = next((fit for fit in ranking.fits if fit.causes == (cause,)), None)
    off = None if fit is None else abs(fit.estimates[0] - one.value) / abs(value - one.value)
    return msgspec.structs.replace(row, estimate_error=number(off))


def _is_faint(fault: TreeFault, value: float) -> bool:
    """Return whether a fault of this size moves no segment by more than is uncertain.

    By the slope; or by the equations with that value, where the effect grows with the square of
    the fault, as that of an axis out of the plane of all motions.
    """
    if fault.share < SHOWN * fault.first_seen:
        return True
    numbers = robot_numbers(fault.model.file, fault.model.settings)
    tree = numbers.tree({fault.index: value})
    if tree is None:
        return False
    try:
        effect = problem_of(fault.model, numbers, is_reference=False).left_by(tree)
    except ReferenceError:
        return False
    return float(np.max(np.abs(effect), initial=0.0)) < SHOWN * fault.uncertainty


def _row(
    fault: TreeFault,
    address: str,
    verdict: FaultVerdict,
    message: str = "",
    size: float | None = None,
) -> Mutation:
    return Mutation(
        system=fault.model.robot,
        model=fault.model.file.name,
        engine=fault.model.engine,
        kind=FaultKind.LITERAL,
        name=fault.size,
        location=address,
        verdict=verdict,
        discrepancy=number(size),
        message=message,
        estimate_error=None,
        first_caught=number(fault.first_seen),
    )
