"""Count of the numbers in a robot's file, by their effect on its motions."""

from __future__ import annotations

import re
from collections.abc import Collection

import numpy as np

from physics_crosscheck.harness.checks.task import TreeTask
from physics_crosscheck.harness.diagnosis.coverage import CountedNumber, summarized
from physics_crosscheck.harness.diagnosis.coverage_trials import NUDGE, NumberEffect
from physics_crosscheck.harness.diagnosis.robot_problem import RobotProblem
from physics_crosscheck.harness.diagnosis.robot_task import problem_of
from physics_crosscheck.harness.documents.elements import XmlElement
from physics_crosscheck.harness.engines.registry import engines
from physics_crosscheck.harness.modelfiles.numbers import NUDGE as SLOPE_NUDGE
from physics_crosscheck.harness.modelfiles.numbers import Number
from physics_crosscheck.harness.modelfiles.readers import read_robot, robot_numbers
from physics_crosscheck.harness.records.coverage import Coverage
from physics_crosscheck.reference.dynamics.tree_equations import TreeFrames
from physics_crosscheck.reference.mechanism.tree import WORLD

_INERTIAL = re.compile(r".*/(link|body)/inertial[/@].*")


def count_robot(task: TreeTask) -> Coverage:
    """Count the numbers of a file whose change moves the ends of segments beyond the resolution.

    Only the equations are used, at the states of a diagnosis; no engine runs.

    Raises:
        RobotError, ReferenceError: with the file.
    """
    numbers = robot_numbers(task.file, task.spec.settings)
    if numbers.unread:
        return Coverage(note="; ".join(numbers.unread))
    problem = problem_of(task, numbers, is_reference=False)
    says = {i: _effect(problem, k, task.resolution) for k, i in enumerate(numbers.relevant_numbers)}
    if task.sidecar is None:  # the bodies of a robot file are compared in their poses too
        says |= _in_frames(task, problem, [i for i in says if says[i] in _UNMOVED])
    choices, fixed = _choices(task), _fixed(task)
    counted = [
        CountedNumber(
            path=one.path,
            address=one.address,
            line=f"{one.file.name}:{one.line}",
            effect=_otherwise(one, says.get(i, NumberEffect.NONE), choices, fixed),
        )
        for i, one in enumerate(numbers.numerals)
    ]
    return summarized(counted, engines()[task.engine].non_physical)


def _effect(problem: RobotProblem, index: int, resolution: float) -> NumberEffect:
    """Return the effect of a number; a change that cannot be solved is not counted as no effect."""
    effect = problem.effect(index)
    if effect is None or not np.isfinite(effect).all():
        return NumberEffect.REFUSED
    moved = float(np.max(np.abs(effect), initial=0.0)) * NUDGE * problem.hypotheses[index].size
    if moved > resolution:
        return NumberEffect.MOTION
    return NumberEffect.FAINT if moved else NumberEffect.NONE


_UNMOVED = (NumberEffect.NONE, NumberEffect.FAINT)


def _in_frames(
    task: TreeTask, problem: RobotProblem, unmoved: Collection[int]
) -> dict[int, NumberEffect]:
    """Return those of the numbers that move nothing in time, but where a body is."""
    target, numbers = task.target, problem.numbers
    names = tuple(problem.flow.tree.frames)
    q = target.samples.start[:, : len(target.names)]
    before = TreeFrames(problem.flow.tree, names)(q)
    least = task.resolution * max(1.0, float(np.max(np.abs(before), initial=0.0)))
    effects = {}
    for i in unmoved:
        number = numbers.numerals[i]
        tree = numbers.tree({i: number.value - SLOPE_NUDGE * number.scale})  # known, from the slope
        if tree is None or tree.dof != len(target.names) or tuple(tree.frames) != names:
            continue
        moved = float(np.max(np.abs(TreeFrames(tree, names)(q) - before), initial=0.0))
        if moved * NUDGE / SLOPE_NUDGE > least:
            effects[i] = NumberEffect.FRAMES
    return effects


def _otherwise(
    number: Number, effect: NumberEffect, choices: str, fixed: Collection[str]
) -> NumberEffect:
    """Return a reason for no effect from the number's place in the file, or its effect."""
    if effect is NumberEffect.NONE and choices and re.fullmatch(choices, number.path):
        return NumberEffect.CHOICE
    if (
        effect is NumberEffect.NONE
        and _INERTIAL.fullmatch(number.path)
        and _owner(number.element) in fixed
    ):
        return NumberEffect.FIXED
    return effect


def _choices(task: TreeTask) -> str:
    return engines()[task.engine].choices


def _owner(element: XmlElement) -> str:
    """Return the name of the link or body that contains an element, or ""."""
    above: XmlElement | None = element
    while above is not None and above.tag not in ("link", "body"):
        above = above.parent
    return "" if above is None else above.attributes.get("name", "")


def _fixed(task: TreeTask) -> frozenset[str]:
    """Return names of fixed links."""
    robot = read_robot(task.file, floating=bool(task.spec.settings.get("floating")))
    return frozenset(part.name for part in robot.parts if part.body == WORLD)
