"""Faults in robot files and in models of declared bodies: wrong numbers, and typical mistakes.

The equations give the effect of a number on the ends of segments, and the laws that on whole steps,
so only numbers that affect one of them, or the place of a shape, are run.
"""

import math
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np

from physics_crosscheck.harness.checks.case import run_case
from physics_crosscheck.harness.checks.prepare import PreparedTree
from physics_crosscheck.harness.checks.task import TreeTask
from physics_crosscheck.harness.diagnosis.law_problem import LawProblem, diagnose_laws, law_problem
from physics_crosscheck.harness.diagnosis.robot_problem import AXIS, joint_of
from physics_crosscheck.harness.diagnosis.robot_task import (
    at_some,
    diagnose_robot,
    problem_of,
    ranked,
)
from physics_crosscheck.harness.documents.elements import Number
from physics_crosscheck.harness.modelfiles.numbers import SMALL, ModelFile
from physics_crosscheck.harness.modelfiles.readers import robot_numbers
from physics_crosscheck.harness.numerics.ladder import EPSILON
from physics_crosscheck.harness.records.case import Case
from physics_crosscheck.harness.records.cause import CauseId, CauseKind
from physics_crosscheck.harness.records.mutation import FaultVerdict, Mutation
from physics_crosscheck.harness.records.outcome import Outcome
from physics_crosscheck.reference.mechanism.numeric import Array
from physics_crosscheck.reference.solving.integrate import ReferenceError
from .judge import with_ranking
from .mistakes import Edit, Mistake, defaults_left_on
from .survey import SIZES, MutationError, PlantedFault

GRAMS = 1000.0
"""Factor of a mass that is stated in grams."""

Group = Mapping[int, Number]
"""Numbers of one list, or of one tensor, by index in the file."""


def tree_mistakes(task: TreeTask, numbers: ModelFile) -> Iterator[Mistake]:
    """Yield every mistake that the file has a place for."""
    groups = _groups(numbers)
    for pattern, name, change in _FAMILIES:
        for place, group in groups.items():
            if re.fullmatch(pattern, next(iter(group.values())).path):
                yield from _changed(name, place, group, change(group))
    yield from defaults_left_on(task, whole=False)


def law_mistakes(task: TreeTask, problem: LawProblem) -> Iterator[Mistake]:
    """Yield every other choice of a number, and every mistake in the laws, that has a place."""
    yield from defaults_left_on(task, whole=True)
    for index, others in problem.numbers.law_choices.items():
        address = problem.numbers.numerals[index].address
        for value in others:
            yield Mistake(
                name=f"{value} instead",
                location=address,
                edit=Edit(numbers={index: value}),
                causes=frozenset({CauseId(kind="taken", subject=(address,))}),
            )
    for mistake in problem.mistakes:
        yield Mistake(
            name=mistake.name,
            location="law",
            edit=Edit(law=mistake.name),
            causes=frozenset({CauseId(kind="law", subject=(mistake.name,))}),
        )


def _changed(name: str, place: str, group: Group, values: Mapping[int, float]) -> Iterator[Mistake]:
    """Yield the mistake that gives these values to a list, unless they are the present ones."""
    values = {i: value for i, value in values.items() if value != group[i].value}
    if not values:
        return
    addresses = [group[i].address for i in values]
    causes = {CauseId(kind="literal", subject=(address,)) for address in addresses}
    causes.add(CauseId(kind="exchange", subject=tuple(addresses)))
    if joint := joint_of(group[next(iter(values))].within):
        causes.add(CauseId(kind="axis", subject=(joint,)))
    yield Mistake(name, place, Edit(numbers=values), frozenset(causes))


def _groups(numbers: ModelFile) -> dict[str, dict[int, Number]]:
    """Return the lists that have relevant numbers; the six of a tensor are one list."""
    groups: dict[str, dict[int, Number]] = {}
    relevant = set(numbers.relevant_numbers)
    for i, number in enumerate(numbers.numerals):
        place = re.sub(r"\[\d\]$", "", number.address)
        place = re.sub(r"(inertia)[@/]i[xyz]{2}$", r"\1", place)
        groups.setdefault(place, {})[i] = number
    return {place: group for place, group in groups.items() if not relevant.isdisjoint(group)}


def _reversed(group: Group) -> dict[int, float]:
    return {i: -one.value for i, one in group.items() if one.value}


def _dropped(group: Group) -> dict[int, float]:
    return dict.fromkeys(group, 0.0)


def _in_grams(group: Group) -> dict[int, float]:
    return {i: GRAMS * one.value for i, one in group.items()}


def _exchanged(group: Group) -> dict[int, float]:
    """Exchange the first and the last moment, as about x and z; products stay."""
    moments = [i for i, one in group.items() if not re.search(r"i(xy|xz|yz)$", one.path)]
    if len(moments) < 3:
        return {}
    first, last = moments[0], moments[-1]
    return {first: group[last].value, last: group[first].value}


