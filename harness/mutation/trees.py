"""Faults in single numbers of robot files and of models of declared bodies.

The equations give the effect of a number on the ends of segments, so only numbers that affect
motions are run. Known mistakes are not planted: they need declared energies.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import msgspec
import numpy as np

from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.task import TreeTask
from physics_crosscheck.harness.diagnosis.hypotheses.trial import scratch
from physics_crosscheck.harness.diagnosis.robot_task import at_some, problem_of, ranked
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
"""Effect of a fault, relative to the uncertainty, above which it must be caught."""


@dataclass(frozen=True, kw_only=True)
class TreeFault:
    """A sound model with one wrong number.

    Attributes:
        model: the sound model, at the states of a diagnosis.
        index: index of the number.
        size: name of the size of the fault: a key of `SIZES`.
        first_seen: smallest detectable change of the number, as a share of its size; inf:
            undetectable.
        uncertainty: relative uncertainty of the ends of the sound model's segments.
    """

    model: TreeTask
    index: int
    size: str
    first_seen: float
    uncertainty: float

    @property
    def share(self) -> float:
        """Size of the fault as a share of the number's size."""
        return SIZES[self.size] - 1


def faults_of(task: TreeTask) -> tuple[TreeFault, ...]:
    """Return all faults of a model: three for each number that may affect the bodies.

    Raises:
        MutationError: for a model that is not sound.
        RobotError, EngineError, BlownUpError: naming the model that cannot run.
    """
    task = at_some(task)
    case = run_case(task)
    if case.outcome is not Outcome.AGREES or case.verdict is None:
        raise MutationError(
            f"{task.file}: it does not agree with its equations in {task.engine}; to show what"
            " would be caught it must be right: see `crosscheck run`"
        )
    uncertainty = max(case.verdict.largest_uncertainty or 0.0, task.resolution)
    numbers = robot_numbers(task.file, task.spec.settings)
    problem = problem_of(task, numbers, is_reference=False)
    return tuple(
        TreeFault(
            model=task,
            index=index,
            size=size,
            first_seen=_first(problem.effect(k), _size(numbers.numerals[index]), uncertainty),
            uncertainty=uncertainty,
        )
        for k, index in enumerate(numbers.relevant_numbers)
        for size in SIZES
    )


def _size(entry: Number) -> float:
    """Return a number's size, or that of its neighbours if it is practically zero."""
    return abs(entry.value) if abs(entry.value) > SMALL else entry.scale


def _first(slope: Array | None, size: float, uncertainty: float) -> float:
    """Return the smallest detectable change as a share of a number's size; inf without any effect.

    Return 0 if the slope is unknown: then the engine has to show the effect.
    """
    if slope is None:
        return 0.0
    effect = float(np.max(np.abs(slope), initial=0.0)) * size
    return uncertainty / effect if effect > EPSILON else np.inf


def mutated_tree(fault: TreeFault) -> Mutation:
    """Plant one wrong number in a model, and judge it."""
    began = time.process_time()
    numbers = robot_numbers(fault.model.file, fault.model.spec.settings)
    entry = numbers.numerals[fault.index]
    value = entry.value + fault.share * _size(entry)
    row = _row(fault, entry.address, FaultVerdict.UNTESTED)
    if np.isfinite(fault.first_seen):
        with scratch() as copies:
            copy = copy_with_texts(fault.model.file, numbers.texts({fault.index: value}), copies)
            try:
                row = _judged(fault, entry, value, fault.model.with_file(copy))
            except (EngineError, BlownUpError) as error:
                row = _row(fault, entry.address, FaultVerdict.REFUSED, str(error))
            message = original_paths(row.message, copy.parent, fault.model.file.parent)
            row = msgspec.structs.replace(row, message=message)
    return msgspec.structs.replace(row, seconds=time.process_time() - began)


def died(fault: TreeFault, reason: str) -> Mutation:
    """Build the row of a fault that the engine does not run."""
    numbers = robot_numbers(fault.model.file, fault.model.spec.settings)
    return _row(fault, numbers.numerals[fault.index].address, FaultVerdict.REFUSED, reason)


def _judged(fault: TreeFault, entry: Number, value: float, wrong: TreeTask) -> Mutation:
    """Build the row of a fault, from the motions of the wrong model."""
    case = run_case(wrong)
    if case.outcome is Outcome.REFUSED:
        return _row(fault, entry.address, FaultVerdict.REFUSED, case.reason)
    size = None if case.verdict is None else case.verdict.largest_discrepancy
    if case.outcome is not Outcome.DIFFERS:
        verdict = FaultVerdict.UNTESTED if _is_faint(fault, value) else FaultVerdict.MISSED
        return _row(fault, entry.address, verdict, f"{case.outcome} {case.reason}".strip(), size)
    ranking = ranked(wrong, is_reference=False)
    if not ranking.fits:
        return _row(fault, entry.address, FaultVerdict.CAUGHT, "", size)
    first, cause = ranking.fits[0], CauseId(kind="literal", subject=(entry.address,))
    right = len(first.causes) == 1 and cause in (*first.causes, *first.tied_with)
    verdict = FaultVerdict.NAMED if right and ranking.explained else FaultVerdict.CAUGHT
    row = _row(fault, entry.address, verdict, " and ".join(map(str, first.causes)), size)
    fit = next((fit for fit in ranking.fits if fit.causes == (cause,)), None)
    off = None if fit is None else abs(fit.estimates[0] - entry.value) / abs(value - entry.value)
    return msgspec.structs.replace(row, estimate_error=number(off))


def _is_faint(fault: TreeFault, value: float) -> bool:
    """Return whether a fault of this size moves no segment beyond its uncertainty.

    The slope decides, or the equations with that value if the effect is quadratic, such as that of
    an axis out of the plane of all motions.
    """
    if fault.share < SHOWN * fault.first_seen:
        return True
    numbers = robot_numbers(fault.model.file, fault.model.spec.settings)
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
        system=fault.model.target.record.name,
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
