"""Faults in robot files and in models of declared bodies: wrong numbers, and typical mistakes.

The equations give the effect of a number on the ends of segments, so only numbers that affect
motions are run.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import msgspec
import numpy as np

from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.task import TreeTask
from physics_crosscheck.harness.commands.mutation.faults import SIZES
from physics_crosscheck.harness.commands.mutation.judge import with_ranking
from physics_crosscheck.harness.commands.mutation.survey import MutationError
from physics_crosscheck.harness.commands.mutation.tree_mistakes import TreeMistake, tree_mistakes
from physics_crosscheck.harness.diagnosis.robot_task import (
    at_some,
    diagnose_robot,
    problem_of,
    ranked,
)
from physics_crosscheck.harness.diagnosis.trial import scratch
from physics_crosscheck.harness.documents.errors import original_paths
from physics_crosscheck.harness.engines.protocol import EngineError
from physics_crosscheck.harness.modelfiles.copies import copy_with_texts
from physics_crosscheck.harness.modelfiles.numbers import SMALL, Number
from physics_crosscheck.harness.modelfiles.readers import Numbers, robot_numbers
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
    """A sound model with one wrong number, or one typical mistake.

    Attributes:
        model: the sound model, at the states of a diagnosis.
        mistake: what is wrong.
        size: the wrong number's relative size; None for a typical mistake.
        first_seen: smallest detectable change of the number, as a share of its size; inf:
            undetectable; 0: unknown.
        uncertainty: relative uncertainty of the ends of the sound model's segments.
    """

    model: TreeTask
    mistake: TreeMistake
    size: float | None
    first_seen: float
    uncertainty: float


def faults_of(task: TreeTask) -> tuple[TreeFault, ...]:
    """Return all faults of a model: three for each number that may affect the bodies, and typical
    mistakes.

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
    literals = (
        TreeFault(
            model=task,
            mistake=_wrong(numbers.numerals[index], index, name, factor - 1),
            size=factor - 1,
            first_seen=_first(problem.effect(k), _size(numbers.numerals[index]), uncertainty),
            uncertainty=uncertainty,
        )
        for k, index in enumerate(numbers.relevant_numbers)
        for name, factor in SIZES.items()
    )
    mistakes = (
        TreeFault(model=task, mistake=one, size=None, first_seen=0.0, uncertainty=uncertainty)
        for one in tree_mistakes(task, numbers)
    )
    return (*literals, *mistakes)


def _wrong(entry: Number, index: int, name: str, share: float) -> TreeMistake:
    """Return one number that is off by a share of its size."""
    return TreeMistake(
        name=name,
        location=entry.address,
        values={index: entry.value + share * _size(entry)},
        causes=frozenset({CauseId(kind="literal", subject=(entry.address,))}),
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
    """Plant one fault in a model, and judge it."""
    began = time.process_time()
    row = _row(fault, FaultVerdict.UNTESTED)
    if np.isfinite(fault.first_seen):
        numbers = robot_numbers(fault.model.file, fault.model.spec.settings)
        with scratch() as copies:
            texts = numbers.texts(fault.mistake.values)
            copy = copy_with_texts(fault.model.file, texts, copies)
            wrong = fault.model.with_file(copy).with_settings(**fault.mistake.settings)
            try:
                row = _judged(fault, numbers, wrong)
            except (EngineError, BlownUpError) as error:
                row = _row(fault, FaultVerdict.REFUSED, str(error))
            message = original_paths(row.message, copy.parent, fault.model.file.parent)
            row = msgspec.structs.replace(row, message=message)
    return msgspec.structs.replace(row, seconds=time.process_time() - began)


def died(fault: TreeFault, reason: str) -> Mutation:
    """Build the row of a fault that the engine does not run."""
    return _row(fault, FaultVerdict.REFUSED, reason)


def _judged(fault: TreeFault, numbers: Numbers, wrong: TreeTask) -> Mutation:
    """Build the row of a fault, from the motions of the wrong model."""
    case = run_case(wrong)
    if case.outcome is Outcome.REFUSED:
        return _row(fault, FaultVerdict.REFUSED, case.reason)
    size = None if case.verdict is None else case.verdict.largest_discrepancy
    if case.outcome is Outcome.UNRESOLVED:  # it does not agree
        return _row(fault, FaultVerdict.CAUGHT, f"unresolved: {case.reason}", size)
    if case.outcome is not Outcome.DIFFERS:
        verdict = FaultVerdict.UNTESTED if _is_faint(fault, numbers) else FaultVerdict.MISSED
        return _row(fault, verdict, f"{case.outcome} {case.reason}".strip(), size)
    if case.kind == "pose":
        return _row(fault, FaultVerdict.CAUGHT, case.reason, size)
    if fault.mistake.settings:  # the engine reads a right file otherwise
        diagnosis = diagnose_robot(wrong, is_reference=True)
        causes = diagnosis.explanations[0].causes if diagnosis.explanations else ()
        right = diagnosis.explained and fault.mistake.causes.issuperset(one.id for one in causes)
        verdict = FaultVerdict.NAMED if right else FaultVerdict.CAUGHT
        return _row(fault, verdict, " and ".join(str(one.id) for one in causes), size)
    try:
        ranking = ranked(wrong, is_reference=False)
    except ReferenceError as error:  # a fault so large that its file has other segments
        return _row(fault, FaultVerdict.CAUGHT, f"not diagnosed: {error}", size)
    row = _row(fault, FaultVerdict.CAUGHT, "", size)
    return with_ranking(row, ranking, fault.mistake.causes, _values(fault, numbers))


def _values(fault: TreeFault, numbers: Numbers) -> tuple[float, float] | None:
    """Return the right and the wrong value of a number; None for a typical mistake."""
    if fault.size is None:
        return None
    ((index, wrong),) = fault.mistake.values.items()
    return numbers.numerals[index].value, wrong


def _is_faint(fault: TreeFault, numbers: Numbers) -> bool:
    """Return whether a fault moves no segment beyond its uncertainty.

    The slope decides, or the equations with those values if the effect is quadratic, such as that
    of an axis out of the plane of all motions.
    """
    if fault.size is not None and fault.size < SHOWN * fault.first_seen:
        return True
    tree = numbers.tree(fault.mistake.values)
    if tree is None:
        return False
    try:
        effect = problem_of(fault.model, numbers, is_reference=False).left_by(tree)
    except ReferenceError:
        return False
    return float(np.max(np.abs(effect), initial=0.0)) < SHOWN * fault.uncertainty


def _row(
    fault: TreeFault, verdict: FaultVerdict, message: str = "", size: float | None = None
) -> Mutation:
    return Mutation(
        system=fault.model.target.record.name,
        model=fault.model.file.name,
        engine=fault.model.engine,
        kind=FaultKind.MISTAKE if fault.size is None else FaultKind.LITERAL,
        name=fault.mistake.name,
        location=fault.mistake.location,
        verdict=verdict,
        discrepancy=number(size),
        message=message,
        estimate_error=None,
        first_caught=None if fault.size is None else number(fault.first_seen),
    )