def _per_radian(group: Group) -> dict[int, float]:
    return {i: math.degrees(one.value) for i, one in group.items()}


_FAMILIES: tuple[tuple[str, str, Callable[[Group], dict[int, float]]], ...] = (
    (AXIS.pattern, "axis flipped", _reversed),
    (r".*(mass@value|inertial/mass|inertial@mass|@physics:mass)", "grams for kilograms", _in_grams),
    (
        r".*(inertia[@/]i[xyz]{2}|@diaginertia|@physics:diagonalInertia)",
        "moments exchanged",
        _exchanged,
    ),
    (
        r".*(inertial/origin@xyz|inertial@pos|@physics:centerOfMass)",
        "centre of mass left out",
        _dropped,
    ),
    (
        r".*(inertial/origin@rpy|@physics:principalAxes)",
        "rotation of the inertia left out",
        _dropped,
    ),
    (r".*@(drive:(ang|rot).*:(stiffness|damping)|newton:damping)", "per radian", _per_radian),
)
"""Paths of numbers, the mistake, and the values that it gives to a list of them."""


SHOWN = 2.0
"""Effect of a fault, relative to the uncertainty, above which it must be caught."""


TreeFault = PlantedFault[PreparedTree]
"""A fault in a robot file, or in a model of bodies."""


def tree_faults(task: TreeTask) -> tuple[TreeFault, ...]:
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
    laws = sound_laws(task)
    first = {
        index: _first(problem.effect(k), _size(numbers.numerals[index]), uncertainty)
        for k, index in enumerate(numbers.relevant_numbers)
    }
    in_steps = {} if laws is None else dict(_first_in_steps(laws, task.resolution))
    rest = set(range(len(numbers.numerals))) - set(first) - set(in_steps)
    placing = dict.fromkeys(numbers.placing(rest) if task.sidecar is None else (), 0.0)
    literals = (
        TreeFault(
            model=task,
            mistake=(mistake := _wrong(numbers.numerals[index], index, name, factor - 1)),
            values=(numbers.numerals[index].value, mistake.edit.numbers[index]),
            size=factor - 1,
            first_seen=min(seen.get(index, np.inf) for seen in (first, in_steps, placing)),
            in_steps=in_steps.get(index, np.inf) < first.get(index, np.inf),
            uncertainty=uncertainty,
        )
        for index in sorted({*first, *in_steps, *placing})
        for name, factor in SIZES.items()
    )
    typical = [
        *tree_mistakes(task, numbers),
        *(law_mistakes(task, laws) if laws is not None else ()),
    ]
    mistakes = (TreeFault(model=task, mistake=one, uncertainty=uncertainty) for one in typical)
    return (*literals, *mistakes)


def _first_in_steps(laws: LawProblem, resolution: float) -> Iterator[tuple[int, float]]:
    """Yield the numbers of laws, each with its smallest change that whole steps detect."""
    for k, index in enumerate(laws.numbers.law_numbers):
        size = _size(laws.numbers.numerals[index])
        yield index, _first(laws.effect(k), size, resolution)


_SOUND: dict[tuple[Path, str], LawProblem | None] = {}
"""The last sound file with its laws, by the file and the engine."""


def sound_laws(task: TreeTask) -> LawProblem | None:
    """Return the sound file with its laws, where whole steps agree with them; None otherwise.

    A process keeps the last one.
    """
    key = task.file, task.engine
    if key not in _SOUND:
        _SOUND.clear()
        has_laws = task.sidecar is None and not task.target.smooth
        laws = law_problem(task) if has_laws else None
        agrees = laws is not None and laws.judge(task.resolution).outcome is Outcome.AGREES
        _SOUND[key] = laws if agrees else None
    return _SOUND[key]


