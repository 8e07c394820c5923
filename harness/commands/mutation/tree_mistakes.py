"""Typical mistakes in the file of a robot, and in the settings of an engine for it."""

import math
import re
from collections.abc import Callable, Iterator, Mapping

from physics_crosscheck.harness.checks.task import TreeTask
from physics_crosscheck.harness.diagnosis.law_problem import LawProblem
from physics_crosscheck.harness.diagnosis.robot_problem import AXIS, joint_of
from physics_crosscheck.harness.documents.elements import Number
from physics_crosscheck.harness.engines.protocol import DefaultLeftOn
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.numbers import ModelFile
from physics_crosscheck.harness.records.cause import CauseId
from .mistakes import Edit, Mistake

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
    yield from _left_on(task, whole=False)


def _left_on(task: TreeTask, *, whole: bool) -> Iterator[Mistake]:
    """Yield each default of the engine that is left on; `whole`: one of whole steps."""
    for usual in engines()[task.engine].usual_mistakes:
        if (
            isinstance(usual, DefaultLeftOn)
            and usual.whole == whole
            and task.spec.settings.get(usual.setting) != usual.value
        ):
            yield Mistake(
                name=usual.name,
                location=f"settings.{usual.setting}",
                edit=Edit(settings={usual.setting: usual.value}, law=usual.cause if whole else ""),
                causes=frozenset({CauseId(kind="default", subject=(usual.cause,))}),
            )


def law_mistakes(task: TreeTask, problem: LawProblem) -> Iterator[Mistake]:
    """Yield every other choice of a number, and every mistake in the laws, that has a place."""
    yield from _left_on(task, whole=True)
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


def _per_radian(group: Group) -> dict[int, float]:
    return {i: math.degrees(one.value) for i, one in group.items()}


def _exchanged(group: Group) -> dict[int, float]:
    """Exchange the first and the last moment, as about x and z; products stay."""
    moments = [i for i, one in group.items() if not re.search(r"i(xy|xz|yz)$", one.path)]
    if len(moments) < 3:
        return {}
    first, last = moments[0], moments[-1]
    return {first: group[last].value, last: group[first].value}


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