def _wrong(entry: Number, index: int, name: str, share: float) -> Mistake:
    """Return one number that is off by a share of its size."""
    kinds: tuple[CauseKind, ...] = ("literal", "taken")
    return Mistake(
        name,
        entry.address,
        Edit(numbers={index: entry.value + share * _size(entry)}),
        frozenset(CauseId(kind=kind, subject=(entry.address,)) for kind in kinds),
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


def judge_bodies(fault: TreeFault, wrong: TreeTask) -> Mutation:
    """Build the row of a fault, from the motions of the wrong model."""
    if fault.mistake.edit.law:
        return _by_law(fault)
    if fault.first_seen == np.inf:
        return fault.row(FaultVerdict.UNTESTED)
    numbers = robot_numbers(fault.model.file, fault.model.spec.settings)
    case = run_case(wrong)
    if case.outcome is Outcome.REFUSED:
        return fault.row(FaultVerdict.REFUSED, case.reason)
    size = None if case.verdict is None else case.verdict.largest_discrepancy
    if case.outcome is Outcome.UNRESOLVED:  # it does not agree
        return fault.row(FaultVerdict.CAUGHT, f"unresolved: {case.reason}", size)
    if case.outcome is not Outcome.DIFFERS:
        verdict = FaultVerdict.UNTESTED if _is_faint(fault, numbers) else FaultVerdict.MISSED
        return fault.row(verdict, f"{case.outcome} {case.reason}".strip(), size)
    if case.kind == "pose":
        return fault.row(_by_place(fault, numbers, case), case.reason, size)
    if case.kind in ("whole step", "compiled number", "contact"):
        return _in_steps(fault, wrong, fault.row(FaultVerdict.CAUGHT, "", size))
    if fault.mistake.edit.settings:  # the engine reads a right file otherwise
        diagnosis = diagnose_robot(wrong, is_reference=True)
        causes = diagnosis.explanations[0].causes if diagnosis.explanations else ()
        right = diagnosis.explained and fault.mistake.causes.issuperset(one.id for one in causes)
        verdict = FaultVerdict.NAMED if right else FaultVerdict.CAUGHT
        return fault.row(verdict, " and ".join(str(one.id) for one in causes), size)
    try:
        ranking = ranked(wrong, is_reference=False)
    except ReferenceError as error:  # a fault so large that its file has other segments
        return fault.row(FaultVerdict.CAUGHT, f"not diagnosed: {error}", size)
    row = fault.row(FaultVerdict.CAUGHT, "", size)
    return with_ranking(row, ranking, fault.mistake.causes, fault.values)


def _by_place(fault: TreeFault, numbers: ModelFile, case: Case) -> FaultVerdict:
    """Judge a fault that displaces a body or shape: named if a line of its element is."""
    lines = {one.line for one in case.locations}
    elements = (numbers.numerals[i] for i in fault.mistake.edit.numbers)
    named = any(number.line in lines for number in elements)
    return FaultVerdict.NAMED if named else FaultVerdict.CAUGHT


def _in_steps(fault: TreeFault, wrong: TreeTask, row: Mutation) -> Mutation:
    """Add the causes of a fault that whole steps show."""
    laws = sound_laws(fault.model)
    problem = None if laws is None else laws.in_engine(wrong.spec)
    if problem is None or problem.judge(wrong.resolution).outcome is not Outcome.DIFFERS:
        problem = law_problem(wrong, None)  # it differs at other states
    if problem is None:
        return row
    return with_ranking(row, diagnose_laws(problem), fault.mistake.causes, fault.values)


def _by_law(fault: TreeFault) -> Mutation:
    """Build the row of a mistake in the laws, in an engine that steps by them."""
    laws = sound_laws(fault.model)
    assert laws is not None  # they have the mistake
    if fault.mistake.edit.settings:
        return _unconverged(fault, laws)
    problem = laws.mistaken(fault.mistake.edit.law)
    judged = problem.judge(fault.model.resolution)
    if judged.outcome is Outcome.AGREES:
        return fault.row(FaultVerdict.UNTESTED, "no state depends on it")
    row = fault.row(FaultVerdict.CAUGHT, "", judged.largest_discrepancy)
    return with_ranking(row, diagnose_laws(problem), fault.mistake.causes, None)


def _unconverged(fault: TreeFault, laws: LawProblem) -> Mutation:
    """Build the row of settings whose error the engine reports, as a force that is not balanced."""
    task = fault.model.with_settings(**fault.mistake.edit.settings)
    bounds = np.max(laws.in_engine(task.spec).compared.uncertainty, axis=1)
    unresolved = int(np.sum(bounds > task.resolution))
    if not unresolved:
        return fault.row(FaultVerdict.UNTESTED, "it converges at each state")
    words = f"{fault.mistake.edit.law}: error up to {np.max(bounds):.0e} at {unresolved} states"
    return fault.row(FaultVerdict.NAMED, words, float(np.max(bounds)))


def _is_faint(fault: TreeFault, numbers: ModelFile) -> bool:
    """Return whether a fault moves no segment beyond its uncertainty.

    The slope decides, or the equations with those values if the effect is quadratic, such as that
    of an axis out of the plane of all motions.
    """
    if fault.size and fault.size < SHOWN * (fault.first_seen or 0.0):
        return True
    if fault.in_steps:
        return False
    tree = numbers.tree(fault.mistake.edit.numbers)
    if tree is None:
        return False
    try:
        effect = problem_of(fault.model, numbers, is_reference=False).left_by(tree)
    except ReferenceError:
        return False
    return float(np.max(np.abs(effect), initial=0.0)) < SHOWN * fault.uncertainty
